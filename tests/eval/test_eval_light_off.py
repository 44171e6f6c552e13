# SPDX-License-Identifier: Apache-2.0
"""Scores of pictures with one light switched off."""

import math

import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio

import graycard.eval as ge
from graycard import Camera, View, look_at, srgb_encode
from graycard.eval.metrics._light_off import LightsOffScorer
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._readings import PredictedView, TrueView
from graycard.eval.scoring._training import Training
from graycard.records import Score

SIZE = 12
RNG = np.random.default_rng(4)
CAMERA = Camera.from_fov(SIZE, SIZE, 50, look_at(np.array([0.0, -3, 1]), np.zeros(3)))
VIEW = View("test_000", "test", CAMERA)
PICTURES = {name: RNG.uniform(0.02, 0.3, (SIZE, SIZE, 3)) for name in ("left", "right", "sky")}
EXPOSURE = 1.2


def layers_of(pictures: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    found = {f"radiance.{name}": picture for name, picture in pictures.items()}
    return {name: v.astype(np.float32) for name, v in (found | {"radiance": sum(pictures.values())}).items()}  # pyright: ignore


def judged(
    predicted: dict[str, np.ndarray],
    true: dict[str, np.ndarray] = PICTURES,
    names: dict[str, str] | None = None,
) -> dict[str, Score]:
    ids = np.ones((SIZE, SIZE), np.int32)
    ids[0] = 0
    truth = TrueView(VIEW, layers_of(true) | {"object_id": ids}, frozenset())
    metrics = [metric for metric in ge.registry() if metric.record.group == "light_off"]
    observer = LightsOffScorer(metrics, ("left", "right"))
    scene = SceneFacts(EXPOSURE, Training(frozenset(), (), {}), light_names=names)
    observer.observe(PredictedView(VIEW, predicted), truth, scene)
    return {score.metric: score for score in observer.scores()}


def test_shares_of_the_right_lights_are_perfect() -> None:
    found = judged(layers_of(PICTURES))
    assert (found["light_off.psnr"].value, found["light_off.better"].value) == (math.inf, 100.0)
    assert found["light_off.psnr"].breakdown["left on"] < 30


def test_it_is_the_psnr_of_the_sum_of_the_others() -> None:
    wrong = PICTURES | {"left": PICTURES["left"] * 1.3, "right": PICTURES["right"] * 0.9}
    found = judged(layers_of(wrong))["light_off.psnr"].value
    squares = []
    for off, kept in (("left", ("right", "sky")), ("right", ("left", "sky"))):
        del off
        p, t = (srgb_encode((x[kept[0]] + x[kept[1]]) * EXPOSURE)[1:] for x in (wrong, PICTURES))
        squares.append(10 ** (-peak_signal_noise_ratio(t, p, data_range=1) / 10))
    assert found == pytest.approx(-10 * np.log10(np.mean(squares)), abs=1e-4)


def test_to_dim_everything_is_no_knowledge_of_lights() -> None:
    """Every light is said to be a third of the picture: better than nothing done, and worth nothing."""
    whole = np.sum(list(PICTURES.values()), axis=0)
    found = judged(layers_of({name: whole / 3 for name in PICTURES}))
    better = found["light_off.better"]
    assert better.breakdown["than left on"] == 100.0
    assert better.value == 0.0
    psnr = found["light_off.psnr"]
    assert psnr.breakdown["dimmed"] >= (psnr.value or 99) - 0.3


def test_surroundings_alone_leave_every_lamp_on() -> None:
    lit = {"sky": np.sum(list(PICTURES.values()), axis=0)}
    found = judged(layers_of(lit), names={"sky": "sky"})
    assert found["light_off.better"].value == 0.0
    assert found["light_off.psnr"].value == pytest.approx(found["light_off.psnr"].breakdown["left on"])


def test_lights_that_are_taken_for_each_other_are_better_left_on() -> None:
    mild = PICTURES | {"left": PICTURES["left"] * 0.2}
    swapped = mild | {"left": mild["right"], "right": mild["left"]}
    found = judged(layers_of(swapped), mild)
    better = found["light_off.better"]
    assert better.breakdown["than left on"] == 50.0, "to take the strong one for the weak one is worse"
    assert better.value == 0.0, "and the weak one for the strong one is no better than dimming"


def test_a_light_that_is_not_predicted_stays_on() -> None:
    """The whole picture is right, but one lamp stands for both."""
    merged = {"left": PICTURES["left"] + PICTURES["right"], "sky": PICTURES["sky"]}
    found = judged(layers_of(merged), names={"left": "left", "sky": "sky"})
    assert found["light_off.better"].value == 0.0, "both at once are too much, and the other stays on"
    assert math.isfinite(found["light_off.psnr"].value or math.inf)


def test_without_shares_it_is_not_provided_and_with_a_gap_it_has_failed() -> None:
    whole = {"radiance": layers_of(PICTURES)["radiance"]}
    assert {score.status for score in judged(whole).values()} == {"not provided"}
    gap = layers_of(PICTURES)
    del gap["radiance.left"]
    score = judged(gap)["light_off.psnr"]
    assert score.status == "failed"
    assert "radiance.left" in score.reason


def test_a_light_that_nobody_sees_at_work_is_not_asked_for() -> None:
    dim = PICTURES | {"left": PICTURES["left"] * 1e-4}
    found = judged(layers_of(dim | {"left": -dim["left"]}), dim)
    assert found["light_off.better"].value == 100.0
    assert not judged(layers_of(dim), {name: picture * 1e-6 for name, picture in PICTURES.items()})
