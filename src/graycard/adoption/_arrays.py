# SPDX-License-Identifier: Apache-2.0
"""Read arrays from the files that other code writes: PNG, JPEG, TIFF, EXR, NPY, NPZ, and NPY in gzip."""

import gzip
import io
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from graycard._errors import PredictionError
from graycard.io import read_bytes, read_planes

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
ARRAYS = (".npy", ".npy.gz", ".npz")
SUFFIXES = (*PICTURES, ".exr", *ARRAYS)
_HEADERS = (SyntaxError, tokenize.TokenError)
"""Errors of NumPy about headers that are no Python."""
_BROKEN = (
    *(OSError, ValueError, EOFError, KeyError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, struct.error, *_HEADERS),
)
_OBJECTS = ("Object arrays", "Python objects")
"""Words by which NumPy says that an array holds none of numbers."""
_ORDERS = ("RGBA", "RGB", "XYZ", "Y", "Z", "V", "R", "A", "ID")
"""Suffixes of channels that make one image of an EXR file; the first that are all there."""
_LARGEST = 2**31
"""Bytes of an array in gzip: more is taken for a file that was made to fill the memory."""


def suffix_of(path: Path) -> str:
    """Return the suffix that says what a file is, in lower case.

    Raises:
        PredictionError: It is none that can be read.
    """
    name = path.name.lower()
    for suffix in sorted(SUFFIXES, key=len, reverse=True):
        if name.endswith(suffix):
            return suffix
    raise PredictionError(f"expected {', '.join(SUFFIXES)}, got {path}. Convert it")


def read_array(path: Path, key: str = "") -> np.ndarray:
    """Return what a file holds: of a picture ``(H, W)`` or ``(H, W, C)`` in its own type.

    Colours are in the order R, G, B, A.

    Args:
        path: The file.
        key: Name of the array in an NPZ, or of the layer in an EXR; empty where there is one.

    Raises:
        PredictionError: The file is broken or of another kind, or there is no such array.
    """
    suffix = suffix_of(path)
    if key and suffix not in (".npz", ".exr"):
        raise PredictionError(f"expected an NPZ or an EXR for key={key}, got {path}. Leave out key=")
    try:
        if suffix == ".exr":
            return _exr(path, key)
        if suffix == ".npz":
            return _npz(path, key)
        return _picture(path) if suffix in PICTURES else _npy(path, suffix)
    except _BROKEN as cause:
        if any(words in str(cause) for words in _OBJECTS):
            raise PredictionError(
                f"expected numbers in {path}, got objects of Python, which are not opened. Write float32"
            ) from cause
        raise PredictionError(
            f"expected a whole file at {path}, got one that breaks off or is none: {cause}. Write it again"
        ) from cause


def _picture(path: Path) -> np.ndarray:
    """Return the codes of a picture; OpenCV reads 16 bits of each colour, which Pillow cuts off."""
    import cv2

    try:
        codes = cv2.imdecode(np.frombuffer(read_bytes(path), np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as cause:
        raise ValueError("no picture that OpenCV can decode") from cause
    if codes is None:
        raise ValueError("no picture that OpenCV can decode")
    if codes.ndim == 3 and codes.shape[-1] >= 3:
        return codes[..., [2, 1, 0, *range(3, codes.shape[-1])]]
    return codes


def _npy(path: Path, suffix: str) -> np.ndarray:
    if suffix == ".npy":
        _refuse_pipes(path)
        return _checked(np.load(path, mmap_mode="r", allow_pickle=False), path)
    with gzip.open(path, "rb") as packed:
        data = packed.read(_LARGEST + 1)
    if len(data) > _LARGEST:
        raise ValueError(f"more than {_LARGEST} bytes in it")
    return _checked(np.load(io.BytesIO(data), allow_pickle=False), path)


def _refuse_pipes(path: Path) -> None:
    """Prove that a path is a file, and no pipe or device, which may have no end.

    Raises:
        ValueError: It is none.
    """
    if not path.is_file():
        raise ValueError("no file")


def _npz(path: Path, key: str) -> np.ndarray:
    _refuse_pipes(path)
    with open(path, "rb") as file, np.load(file, allow_pickle=False) as arrays:
        name = key or (arrays.files[0] if len(arrays.files) == 1 else "")
        if name not in arrays.files:
            known = ", ".join(arrays.files[:8]) or "none"
            raise PredictionError(
                f"expected array {key!r} in {path}, got {known}. Name one by key="
                if key
                else f"expected one array in {path}, got {len(arrays.files)}: {known}. Name one by key="
            )
        return _checked(arrays[name], path)


def _checked(values: np.ndarray, path: Path) -> np.ndarray:
    if values.dtype.kind not in "fiub":
        raise PredictionError(f"expected numbers in {path}, got {values.dtype}. Write float32")
    return values


def _exr(path: Path, key: str) -> np.ndarray:
    """Return one image of an EXR file, from the channels of a layer or those without one."""
    planes = read_planes(path, PredictionError)
    stems = list(dict.fromkeys(name.rpartition(".")[0] for name in planes))
    stem = key or ("" if "" in stems else stems[0] if len(stems) == 1 else None)
    if stem is None or stem not in stems:
        raise PredictionError(
            f"expected {f'layer {key}' if key else 'one layer'} in {path}, got "
            f"{', '.join(sorted(planes)[:9])}. Name one by key="
        )
    found = {name.rpartition(".")[2]: plane for name, plane in planes.items() if _is_of(name, stem)}
    return _stacked(found, path)


def _is_of(name: str, stem: str) -> bool:
    return name.rpartition(".")[0] == stem


def _stacked(planes: Mapping[str, np.ndarray], path: Path) -> np.ndarray:
    upper = {name.upper(): plane for name, plane in planes.items()}
    for order in _ORDERS:
        names = [order] if order == "ID" else list(order)
        if set(names) == set(upper):
            return np.stack([upper[n] for n in names], axis=-1)
    raise PredictionError(
        f"expected channels R, G, B or X, Y, Z or one alone in {path}, got {', '.join(sorted(planes))}. "
        "Name a layer by key="
    )
