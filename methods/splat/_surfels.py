# SPDX-License-Identifier: Apache-2.0
"""Surfel: a flat Gaussian disc with an opacity and any number of feature channels."""

from dataclasses import dataclass, fields
from typing import ClassVar

import torch

UNIT_TOLERANCE = 1e-3
"""Tolerance: how far a quaternion's length may be from one; what draws it divides by the length that is
left."""


@dataclass(frozen=True, eq=False)
class Primitives:
    """N Gaussians with an opacity and feature channels: what discs and ellipsoids share.

    All tensors share one floating dtype and one device, and may require gradients.
    """

    NAME: ClassVar[str]
    """Name of one of them, in messages."""
    AXES: ClassVar[int]
    """Number of axes along which each has a size."""

    centres: torch.Tensor
    """Shape ``(N, 3)``, world, metres."""
    rotations: torch.Tensor
    """Shape ``(N, 4)``: unit quaternions ``(w, x, y, z)``, its own axes to the world's."""
    scales: torch.Tensor
    """Shape ``(N, AXES)``: standard deviation along its axes, metres, positive."""
    opacities: torch.Tensor
    """Shape ``(N,)``: alpha at the centre, in [0, 1]."""
    features: torch.Tensor
    """Shape ``(N, C)``: any channels, any unit; C may be zero."""

    def __post_init__(self) -> None:
        for field in fields(self):
            self._check_tensor(field.name, getattr(self, field.name))
        if len(self) == 0:
            return
        if not bool(self.scales.detach().amin() > 0):
            _check_values("scales", self.scales, self.scales > 0, "positive", self.NAME)
        least, most = self.opacities.detach().aminmax()
        if not bool(least >= 0) or not bool(most <= 1):
            good = (self.opacities >= 0) & (self.opacities <= 1)
            _check_values("opacities", self.opacities, good, "in [0, 1]", self.NAME)
        self._check_lengths()

    def __len__(self) -> int:
        return self.centres.shape[0]

    def _check_lengths(self) -> None:
        rotations = self.rotations.detach()
        shortest, longest = (rotations * rotations).sum(dim=1).sqrt().aminmax()
        if bool(shortest >= 1 - UNIT_TOLERANCE) and bool(longest <= 1 + UNIT_TOLERANCE):
            return
        lengths = rotations.norm(dim=1)
        _check_values(
            "rotations", lengths, (lengths - 1).abs() <= UNIT_TOLERANCE, "of unit length", self.NAME
        )

    def _tail(self, name: str) -> tuple[int | None, ...]:
        """Return the shape of one of them in a tensor; None is any number."""
        tails = {
            "centres": (3,),
            "rotations": (4,),
            "scales": (self.AXES,),
            "opacities": (),
            "features": (None,),
        }
        return tails[name]

    def _check_tensor(self, name: str, value: object) -> None:
        if not isinstance(value, torch.Tensor):
            raise ValueError(f"expected {name} to be a torch.Tensor, got {type(value).__name__}")
        tail = self._tail(name)
        shape = tuple(value.shape)
        count = len(self.centres)
        fits = len(shape) == 1 + len(tail) and shape[0] == count
        if not fits or any(want not in (None, got) for want, got in zip(tail, shape[1:], strict=True)):
            wanted = ", ".join([str(count), *("C" if want is None else str(want) for want in tail)])
            raise ValueError(f"expected {name} of shape ({wanted}), got {shape}")
        if value.dtype not in (torch.float32, torch.float64):
            raise ValueError(f"expected {name} in float32 or float64, got {value.dtype}")
        if (value.dtype, value.device) != (self.centres.dtype, self.centres.device):
            raise ValueError(
                f"expected {name} as the centres are ({self.centres.dtype} on {self.centres.device}), "
                f"got {value.dtype} on {value.device}"
            )
        check_finite(name, value, self.NAME)


@dataclass(frozen=True, eq=False)
class Surfels(Primitives):
    """N flat Gaussian discs, in physical units: an optimiser's log scales and logits are its own affair.

    A disc's normal is its z axis; ``scales`` has shape ``(N, 2)``, along its x and y axes. All tensors share
    one floating dtype and one device, and may require gradients.

    Raises:
        ValueError: A shape, dtype, device or value is not as stated in :class:`Primitives`.
    """

    NAME: ClassVar[str] = "surfel"
    AXES: ClassVar[int] = 2


def check_finite(name: str, values: torch.Tensor, noun: str = "surfel") -> None:
    """Refuse numbers that are none.

    Raises:
        ValueError: The first surfel with one is named.
    """
    if not bool(values.detach().sum().isfinite()):  # nor is a sum with a term that is not, for sure
        _check_values(name, values, torch.isfinite(values), "finite", noun)


def _check_values(name: str, values: torch.Tensor, good: torch.Tensor, rule: str, noun: str) -> None:
    """Name the first surfel that breaks a rule."""
    if bool(good.all()):
        return
    row = int((~good).nonzero()[0, 0])
    raise ValueError(f"expected {name} to be {rule}, got {values[row].tolist()} at {noun} {row}")
