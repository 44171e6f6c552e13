# SPDX-License-Identifier: Apache-2.0
"""Choose the device of a fit: tensors lie on that of its back end, and a tensor's device decides."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, Literal, TypeVar

import torch

FitBackend = Literal["cpu", "cuda"]
"""The back ends that fit: the engine in Numba, and PyTorch with gsplat's kernels on a GPU."""
CPU = torch.device("cpu")
DEVICES = ("cpu", "cuda")
"""Types of devices on which operations are defined."""
ValueT = TypeVar("ValueT")


def device_of(backend: FitBackend) -> torch.device:
    """Return the device on which a back end fits.

    Raises:
        MethodError: There is no gsplat, or no GPU that it can use (``cuda``).
    """
    if backend == "cpu":
        return CPU
    from graycard.methods.splat.cuda._rasterize import gsplat_kernels

    gsplat_kernels()
    return torch.device("cuda")


def is_on_cpu(values: torch.Tensor) -> bool:
    """Tell whether a tensor lies where kernels in Numba can read it."""
    return values.device.type == "cpu"


def on_device(value: ValueT, device: torch.device) -> ValueT:
    """Return a value with all its tensors on a device; what has none is the same object.

    Args:
        value: A tensor, a dataclass, a list, a tuple or a mapping, and what they hold; anything else stays.
        device: Where to.
    """
    moved: Any = value
    if isinstance(value, torch.Tensor):
        moved = value.to(device)
    elif is_dataclass(value) and not isinstance(value, type):
        held = {field.name: getattr(value, field.name) for field in fields(value) if field.init}
        parts = {name: on_device(part, device) for name, part in held.items()}
        moved = replace(value, **parts) if any(parts[name] is not held[name] for name in held) else value
    elif isinstance(value, Mapping):
        moved = _as_before(value, {key: on_device(part, device) for key, part in value.items()})
    elif isinstance(value, list | tuple):
        moved = _sequence(value, device)
    return moved


def _as_before(value: Mapping[Any, Any], parts: dict[Any, Any]) -> Mapping[Any, Any]:
    return value if all(parts[key] is value[key] for key in value) else parts


def _sequence(value: Any, device: torch.device) -> Any:
    """Return a list or a tuple, with names where it has some."""
    parts = [on_device(part, device) for part in value]
    if all(part is before for part, before in zip(parts, value, strict=True)):
        return value
    return type(value)(*parts) if hasattr(value, "_fields") else type(value)(parts)
