# SPDX-License-Identifier: Apache-2.0
"""Layers in OpenEXR files: named channels, float32, scene-linear Rec.709, written whole or not at all."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from graycard._errors import DatasetError, GraycardError, OutputError, UnknownNameError
from graycard.io._exr_file import (
    ExrPart,
    named_by_part,
    planes_of,
    read_exr,
    read_exr_headers,
)
from graycard.io._files import atomic_path, free_mib
from graycard.io._primaries import REC709, are_rec709, name_primaries
from graycard.layers import Layer, all_layers, find_layer

_ALIKE = 0.6
"""Likeness from which an unknown name counts as misspelt: the default of difflib."""


_DENSE = (OpenEXR.ZIP_COMPRESSION, OpenEXR.HTJ2K256_COMPRESSION, OpenEXR.ZSTD_COMPRESSION)
"""Lossless kinds: the second is good at noise, the third at what layers far apart have in common."""


def write_layers(
    path: Path,
    arrays: Mapping[str, np.ndarray],
    metadata: Mapping[str, Any] | None = None,
    *,
    dense: bool = False,
) -> None:
    """Write layers into one EXR file, channels ``<layer>.<suffix>``.

    Args:
        path: The file.
        arrays: By layer name, each of shape ``(H, W)`` or ``(H, W, 3)``.
        metadata: JSON data, kept in the header attribute ``graycard``.
        dense: Compress by ZIP, HTJ2K or ZSTD, whichever gives the smallest file, instead of by ZIP. No bit
            is lost, and programs need OpenEXR 3.5 to read it.

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
    attributes = {"graycard": json.dumps(dict(metadata))} if metadata else {}
    _write(path, channels, attributes, _DENSE if dense else (OpenEXR.ZIP_COMPRESSION,))


def read_layers(path: Path, error: type[GraycardError] = DatasetError) -> dict[str, np.ndarray]:
    """Return all layers in an EXR file, each of shape ``(H, W)`` or ``(H, W, 3)``, float32 or uint32.

    Raises:
        DatasetError: (or ``error``) The file is missing or broken, or has channels of no layer.
    """
    pieces = _read(path, error)
    planes = planes_of(pieces)
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
    planes = planes_of(pieces)
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
    try:
        parts = read_exr_headers(path, DatasetError)
    except (DatasetError, OSError):
        return {}
    channels = [named_by_part(p.name, c.name, 2) for p in parts for c in p.header["channels"]]
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


def write_rgb(path: Path, values: np.ndarray, *, quick: bool = False) -> None:
    """Write one linear image of shape ``(H, W, 3)`` as plain ``R``, ``G``, ``B`` that any viewer opens.

    Args:
        path: The file.
        values: Light of Rec.709.
        quick: Compress by PIZ instead of ZIP, as exactly: in less than half the time where values are few,
            as in pictures of 8 bits, and in twice the time where pixels are averages of others.

    Raises:
        ValueError: The array has another shape.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    kind = OpenEXR.PIZ_COMPRESSION if quick else OpenEXR.ZIP_COMPRESSION
    _write(path, _planes(find_layer("radiance"), values), {}, (kind,))


def read_rgb(path: Path, error: type[GraycardError] = DatasetError) -> np.ndarray:
    """Return a linear image of shape ``(H, W, 3)``, float32, from plain ``R``, ``G``, ``B``.

    Raises:
        DatasetError: (or ``error``) The file is missing or broken, or has other channels.
    """
    parts = [part.planes() for part in read_exr(path, error)]
    coloured = [planes for planes in parts if {"R", "G", "B"} <= planes.keys()]
    if len(coloured) != 1:
        names = ", ".join(name for planes in parts for name in planes)
        raise error(f"expected channels R, G, B once in {path}, got {names}")
    return np.stack([coloured[0][c].astype(np.float32, copy=False) for c in "RGB"], axis=-1)


def read_planes(path: Path, error: type[GraycardError] = DatasetError) -> dict[str, np.ndarray]:
    """Return every channel of an EXR file by its name, each ``(H, W)``, in its own type.

    Raises:
        DatasetError: (or ``error``) The file is missing or broken.
    """
    return planes_of(_read(path, error))


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


def _write(
    path: Path, channels: dict[str, np.ndarray], attributes: dict[str, Any], kinds: Sequence[Any]
) -> None:
    """Write the file with that kind of compression which makes it smallest."""
    header = {"type": OpenEXR.scanlineimage, "chromaticities": REC709, **attributes}
    with atomic_path(path) as partial:
        sizes = {}
        try:
            for kind in kinds:
                _write_as(kind, partial, header, channels)
                sizes[kind] = partial.stat().st_size
            if (best := min(kinds, key=lambda kind: sizes[kind])) != kinds[-1]:
                _write_as(best, partial, header, channels)
        except RuntimeError as cause:
            raise OutputError(
                f"{path} was not written: {cause} ({free_mib(path):.1f} MiB free). Free some space or choose "
                "another output folder; the same command then goes on where it stopped"
            ) from cause


def _write_as(kind: Any, path: Path, header: Mapping[str, Any], channels: Mapping[str, np.ndarray]) -> None:
    OpenEXR.File({"compression": kind, **header}, dict(channels)).write(str(path))


def _read(path: Path, error: type[GraycardError]) -> dict[str, np.ndarray]:
    """Return colours in one piece, ``(H, W, 3 or 4)``, by name of the layer; other channels by their own.

    Channels without a name of their own have that of their part.
    """
    found: dict[str, np.ndarray] = {}
    for part in read_exr(path, error):
        pieces = {named_by_part(part.name, name, p.ndim): p for name, p in part.pieces.items()}
        if twice := sorted(planes_of(pieces).keys() & planes_of(found).keys()):
            raise error(f"expected each channel once in {path}, got {twice[0]} in two parts. Leave one out")
        _check_primaries(path, part, error)
        found |= pieces
    sizes = {pixels.shape[:2] for pixels in found.values()}
    if len(sizes) > 1:
        raise error(f"expected parts of one size in {path}, got {_sizes(sizes)}. Write a file for each")
    return found


def _check_primaries(path: Path, part: ExrPart, error: type[GraycardError]) -> None:
    given = part.header.get("chromaticities")
    coloured = any(pixels.ndim == 3 for pixels in part.pieces.values())
    if coloured and isinstance(given, Sequence) and not are_rec709(given):
        raise error(
            f"expected colours of linear Rec.709 in {path}, got {name_primaries(given)}. Convert them, and "
            "write the chromaticities of Rec.709 or none"
        )


def _sizes(shapes: Iterable[tuple[int, ...]]) -> str:
    return ", ".join(f"{width}x{height}" for height, width in sorted(shapes))


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
