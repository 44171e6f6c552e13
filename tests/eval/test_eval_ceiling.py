# SPDX-License-Identifier: Apache-2.0
"""Ceilings by the truth's noise: scores of a noise-free prediction, and warnings for better ones."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import graycard.eval as ge
from changed_scene import enrich
from graycard import Camera, Predictions, View, look_at, open_truth
from graycard.edits import composed_file
from graycard.eval.kinds._metric import Metric
from graycard.eval.scoring._ceiling import MARGINS, ceiling_warnings, is_suspicious, pooled_ceiling
from graycard.io import write_layers
from graycard.predictions import finish_predictions

Layers = dict[str, np.ndarray]
Predict = Callable[..., Path]
VIEW = View("v", "test", Camera.from_fov(80, 60, 50, look_at(np.array([0.0, -3, 1]), np.zeros(3))))
RNG = np.random.default_rng(11)


@pytest.mark.parametrize("metric", ge.registry(), ids=lambda m: m.id)
def test_a_metric_with_a_ceiling_has_a_margin(metric: Metric[Any]) -> None:
    assert not metric.ceiling.known or metric.record.unit in MARGINS


def test_scores_have_the_ceilings_that_the_rules_say(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = enrich(make_scene(track="tabletop"))
    truth = open_truth(scene / "truth", check=False)
    folder = predict(scene, lambda view, layers: truth.layers(view))
    scores = ge.score_predictions(folder, scene).scores
    assert {s.metric: s.noise_ceiling is not None for s in scores if s.status == "scored"} == {
        s.metric: ge.find_metric(s.metric).ceiling.known and s.metric != "shading.psnr"
        for s in scores
        if s.status == "scored"
    }, "the shading of this scene is exact"


def test_who_holds_the_noise_is_named(make_scene: Callable[..., Path], predict: Predict) -> None:
    """The truth as a prediction, with its changed pictures: its errors are less than the noise."""
    scene = enrich(make_scene(track="tabletop"))
    truth = open_truth(scene / "truth", check=False)
    folder = predict(scene, lambda view, layers: truth.layers(view))
    for view in (v for v in truth.views if v.split == "test"):
        for edit in truth.edits:
            relit = truth.relit(edit.name, view)["radiance"]
            write_layers(folder / edit.view_file(view.name), {"radiance": relit})
        composed = truth.composed(view)["radiance"]
        write_layers(folder / composed_file(view.name), {"radiance": composed})
    finish_predictions(folder, Predictions("truth", truth.track, truth.scene), truth.lights())
    sheet = ge.score_predictions(folder, scene)
    known = [s for s in sheet.scores if s.unit in ("dB", "σ") and s.metric != "shading.psnr"]
    assert {s.metric for s in known if ge.find_metric(s.metric).ceiling.known} == {
        s.metric for s in known if any("holds the noise of the truth itself" in w for w in s.warnings)
    }
    (said,) = sheet.score("novel_view.noise_rms").warnings
    assert said.startswith("0.000 σ is ")
    assert "chance makes up for less than 0.1 σ" in said


@pytest.mark.parametrize(
    ("value", "ceiling", "unit", "up", "warned"),
    [
        (41.0, 40.0, "dB", True, True),
        (40.9, 40.0, "dB", True, False),
        (math.inf, 40.0, "dB", True, True),
        (0.89, 1.0, "σ", False, True),
        (0.95, 1.0, "σ", False, False),
        (3.0, 1.0, "σ", False, False),
        (0.96, 0.93, "1", True, False),
        (math.nan, 40.0, "dB", True, False),
        (None, 40.0, "dB", True, False),
        (41.0, None, "dB", True, False),
        (90.0, 1.0, "°", True, False),
    ],
)
def test_the_margin_is_that_of_the_unit(
    value: float | None, ceiling: float | None, unit: str, up: bool, warned: bool
) -> None:
    assert bool(ceiling_warnings(value, ceiling, unit, up)) == warned


def test_a_warning_says_how_far_and_which_way() -> None:
    assert ceiling_warnings(0.7, 1.0, "σ", False) == (
        "0.700 σ is 0.300 σ below the 1.000 σ that the noise of the truth allows, and chance makes up for "
        "less than 0.1 σ: the prediction holds the noise of the truth itself",
    )
    assert "41.0 dB is 1.0 dB above the 40.0 dB" in ceiling_warnings(41.0, 40.0, "dB", True)[0]
    assert not is_suspicious(math.inf, "%")


def test_a_pooled_ceiling_is_that_of_the_mean_of_all_views() -> None:
    assert pooled_ceiling([0.01, 0.03], ge.psnr) == pytest.approx(ge.psnr(0.02))
    assert pooled_ceiling([0.01, None], ge.psnr) is None
    assert pooled_ceiling([0.0, 0.0], ge.psnr) is None
    assert pooled_ceiling([], ge.psnr) is None
