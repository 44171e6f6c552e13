# SPDX-License-Identifier: Apache-2.0
"""Glossy surfaces: the overlap of the pixels that a method marks with those that are glossy."""

from dataclasses import dataclass

import numpy as np

from graycard.eval.kinds._metric import Metric
from graycard.eval.kinds._records import share
from graycard.eval.kinds._references import Reference
from graycard.eval.kinds._views import ViewRule
from graycard.eval.scoring._ceiling import NO_LIGHT_PATH
from graycard.eval.scoring._comparison import REGIONS
from graycard.eval.scoring._findings import Measurement
from graycard.eval.scoring._readings import TrueView
from graycard.layers import GLOSSY_ROUGHNESS

LAYER = "glossy"
LEAST = 0.5
"""A prediction above marks a pixel as glossy."""


@dataclass(frozen=True, slots=True)
class Region:
    """The part of a view that is judged."""

    mask: np.ndarray
    """The judged pixels, shape ``(H, W)``, bool."""
    glossy: np.ndarray
    """Those that are glossy, shape ``(H, W)``, bool; at least one."""
    pure: np.ndarray | None
    """Pixels of one surface and colour, shape ``(H, W)``, bool; None where the truth does not say."""


def overlap(predicted: np.ndarray, true: np.ndarray) -> float:
    """Return the intersection over union of two regions.

    Args:
        predicted: Any shape, bool.
        true: Same shape, bool.

    Raises:
        ValueError: Both are empty.

    Examples:
        >>> import numpy as np
        >>> overlap(np.array([True, True, True, False]), np.array([False, True, True, True]))
        0.5
    """
    union = int(np.count_nonzero(predicted | true))
    if not union:
        raise ValueError("expected a region with pixels in it, got two empty ones")
    return int(np.count_nonzero(predicted & true)) / union


def _prepare(true: TrueView, exposure: float) -> Region | None:
    mask = true.mask(LAYER)
    glossy = mask & (true.take(LAYER) > LEAST)
    return Region(mask, glossy, true.pure()) if glossy.any() else None


def _compute(predicted: np.ndarray, region: Region) -> Measurement:
    marked = (predicted > LEAST) & region.mask
    return Measurement(overlap(marked, region.glossy), _parts(marked, region))


def _parts(marked: np.ndarray, region: Region) -> dict[str, float]:
    """Return the share of the truth that is found, of the marked that is true, and overlaps in regions."""
    both = marked & region.glossy
    parts = {"recall": both.sum() / region.glossy.sum()}
    if marked.any():
        parts["precision"] = both.sum() / marked.sum()
    if region.pure is not None:
        for name, where in zip(REGIONS, (region.pure, ~region.pure), strict=True):
            if ((marked | region.glossy) & where).any():
                parts[name] = overlap(marked & where, region.glossy & where)
    return {name: float(value) for name, value in parts.items()}


METRICS: tuple[Metric[ViewRule], ...] = (
    Metric(
        record=share(
            "glossy",
            "iou",
            "Glossy surfaces, overlap",
            f"pixels with glossy > {LEAST:g} in both over those with it in either, over the mask without "
            f"lights, mean over views; the truth is 1 where f0 > 0 and roughness < {GLOSSY_ROUGHNESS:g}; "
            "views in which nothing is glossy are not asked",
            tolerance=0.02,
        ),
        rule=ViewRule((LAYER,), _prepare, _compute),
        layers=(LAYER,),
        ceiling=NO_LIGHT_PATH,
        references=(Reference("overlap of glossy regions", "scipy.spatial.distance, Jaccard", 1e-9),),
        breakdown=("recall", "precision", *REGIONS),
    ),
)
