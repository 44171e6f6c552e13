# SPDX-License-Identifier: Apache-2.0
"""The means that a verdict stands on, and rows that were not fitted to the end."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from graycard import RecordError
from graycard.benchmarks.claims._claim import Check, Claim, Nested, Paper, Quantity
from graycard.benchmarks.claims._readings import Readings
from graycard.eval.statistics import locate
from graycard.records import Budget, RowFit, SceneRecord

TRAINING: Final = Quantity("training_view.psnr")
HELD_OUT: Final = Quantity("novel_view.psnr")
WORSE_BY: Final = 0.1
"""Decibels by which a model may explain its photographs worse than one that it contains: rounding of a
fit."""


def suspension(claim: Claim, paper: Paper, readings: Readings) -> str:
    """Say why the verdict of a claim is held back: a row of it was not fitted to the end; empty if all were.

    A model that contains another can explain photographs no worse than that. Where it does, on the scenes of
    the claim and by more than :data:`WORSE_BY` in the centre, the fit has stopped short. No test asks if this
    is certain: the burden is on the fit.
    """
    deciding = [check for check in claim.checks if check.decides]
    rows = {row for check in deciding for row in (*check.rows, *check.minus)}
    scenes = _scenes(deciding, paper.track, readings)
    found = (_shortfall(pair, scenes, readings) for pair in paper.nested if pair.outer in rows)
    return "; ".join(dict.fromkeys(filter(None, found)))


def budget_of(claim: Claim, paper: Paper, readings: Readings, here: Mapping[str, str]) -> Budget:
    """Return the means of a claim's fitted rows beside those of the paper; nothing where no row is fitted."""
    rows = dict.fromkeys(row for check in claim.checks for row in (*check.rows, *check.minus))
    scenes = _scenes(claim.checks, paper.track, readings)
    fits = tuple(_fit(row, scenes, readings) for row in rows if "iterations" in readings.settings(row))
    if not fits:
        return Budget()
    return Budget(paper.budget, {**here, **_means_of_fits([fit.row for fit in fits], readings)}, fits)


def _means_of_fits(rows: Sequence[str], readings: Readings) -> dict[str, str]:
    """Return primitives and priors of fitted rows, in words."""
    counts = sorted({n for row in rows if isinstance(n := readings.settings(row).get("surfels"), int)})
    found = (
        {"primitives": " to ".join(f"{n:,}" for n in dict.fromkeys((counts[0], counts[-1]))) + " surfels"}
        if counts
        else {}
    )
    told: dict[str, list[str]] = {}
    for row in rows:
        if prior := _prior_words(readings.priors(row)):
            told.setdefault(prior, []).append(row)
    words = "; ".join(f"{prior} ({', '.join(names)})" for prior, names in told.items())
    return found | {"priors": words or "none"}


def _prior_words(priors: Mapping[str, Any]) -> str:
    """Say where the answers of priors come from; empty for a method that asks for none."""
    source, severity = priors.get("source", ""), priors.get("severity", 0)
    if source != "oracle":
        return str(source)
    return f"the truth made wrong, severity {severity}" if severity else "the truth"


def _shortfall(pair: Nested, scenes: Sequence[SceneRecord], readings: Readings) -> str:
    """Say how much worse a row explains its photographs than one that it contains; empty if no worse."""
    leads = _leads(pair, scenes, readings)
    estimate = locate(leads).estimate if len(leads) else 0.0
    if estimate >= -WORSE_BY:
        return ""
    return (
        f"{pair.outer} has not converged: it contains {pair.inner} and explains its own photographs "
        f"{-estimate:.2g} dB worse, on {int((leads < 0).sum())} of {len(leads)} scenes"
    )


def _leads(pair: Nested, scenes: Sequence[SceneRecord], readings: Readings) -> np.ndarray:
    """Return PSNR of training views of the outer row less that of the inner, by scene."""
    if readings.missing_rows([pair.inner, pair.outer]):
        return np.empty(0)
    found = [[readings.value(row, s, TRAINING).value for row in (pair.outer, pair.inner)] for s in scenes]
    leads = [outer - inner for outer, inner in found if outer is not None and inner is not None]
    return np.array([lead for lead in leads if math.isfinite(lead)])


def _scenes(checks: Iterable[Check], track: str, readings: Readings) -> list[SceneRecord]:
    """Return the scenes that any of some checks is about."""
    found: dict[str, SceneRecord] = {}
    for check in checks:
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
    """Return the mean of a row over scenes; None where one lacks it."""
    values = [readings.value(row, scene, quantity).value for scene in scenes]
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known and len(known) == len(values) else None
