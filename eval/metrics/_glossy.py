# SPDX-License-Identifier: Apache-2.0
"""Which surfaces a method takes for glossy: the overlap of what it marks with what is."""

from dataclasses import dataclass

import numpy as np

from graycard.eval.metrics._view_metrics import Answer, ViewMetric
from graycard.eval.scoring._readings import TrueView
from graycard.layers import GLOSSY_ROUGHNESS
from graycard.records import MetricRecord

LAYER = "glossy"
LEAST = 0.5
"""A prediction above marks a pixel as glossy."""


@dataclass(frozen=True, slots=True)
class Region:
    """What is asked in one view."""

    mask: np.ndarray
    """The judged pixels, shape ``(H, W)``, bool."""
    glossy: np.ndarray
    """Those that are glossy, shape ``(H, W)``, bool; at least one."""
    pure: np.ndarray | None
    """Pixels of one surface and colour, shape ``(H, W)``, bool; None where the truth does not say."""


def overlap(predicted: np.ndarray, true: np.ndarray) -> float:
    """Intersection over union of two regions.

    Args:
        predicted: Any shape, bool.
        true: Same shape, bool.

    Raises:
        ValueError: Both are empty.

    Example:
        >>> import numpy as np
        >>> overlap(np.array([True, True, True, False]), np.array([False, True, True, True]))
        0.5
    """
    union = int(np.count_nonzero(predicted | true))
    if not union:
        raise ValueError("expected a region with pixels in it, got two empty ones")
    return int(np.count_nonzero(predicted & true)) / union


def _asked(true: TrueView, exposure: float) -> Region | None:
    mask = true.mask(LAYER)
    glossy = mask & (true.take(LAYER) > LEAST)
    return Region(mask, glossy, true.pure()) if glossy.any() else None


def _answer(predicted: np.ndarray, asked: Region) -> Answer:
    marked = (predicted > LEAST) & asked.mask
    return Answer(overlap(marked, asked.glossy), _parts(marked, asked))


def _parts(marked: np.ndarray, asked: Region) -> dict[str, float]:
    """How much of the truth is found, how much of what is marked is true, overlaps in parts of it."""
    both = marked & asked.glossy
    parts = {"recall": both.sum() / asked.glossy.sum()}
    if marked.any():
        parts["precision"] = both.sum() / marked.sum()
    if asked.pure is not None:
        for name, where in (("interior", asked.pure), ("boundary", ~asked.pure)):
            if ((marked | asked.glossy) & where).any():
                parts[name] = overlap(marked & where, asked.glossy & where)
    return {name: float(value) for name, value in parts.items()}


GLOSSY_METRICS: tuple[ViewMetric, ...] = (
    ViewMetric(
        MetricRecord(
            "glossy.iou", "Glossy surfaces, overlap", "glossy", "1", True, 1.0,
            f"pixels with glossy > {LEAST:g} in both over those with it in either, over the mask without "
            f"lights, mean over views; the truth is 1 where f0 > 0 and roughness < {GLOSSY_ROUGHNESS:g}; "
            "views in which nothing is glossy are not asked", headline=False, tolerance=0.02,
        ),
        LAYER,
        (LAYER,),
        _asked,
        _answer,
    ),
)  # fmt: skip
