# SPDX-License-Identifier: Apache-2.0
"""Rays, and what they bring back."""

from dataclasses import dataclass

import torch

from graycard import Camera

UNIT_TOLERANCE = 1e-3
"""Tolerance: how far a direction's length may be from one; distances count in lengths of the direction."""


@dataclass(frozen=True, eq=False)
class Rays:
    """R rays, each from an origin along a unit direction. They may require gradients.

    Raises:
        ValueError: A shape, dtype or value is not as stated below.
    """

    origins: torch.Tensor
    """Shape ``(R, 3)``, world, metres."""
    directions: torch.Tensor
    """Shape ``(R, 3)``, world, of unit length."""
    width: int | None = None
    """Width of an image, where the rays are an image, row by row: pixels in a row. Neighbours are then
    traced together, which is faster; what comes back is the same."""
    far: torch.Tensor | None = None
    """Distances where the rays end: shape ``(R,)``, in the dtype of the origins, metres, zero or more, may
    be infinite. What they meet farther away does not count; no gradient passes. None: they go on for ever."""

    def __post_init__(self) -> None:
        for name, value in (("origins", self.origins), ("directions", self.directions)):
            if not isinstance(value, torch.Tensor):
                raise ValueError(f"expected {name} to be a torch.Tensor, got {type(value).__name__}")
            wanted = (self.origins.dtype, (len(self.origins), 3))
            if (value.dtype, tuple(value.shape)) != wanted or not value.is_floating_point():
                raise ValueError(
                    f"expected {name} of shape ({len(self.origins)}, 3) in one floating dtype, "
                    f"got {tuple(value.shape)} in {value.dtype}"
                )
            _check_rays(name, value, torch.isfinite(value).all(dim=1), "finite")
        lengths = self.directions.detach().norm(dim=1)
        _check_rays("directions", self.directions, (lengths - 1).abs() <= UNIT_TOLERANCE, "of unit length")
        if self.far is not None:
            self._check_far(self.far)
        if self.width is not None and (self.width < 1 or len(self) % self.width):
            raise ValueError(f"expected a width that divides the {len(self)} rays, got {self.width}")

    def __len__(self) -> int:
        return self.origins.shape[0]

    def _check_far(self, far: torch.Tensor) -> None:
        wanted = (self.origins.dtype, (len(self),))
        if not isinstance(far, torch.Tensor):
            raise ValueError(f"expected far to be a torch.Tensor, got {type(far).__name__}")
        if (far.dtype, tuple(far.shape)) != wanted:
            raise ValueError(
                f"expected far of shape ({len(self)},) in {wanted[0]}, got {tuple(far.shape)} in {far.dtype}"
            )
        _check_rays("far", far, far >= 0, "zero metres or more")


@dataclass(frozen=True)
class Traced:
    """Hits of R rays, nearest first, in the dtype of the surfels; w is the share that a surfel adds."""

    features: torch.Tensor
    """Sum of w times features, shape ``(R, C)``; no background is added."""
    transmittance: torch.Tensor
    """Transmittance, shape ``(R,)``, in (0, 1]: visibility along the ray."""
    depth: torch.Tensor
    """Distance from the origin, sum of w t over sum of w, shape ``(R,)``, metres; 0 where nothing is met."""


def camera_rays(camera: Camera, dtype: torch.dtype = torch.float32) -> Rays:
    """Return the rays through the centres of a camera's pixels, row by row.

    Args:
        camera: The pinhole camera.
        dtype: float32 or float64.

    Returns:
        ``height * width`` rays with their width.
    """
    y, x = torch.meshgrid(torch.arange(camera.height), torch.arange(camera.width), indexing="ij")
    pixels = torch.stack([x + 0.5, y + 0.5, torch.ones(x.shape)], dim=-1).reshape(-1, 3).double()
    pose = torch.tensor(camera.camera_to_world, dtype=torch.float64)
    directions = pixels @ torch.linalg.inv(torch.tensor(camera.K, dtype=torch.float64)).T @ pose[:3, :3].T
    directions = torch.nn.functional.normalize(directions, dim=1)
    return Rays(pose[:3, 3].expand_as(directions).to(dtype), directions.to(dtype), camera.width)


def _check_rays(name: str, values: torch.Tensor, good: torch.Tensor, rule: str) -> None:
    """Name the first ray that breaks a rule."""
    if bool(good.all()):
        return
    row = int((~good).nonzero()[0, 0])
    raise ValueError(f"expected {name} to be {rule}, got {values[row].tolist()} at ray {row}")
