# SPDX-License-Identifier: Apache-2.0
"""Errors of networks in materials: roughness is off by a bit, metals are taken for paint."""

from dataclasses import dataclass

import numpy as np

from graycard.methods.priors._draws import draws_of, smooth_field


@dataclass(frozen=True, slots=True)
class RoughnessErrors:
    """Errors of roughness."""

    bias: float = 0.0
    """Standard deviation of a view's offset."""
    waves: float = 0.0
    """Standard deviation of a smooth random field."""


ROUGHNESS_LEVELS = (
    RoughnessErrors(),
    RoughnessErrors(0.02, 0.02),
    RoughnessErrors(0.05, 0.05),
    RoughnessErrors(0.08, 0.08),
    RoughnessErrors(0.12, 0.12),
    RoughnessErrors(0.20, 0.20),
)
"""By severity."""


@dataclass(frozen=True, slots=True)
class MetallicErrors:
    """Errors of the metallic share."""

    flips: float = 0.0
    """Probability that an object of a view is taken for the other."""


METALLIC_LEVELS = tuple(MetallicErrors(p) for p in (0.0, 0.02, 0.05, 0.1, 0.2, 0.4))
"""By severity."""


def corrupt_roughness(roughness: np.ndarray, errors: RoughnessErrors, seed: int, view: str) -> np.ndarray:
    """Return what a network would say about roughness, shape ``(H, W)``, [0, 1], float64.

    Args:
        roughness: shape ``(H, W)``, [0, 1].
        errors: How wrong.
        seed: Of the draws.
        view: Name of the view.
    """
    draws = draws_of(seed, "roughness", view)
    bias, waves = draws.standard_normal(), smooth_field(draws, roughness.shape)[..., 0]
    return np.clip(roughness.astype(np.float64) + errors.bias * bias + errors.waves * waves, 0, 1)


def corrupt_metallic(
    metallic: np.ndarray, object_id: np.ndarray, errors: MetallicErrors, seed: int, view: str
) -> np.ndarray:
    """Return what a network would say about the metallic share, shape ``(H, W)``, [0, 1], float64.

    Args:
        metallic: shape ``(H, W)``, [0, 1].
        object_id: shape ``(H, W)``: objects are taken for metal, or not, as a whole.
        errors: How wrong.
        seed: Of the draws.
        view: Name of the view.
    """
    wrong = metallic.astype(np.float64)
    for number in np.unique(object_id[object_id > 0]):
        here = object_id == number
        if draws_of(seed, f"metallic/{number}", view).random() < errors.flips:
            wrong[here] = 1 - wrong[here]
    return wrong
