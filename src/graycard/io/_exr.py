# SPDX-License-Identifier: Apache-2.0
"""Layers in OpenEXR files: named channels, float32, scene-linear Rec.709, written whole or not at all."""

import io
import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from graycard._errors import DatasetError, GraycardError, OutputError, UnknownNameError
from graycard.io._files import atomic_path, free_mib
from graycard.layers import Layer, all_layers, find_layer

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Chromaticities of the primaries and of the white point D65 (ITU-R BT.709-6)."""
_ALIKE = 0.6
"""Likeness from which an unknown name counts as misspelt: the default of difflib."""


def write_layers(
    path: Path, arrays: Mapping[str, np.ndarray], metadata: Mapping[str, Any] | None = None
) -> None:
    """Write layers into one EXR file, channels ``<layer>.<suffix>``.

    Args:
        path: The file.
        arrays: By layer name, each of shape ``(H, W)`` or ``(H, W, 3)``.
        metadata: JSON data, kept in the header attribute ``graycard``.

    Raises:
        UnknownNameError: A layer is not in the vocabulary.
        ValueError: An array has a shape that its layer has not, or the sizes differ.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    channels: dict[str, np.ndarray] = {}
    for name, values in arrays.items():
        for suffix, plane in _planes(find_layer(name), values).items():
            channels[f"{name}.{suffix}"] = plane
    if len({plane.shape for plane in channels.values()}) != 1:
        sizes = {name: values.shape for name, values in arrays.items()}
        raise ValueError(f"expected one or more layers of one size, got {sizes}")
    _write(path, channels, {"graycard": json.dumps(dict(metadata))} if metadata else {})


def read_layers(path: Path, error: type[GraycardError] = DatasetError) -> dict[str, np.ndarray]:
    """Return all layers in an EXR file, each of shape ``(H, W)`` or ``(H, W, 3)``, float32 or uint32.

    Raises:
        DatasetError: (or ``error``) The file is missing or broken, or has channels of no layer.
    """
    pieces = _read(path, error)
    planes = _planes_of(pieces)
    names = _stems(planes)
    if "" in names:
        raise error(_nameless(path, planes))
    return {name: _assemble(path, name, planes, pieces.get(name), error) for name in names}


@dataclass(frozen=True, slots=True)
class KnownLayers:
    """Layers in an EXR file that anybody may have written."""

    layers: Mapping[str, np.ndarray]
    """By name, each ``(H, W)`` or ``(H, W, 3)``, float32 or uint32."""
    faults: Mapping[str, str]
    """By the name of a layer that cannot be used: why not."""


def read_known_layers(path: Path, error: type[GraycardError] = DatasetError) -> KnownLayers:
    """Return the layers in an EXR file that are known; channels of no layer are passed over.

    A layer that lacks a channel, or has one of another type, is a fault of its own and of no other layer.
    :func:`unknown_channels` names what is passed over.

    Raises:
        DatasetError: (or ``error``) The file is missing or broken, or has no layer that is known.
    """
    pieces = _read(path, error)
    planes = _planes_of(pieces)
    known = [name for name in _stems(planes) if _is_layer(name)]
    if not known:
        raise error(_nameless(path, planes))
    kept = {c: plane for c, plane in planes.items() if not _is_extra(c, planes)}
    layers: dict[str, np.ndarray] = {}
    faults: dict[str, str] = {}
    for name in known:
        try:
            layers[name] = _assemble(path, name, kept, pieces.get(name), error)
        except GraycardError as cause:
            faults[name] = str(cause)
    return KnownLayers(layers, faults)


def unknown_channels(path: Path) -> dict[str, str]:
    """Return the channels of an EXR file that no layer has: by name, the name that was perhaps meant.

    Only the header is read. Nothing is found in a file that is missing or broken.

    Returns:
        An empty name where none is like it.
    """
    sys.audit("graycard.read", str(path))
    if not Path(path).is_file():  # OpenEXR would wait for the other end of a pipe
        return {}
    try:
        with _warnings_as_errors(), OpenEXR.File(str(path), header_only=True) as file:
            channels = [channel.name for channel in file.header()["channels"]]
    except (*_DAMAGE, OSError):
        return {}
    strangers = [c for c in channels if not _is_layer(c.rpartition(".")[0]) or _is_extra(c, channels)]
    return {c: _meant(c) for c in strangers}


def _meant(channel: str) -> str:
    """Return the known layer, or for a channel without a suffix the channel, that a name is like."""
    stem, _, _ = channel.rpartition(".")
    if _is_layer(stem):
        return ""
    if not stem and _is_layer(channel):
        return f"{channel}.{find_layer(channel).channels[0]}"
    near = get_close_matches(stem or channel, [layer.name for layer in all_layers()], n=1, cutoff=_ALIKE)
    return next(iter(near), "")


def _stems(channels: Iterable[str]) -> list[str]:
    """Return the names of layers that channels are of, each once; empty for one without a suffix."""
    return list(dict.fromkeys(channel.rpartition(".")[0] for channel in channels))


def _is_layer(name: str) -> bool:
    try:
        find_layer(name)
    except UnknownNameError:
        return False
    return True


def _is_extra(channel: str, channels: Iterable[str]) -> bool:
    """Tell whether a layer is whole without a channel of its name that it does not have."""
    name, _, suffix = channel.rpartition(".")
    if not _is_layer(name):
        return False
    own = find_layer(name).channels
    return suffix not in own and {f"{name}.{c}" for c in own} <= {*channels}


def _nameless(path: Path, channels: Iterable[str]) -> str:
    named = {f"{c} (did you mean {near}?)" if (near := _meant(c)) else c: None for c in channels}
    return f"expected channels named <layer>.<suffix> in {path}, got {', '.join(named)}. Rename them"


def write_rgb(path: Path, values: np.ndarray) -> None:
    """Write one linear image of shape ``(H, W, 3)`` as plain ``R``, ``G``, ``B`` that any viewer opens.

    Raises:
        ValueError: The array has another shape.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    _write(path, _planes(find_layer("radiance"), values), {})


def read_rgb(path: Path, error: type[GraycardError] = DatasetError) -> np.ndarray:
    """Return a linear image of shape ``(H, W, 3)``, float32, from plain ``R``, ``G``, ``B``.

    Raises:
        DatasetError: (or ``error``) The file is missing or broken, or has other channels.
    """
    planes = _planes_of(_read(path, error))
    if not {"R", "G", "B"} <= planes.keys():
        raise error(f"expected channels R, G, B in {path}, got {', '.join(planes)}")
    return np.stack([planes[c].astype(np.float32, copy=False) for c in "RGB"], axis=-1)


def read_planes(path: Path, error: type[GraycardError] = DatasetError) -> dict[str, np.ndarray]:
    """Return every channel of an EXR file by its name, each ``(H, W)``, in its own type.

    Raises:
        DatasetError: (or ``error``) The file is missing or broken.
    """
    return _planes_of(_read(path, error))


def _planes(kind: Layer, values: np.ndarray) -> dict[str, np.ndarray]:
    """One contiguous plane per channel: OpenEXR writes a strided view as wrong pixels, silently."""
    values = np.asarray(values)
    count = len(kind.channels)
    if values.ndim != (2 if count == 1 else 3) or (count > 1 and values.shape[-1] != count):
        wanted = "(H, W)" if count == 1 else f"(H, W, {count})"
        raise ValueError(f"expected {kind.name} of shape {wanted}, got {values.shape}")
    stacked = values[..., None] if count == 1 else values
    return {
        suffix: np.array(stacked[..., i], dtype=kind.dtype, order="C")
        for i, suffix in enumerate(kind.channels)
    }


def _write(path: Path, channels: dict[str, np.ndarray], attributes: dict[str, str]) -> None:
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "chromaticities": REC709,
        **attributes,
    }
    with atomic_path(path) as partial:
        try:
            OpenEXR.File(header, channels).write(str(partial))
        except RuntimeError as cause:
            raise OutputError(
                f"expected room and permission to write {path}, got: {cause} ({free_mib(path):.1f} MiB "
                "free). Free some space or choose another output folder; the same command then goes "
                "on where it stopped"
            ) from cause


_DAMAGE = (RuntimeError, ValueError, MemoryError)
"""Errors that OpenEXR raises for files that it cannot read; a header may ask for any amount of memory."""
_PLAIN = ("RGB", "RGBA")
"""What OpenEXR calls colours whose channels have no name before the dot."""


def _read(path: Path, error: type[GraycardError]) -> dict[str, np.ndarray]:
    """Colours in one piece, ``(H, W, 3 or 4)``, by the name of the layer; other channels by their own."""
    sys.audit("graycard.read", str(path))  # OpenEXR opens files where Python's own audit does not see it
    if not Path(path).is_file():
        raise error(f"expected an EXR file at {path}, got none")
    try:
        try:
            return _pixels(path, separate=False)
        except _DAMAGE:  # colours whose channels are of several types stay apart
            return _pixels(path, separate=True)
    except _DAMAGE as cause:
        raise error(
            f"expected a whole EXR file at {path}, got one that breaks off or is none "
            f"({Path(path).stat().st_size} bytes: {cause}). Write it again"
        ) from cause


def _pixels(path: Path, separate: bool) -> dict[str, np.ndarray]:
    with _warnings_as_errors(), OpenEXR.File(str(path), separate_channels=separate) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}


@contextmanager
def _warnings_as_errors() -> Iterator[None]:
    """Around calls of OpenEXR, which prints on stdout why it leaves pixels out: stdout is for results.

    Raises:
        ValueError: It printed something.
    """
    said = io.StringIO()
    try:
        with redirect_stdout(said):
            yield
    finally:
        if words := said.getvalue().strip():
            raise ValueError(words.splitlines()[0])


def _planes_of(pieces: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Each channel by its name in the file."""
    planes = {}
    for name, pixels in pieces.items():
        if pixels.ndim == 2:
            planes[name] = pixels
        else:
            stem = "" if name in _PLAIN else f"{name}."
            planes |= {f"{stem}{c}": pixels[..., i] for i, c in enumerate("RGBA"[: pixels.shape[-1]])}
    return planes


def _assemble(
    path: Path,
    name: str,
    planes: Mapping[str, np.ndarray],
    piece: np.ndarray | None,
    error: type[GraycardError],
) -> np.ndarray:
    try:
        kind = find_layer(name)
    except UnknownNameError as cause:
        raise error(f"{path}: {cause}") from cause
    found = [c.rpartition(".")[2] for c in planes if c.rpartition(".")[0] == name]
    if set(found) != set(kind.channels):
        wanted = ", ".join(f"{name}.{c}" for c in kind.channels)
        came = ", ".join(f"{name}.{c}" for c in found)
        raise error(f"expected channels {wanted} in {path}, got {came}. Rename them")
    stored = {str(planes[f"{name}.{c}"].dtype.kind) for c in kind.channels}
    if (kind.dtype == "uint32") != (stored == {"u"}):
        raise error(f"expected {kind.dtype} channels for {name} in {path}, got other ones. Convert them")
    if piece is not None and piece.shape[2:] == (3,):  # R, G, B, or they would not have fitted
        return piece.astype(kind.dtype, copy=False)
    found = [planes[f"{name}.{c}"].astype(kind.dtype, copy=False) for c in kind.channels]
    return found[0] if len(found) == 1 else np.stack(found, axis=-1)
