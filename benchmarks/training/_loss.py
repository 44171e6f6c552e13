# SPDX-License-Identifier: Apache-2.0
"""Loss between a network's maps and the true ones."""

from collections.abc import Mapping

import torch
from torch.nn.functional import binary_cross_entropy_with_logits

from graycard.benchmarks.training._batches import Batch
from graycard.methods.surfels import srgb_encode_tensor

WEIGHTS = {
    "normal": 1.0,
    "depth.shape": 1.0,
    "depth.scale": 0.2,
    "depth.slope": 2.0,
    "base_color": 1.0,
    "roughness": 0.5,
    "metallic": 0.3,
    "seen": 0.2,
}
"""Weights of the parts of the loss."""
STEEP = 0.1
"""Log of depths of neighbours from which on they are on two surfaces: their slope is none."""


def loss_of(told: Mapping[str, torch.Tensor], batch: Batch) -> dict[str, torch.Tensor]:
    """Return the parts of the loss, without weights; each is a mean over pixels with a surface.

    Normals: length of the difference. Depth: absolute difference of logs about their mean, the mean's own,
    and that of slopes. Base colour: of values encoded for display. ``seen``: cross entropy.
    """
    seen = torch.isfinite(batch["depth"])
    some = seen.float()
    count = some.sum().clamp_min(1)
    true = torch.log(torch.where(seen, batch["depth"], 1.0).clamp_min(1e-3))
    off = torch.where(seen, told["depth"] - true, 0.0)
    mean = off.sum(dim=(1, 2, 3), keepdim=True) / some.sum(dim=(1, 2, 3), keepdim=True).clamp_min(1)
    chord = (told["normal"] - batch["normal"]).square().sum(dim=1, keepdim=True)
    paint = srgb_encode_tensor(batch["base_color"].clamp(0, 1))
    return {
        "normal": (torch.sqrt(chord + 1e-6) * some).sum() / count,
        "depth.shape": ((off - mean).abs() * some).sum() / count,
        "depth.scale": mean.abs().mean(),
        "depth.slope": sum((_slope(told["depth"], true, seen, axis) for axis in (2, 3)), torch.zeros(())),
        "base_color": ((told["base_color"] - paint).abs() * some).sum() / (3 * count),
        "roughness": ((told["roughness"] - batch["roughness"]).abs() * some).sum() / count,
        "metallic": ((told["metallic"] - batch["metallic"]).abs() * some).sum() / count,
        "seen": binary_cross_entropy_with_logits(told["seen"], some),
    }


def weighted(parts: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Return the loss of its parts, a scalar."""
    return sum((WEIGHTS[name] * part for name, part in parts.items()), torch.zeros(()))


def _slope(told: torch.Tensor, true: torch.Tensor, seen: torch.Tensor, axis: int) -> torch.Tensor:
    """Mean absolute difference of the steps between neighbours on one surface."""
    size = true.shape[axis] - 1
    here, there = (lambda x: x.narrow(axis, 0, size)), (lambda x: x.narrow(axis, 1, size))
    step = there(true) - here(true)
    both = (here(seen) & there(seen) & (step.abs() < STEEP)).float()
    off = (there(told) - here(told) - step).abs()
    return (off * both).sum() / both.sum().clamp_min(1)
