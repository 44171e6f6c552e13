# SPDX-License-Identifier: Apache-2.0
"""What a surfel is: a flat Gaussian disc with an opacity and any number of feature channels."""

from dataclasses import dataclass, fields

import torch

UNIT_TOLERANCE = 1e-3
"""How far a quaternion's length may be from one; what draws it divides by the length that is left."""

_TAILS = {"centres": (3,), "rotations": (4,), "scales": (2,), "opacities": (), "features": (None,)}


@dataclass(frozen=True, eq=False)
class Surfels:
    """N flat Gaussian discs, in physical units: an optimiser's log scales and logits are its own affair.

    All tensors share one floating dtype and one device, and may require gradients.

    Raises:
        ValueError: A shape, dtype, device or value is not as stated below.
    """

    centres: torch.Tensor
    """Shape ``(N, 3)``, world, metres."""
    rotations: torch.Tensor
    """Shape ``(N, 4)``: unit quaternions ``(w, x, y, z)``, disc to world; the disc's normal is its z axis."""
    scales: torch.Tensor
    """Shape ``(N, 2)``: standard deviation along the disc's x and y axes, metres, positive."""
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
            _check_values("scales", self.scales, self.scales > 0, "positive")
        least, most = self.opacities.detach().aminmax()
        if not bool(least >= 0) or not bool(most <= 1):
            good = (self.opacities >= 0) & (self.opacities <= 1)
            _check_values("opacities", self.opacities, good, "in [0, 1]")
        self._check_lengths()

    def __len__(self) -> int:
        return self.centres.shape[0]

    def _check_lengths(self) -> None:
        rotations = self.rotations.detach()
        shortest, longest = (rotations * rotations).sum(dim=1).sqrt().aminmax()
        if bool(shortest >= 1 - UNIT_TOLERANCE) and bool(longest <= 1 + UNIT_TOLERANCE):
            return
        lengths = rotations.norm(dim=1)
        _check_values("rotations", lengths, (lengths - 1).abs() <= UNIT_TOLERANCE, "of unit length")

    def _check_tensor(self, name: str, value: object) -> None:
        if not isinstance(value, torch.Tensor):
            raise ValueError(f"expected {name} to be a torch.Tensor, got {type(value).__name__}")
        tail = _TAILS[name]
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
        check_finite(name, value)


def check_finite(name: str, values: torch.Tensor) -> None:
    """Refuse numbers that are none.

    Raises:
        ValueError: The first surfel with one is named.
    """
    if not bool(values.detach().sum().isfinite()):  # nor is a sum with a term that is not, for sure
        _check_values(name, values, torch.isfinite(values), "finite")


def _check_values(name: str, values: torch.Tensor, good: torch.Tensor, rule: str) -> None:
    """Name the first surfel that breaks a rule."""
    if bool(good.all()):
        return
    row = int((~good).nonzero()[0, 0])
    raise ValueError(f"expected {name} to be {rule}, got {values[row].tolist()} at surfel {row}")
