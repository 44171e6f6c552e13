# SPDX-License-Identifier: Apache-2.0
"""The means that a verdict stands on, and rows that were not fitted to the end."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from graycard import RecordError
from graycard.benchmarks.claims._claim import Claim, Nested, Paper, Quantity, Scenes
from graycard.benchmarks.claims._readings import Readings
from graycard.eval.statistics import locate
from graycard.records import Budget, RowFit, SceneRecord

TRAINING: Final = Quantity("training_view.psnr")
HELD_OUT: Final = Quantity("novel_view.psnr")
WORSE_BY: Final = 0.1
"""Decibels by which a model may explain its photographs worse than one that it contains: rounding of a fit."""


def not_converged(paper: Paper, readings: Readings) -> dict[str, str]:
    """Rows that explain their own photographs worse than a model that theirs contains, with what was seen."""
    found: dict[str, str] = {}
    for pair in paper.nested:
        leads = _leads(pair, paper.track, readings)
        if not len(leads):
            continue
        estimate = locate(leads).estimate
        if estimate < -WORSE_BY:
            found.setdefault(pair.outer, (
                f"{pair.outer} has not converged: it contains {pair.inner} and explains its own photographs "
                f"{-estimate:.2g} dB worse, on {int((leads < 0).sum())} of {len(leads)} scenes"
            ))  # fmt: skip
    return found


def suspension(claim: Claim, flagged: Mapping[str, str]) -> str:
    """Why the verdict of a claim is held back; empty if it is not."""
    rows = [row for check in claim.checks if check.decides for row in (*check.rows, *check.minus)]
    return "; ".join(dict.fromkeys(flagged[row] for row in rows if row in flagged))


def budget_of(claim: Claim, paper: Paper, readings: Readings, here: Mapping[str, str]) -> Budget:
    """The means of a claim's fitted rows beside those of the paper."""
    rows = dict.fromkeys(row for check in claim.checks for row in (*check.rows, *check.minus))
    scenes = _scenes(claim, paper.track, readings)
    fits = tuple(_fit(row, scenes, readings) for row in rows if "iterations" in readings.settings(row))
    return Budget(paper.budget, here if fits else {}, fits)


def means_of_suite(suite: Mapping[str, Any]) -> dict[str, str]:
    """Pixels and views of a run, from the suite that its folder keeps; empty where it keeps none."""
    render = suite.get("render", {})
    if not {"width", "height", "train_views", "test_views"} <= render.keys():
        return {}
    return {
        "pixels": f"{render['width']} x {render['height']}",
        "views": f"{render['train_views']} training, {render['test_views']} held out",
    }


def _leads(pair: Nested, track: str, readings: Readings) -> np.ndarray:
    """PSNR of training views of the outer row less that of the inner, by scene."""
    if readings.missing_rows([pair.inner, pair.outer]):
        return np.empty(0)
    found = [
        [readings.value(row, scene, TRAINING).value for row in (pair.outer, pair.inner)]
        for scene in readings.scenes(track, Scenes())
    ]
    return np.array([outer - inner for outer, inner in found if outer is not None and inner is not None])


def _scenes(claim: Claim, track: str, readings: Readings) -> list[SceneRecord]:
    """The scenes that any check of a claim is about."""
    found: dict[str, SceneRecord] = {}
    for check in claim.checks:
        try:
            found |= {scene.scene: scene for scene in readings.scenes(track, check.scenes)}
        except RecordError:  # the run does not tell the knobs; the check says so
            continue
    return list(found.values())


def _fit(row: str, scenes: Sequence[SceneRecord], readings: Readings) -> RowFit:
    steps = readings.settings(row).get("iterations")
    training, held_out = (_mean(row, scenes, readings, quantity) for quantity in (TRAINING, HELD_OUT))
    return RowFit(row, steps if isinstance(steps, int) else None, training, held_out)


def _mean(row: str, scenes: Sequence[SceneRecord], readings: Readings, quantity: Quantity) -> float | None:
    """The mean of a row over scenes; None where one lacks it."""
    values = [readings.value(row, scene, quantity).value for scene in scenes]
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known and len(known) == len(values) else None
