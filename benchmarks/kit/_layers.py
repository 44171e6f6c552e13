# SPDX-License-Identifier: Apache-2.0
"""Faults of single arrays: type, shape, values, and the view that they are of."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from graycard import Camera, View, find_layer
from graycard.benchmarks.kit._faults import Fault
from graycard.layers import find_codes, find_fault, shape_of
from graycard.methods.confined import Fact

_UNIT = ("roughness", "metallic", "glossy", "f0")
_OVER = 0.01
_BRIGHT = 1.5
"""Median from which an albedo is none: a photograph of an albedo may be a little brighter than 1."""
_OF_FACTS = {
    "no-mapping": "layers", "layer-missing": "layers", "layer-besides": "layers", "tensor": "tensor",
    "no-array": "dtype", "no-numbers": "dtype",
}  # fmt: skip
_SAYS = {
    "no-mapping": "render gave {}, not a dictionary",
    "layer-missing": "{} was asked for and is missing",
    "layer-besides": "{} was not asked for",
}


def faults_of_facts(facts: Sequence[Fact]) -> Iterator[Fault]:
    """Yield faults of what ``render`` gave before it became arrays of numbers."""
    for fact in facts:
        if fact.kind in _OF_FACTS:
            yield Fault(_OF_FACTS[fact.kind], _SAYS.get(fact.kind, "{}").format(fact.what))


def faults_of_layers(layers: Mapping[str, np.ndarray], view: View) -> Iterator[Fault]:
    """Yield faults of the layers of one view."""
    for name, values in layers.items():
        if fault := _of_shape(name, values, view.camera) or _of_values(name, values, view.camera):
            yield Fault(fault.name, f"view {view.name}: {fault.found}")


def usable(layers: Mapping[str, np.ndarray], camera: Camera) -> dict[str, np.ndarray]:
    """Return the layers that can be written and compared, in the type that is stored."""
    kept = {}
    for name, values in layers.items():
        if _of_shape(name, values, camera) is None and find_codes(name, values) is None:
            with np.errstate(over="ignore", invalid="ignore"):
                kept[name] = values.astype(find_layer(name).dtype, copy=False)
    return kept


def _of_shape(name: str, values: np.ndarray, camera: Camera) -> Fault | None:
    shape = shape_of(name, camera.height, camera.width)
    if values.shape == shape:
        return None
    words = f"expected {name} of shape {shape}, got {values.shape}"
    if len(shape) == 3 and values.shape == (shape[2], *shape[:2]):
        return Fault("channels-first", words)
    return Fault("shape", words)


def _of_values(name: str, values: np.ndarray, camera: Camera) -> Fault | None:
    if words := find_codes(name, values):
        return Fault("dtype", words)
    with np.errstate(over="ignore", invalid="ignore"):
        written = values.astype(find_layer(name).dtype, copy=False)
    if words := find_fault(name, written, camera.height, camera.width):
        return Fault("not-finite", words)
    return _of_range(name, written)


def _of_range(name: str, values: np.ndarray) -> Fault | None:
    if name in _UNIT and (values.min() < -_OVER or values.max() > 1 + _OVER):
        return Fault("range", f"{name} is {values.min():.3g} to {values.max():.3g}")
    is_albedo = name in ("base_color", "diffuse_reflectance", "albedo")
    if is_albedo and (np.median(values) > _BRIGHT or values.min() < -_OVER):
        middle = float(np.median(values))
        return Fault(
            "range", f"{name} is {values.min():.3g} to {values.max():.3g}, in the middle {middle:.3g}"
        )
    return None


def differences(
    these: Mapping[str, np.ndarray], those: Mapping[str, np.ndarray], tolerance: float
) -> list[str]:
    """Return layers in which two renderings differ by more than a share of their range, and by how much."""
    found = []
    for name in sorted({*these} & {*those}):
        a, b = (np.where(np.isfinite(x[name]), x[name], 0).astype(np.float64) for x in (these, those))
        if a.shape != b.shape:
            found.append(f"{name} of other shapes")
            continue
        apart = float(np.abs(a - b).max())
        if apart > tolerance * max(float(np.abs(a).max()), 1e-6):
            found.append(f"{name} by up to {apart:.3g}")
    return found
