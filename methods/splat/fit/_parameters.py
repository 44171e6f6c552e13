# SPDX-License-Identifier: Apache-2.0
"""Parameters: unbounded numbers behind surfels, and any others beside them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import torch

from graycard import Camera
from graycard.methods.splat._surfels import Surfels

CENTRES, LOG_SCALES, ROTATIONS, LOGITS = "centres", "log_scales", "rotations", "opacity_logits"
GEOMETRY = (CENTRES, LOG_SCALES, ROTATIONS, LOGITS)
"""The parameters that every set of surfels has; a method adds its own beside them."""
_NEARLY = 1e-6
"""Bound of opacity 0 and 1, whose logits are infinite."""


@dataclass(frozen=True, eq=False)
class Parameters:
    """All numbers that a fit may change.

    Raises:
        ValueError: Geometry is missing, the numbers of surfels differ, or a name is used twice.
    """

    surfels: Mapping[str, torch.Tensor]
    """By name, each with one row a surfel: ``centres`` (N, 3) in metres, ``log_scales`` (N, 2), logarithms
    of metres, ``rotations`` (N, 4), quaternions of any length, ``opacity_logits`` (N,), and any others, such
    as an albedo (N, 3): they follow when surfels are cloned, split and pruned."""
    shared: Mapping[str, torch.Tensor] = field(default_factory=dict)
    """By name: what is no surfel's, such as the weights of a network."""

    def __post_init__(self) -> None:
        missing = [name for name in GEOMETRY if name not in self.surfels]
        if missing:
            raise ValueError(f"expected surfels with {', '.join(GEOMETRY)}, got none of {', '.join(missing)}")
        rows = {name: len(values) for name, values in self.surfels.items()}
        if len(set(rows.values())) > 1:
            raise ValueError(f"expected one row a surfel in every parameter, got {rows}")
        twice = sorted(set(self.surfels) & set(self.shared))
        if twice:
            raise ValueError(f"expected each name once, got {', '.join(twice)} for surfels and shared")

    def __len__(self) -> int:
        """Return the number of surfels."""
        return len(self.surfels[CENTRES])

    @property
    def all(self) -> dict[str, torch.Tensor]:
        """Surfels' and shared ones by name."""
        return {**self.surfels, **self.shared}

    def take(self, index: torch.Tensor) -> "Parameters":
        """Only some surfels, by index or mask, copied; what is shared is the same."""
        return replace(self, surfels={name: values[index] for name, values in self.surfels.items()})


def parameters_of(
    surfels: Surfels,
    others: Mapping[str, torch.Tensor] | None = None,
    shared: Mapping[str, torch.Tensor] | None = None,
) -> Parameters:
    """Return the parameters behind surfels; their features are left out.

    Args:
        surfels: N of them.
        others: Further parameters of surfels by name, each with N rows.
        shared: Parameters that are no surfel's.

    Raises:
        ValueError: A number of rows is not N, or a name is used twice.
    """
    geometry = {
        CENTRES: surfels.centres.detach().clone(),
        LOG_SCALES: surfels.scales.detach().log(),
        ROTATIONS: surfels.rotations.detach().clone(),
        LOGITS: torch.logit(surfels.opacities.detach(), eps=_NEARLY),
    }
    return Parameters({**geometry, **(others or {})}, dict(shared or {}))


def surfels_of(surfels: Mapping[str, torch.Tensor], features: torch.Tensor | None = None) -> Surfels:
    """Surfels from parameters, differentiable in all of them.

    Args:
        surfels: By name, as in :class:`Parameters`.
        features: shape ``(N, C)``; none by default.

    Raises:
        ValueError: A value has left the range of its type, or is not finite.
    """
    centres = surfels[CENTRES]
    return Surfels(
        centres,
        torch.nn.functional.normalize(surfels[ROTATIONS], dim=1),
        surfels[LOG_SCALES].exp(),
        surfels[LOGITS].sigmoid(),
        centres.new_zeros(len(centres), 0) if features is None else features,
    )


def arrays_of(parameters: Parameters) -> dict[str, np.ndarray]:
    """All arrays by a name that says whose they are, for a file; :func:`parameters_from` reads them."""
    parts = {"surfels": parameters.surfels, "shared": parameters.shared}
    return {f"{part}/{name}": v.numpy() for part, values in parts.items() for name, v in values.items()}


def parameters_from(arrays: Mapping[str, np.ndarray]) -> Parameters:
    """Return the parameters of :func:`arrays_of`; copies.

    Raises:
        ValueError: A part of the geometry is missing, or the numbers of surfels differ.
    """
    parts: dict[str, dict[str, torch.Tensor]] = {"surfels": {}, "shared": {}}
    for key, values in arrays.items():
        part, _, name = key.partition("/")
        parts[part][name] = torch.from_numpy(values.copy())
    return Parameters(**parts)


def scene_extent(cameras: list[Camera]) -> float:
    """Return the yardstick of learning rates and sizes, metres: 1.1 times the largest distance of a camera
    from the mean of the cameras (Kerbl et al. 2023, their code's ``cameras_extent``).

    Raises:
        ValueError: There is no camera.
    """
    if not cameras:
        raise ValueError("expected at least one camera, got none")
    positions = np.array([camera.position for camera in cameras])
    return 1.1 * float(np.linalg.norm(positions - positions.mean(axis=0), axis=1).max())
