# SPDX-License-Identifier: Apache-2.0
"""Light in albedo where much is mirrored, and where one view tells next to nothing."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from changed_scene import enrich
from graycard import Camera, View, look_at, open_truth
from graycard.dataset import manifest_of
from graycard.eval.metrics._leakage import MOST_GLOSS, slopes
from graycard.eval.scoring._readings import TrueView
from graycard.io import write_layers, write_manifest
from graycard.records import ScoreSheet

Layers = dict[str, np.ndarray]
Predict = Callable[..., Path]
CAMERA = Camera.from_fov(80, 60, 50, look_at(np.array([0.0, -3, 1]), np.zeros(3)))
VIEW = View("v", "test", CAMERA)
SHARES = (0.0, 0.37, 1.0)


@pytest.fixture
def rewrite(make_scene: Callable[..., Path]) -> Callable[[Callable[[View, Layers], None]], Path]:
    """``rewrite(change)`` makes a scene whose true layers ``change(view, layers)`` has changed in place."""

    def make(change: Callable[[View, Layers], None]) -> Path:
        scene = enrich(make_scene(track="tabletop"))
        truth = open_truth(scene / "truth")
        for view in truth.views:
            layers = truth.layers(view)
            change(view, layers)
            write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers)
        write_manifest(scene / "truth", manifest_of(truth))
        return scene

    return make


def leak(sheet: ScoreSheet, metric: str = "albedo.leakage") -> float:
    score = sheet.score(metric)
    assert score.value is not None, score.reason
    return score.value


def mirrored(shape: tuple[int, int]) -> np.ndarray:
    """Half of the rows mirror a lot, ``(H, W, 1)``, bool."""
    return (np.arange(shape[0]) % 10 < 5)[:, None, None] & np.ones((*shape, 1), bool)


@pytest.mark.parametrize("share", SHARES)
def test_strong_highlights_elsewhere_do_not_move_the_slope(
    rewrite: Callable[..., Path], predict: Predict, share: float
) -> None:
    """The photograph's way to be wrong: what is mirrored is greatest where little light is scattered."""

    def polish(view: View, layers: Layers) -> None:
        layers["base_color"][:] = 0.4
        diffuse = layers["direct.diffuse.lamp"]
        there = mirrored(diffuse.shape[:2])
        layers["direct.specular.lamp"] = np.where(there, 0.5 + 3 * diffuse.max() - 2 * diffuse, 0)

    scene = rewrite(polish)
    truth = open_truth(scene / "truth", check=False)

    def bake(view: View, layers: Layers) -> Layers:
        true = truth.layers(view)
        return layers | {
            "base_color": true["base_color"] * true["shading"] ** share + true["direct.specular.lamp"]
        }

    sheet = ge.score_predictions(predict(scene, bake), scene)
    assert leak(sheet) == pytest.approx(share, abs=1e-3)
    assert leak(sheet, "albedo.leakage.shadow") == pytest.approx(share, abs=1e-3)


@pytest.mark.parametrize("share", SHARES)
def test_a_view_of_few_pairs_weighs_little(
    rewrite: Callable[..., Path], predict: Predict, share: float
) -> None:
    """Its slope is far off, and is still told as its own."""

    def flatten(view: View, layers: Layers) -> None:
        if view.name == "test_003":
            layers["base_color"][:] = 0.4
            layers["shading"][:] = 1.0
            layers["shading"][:, ::3] = 0.5

    scene = rewrite(flatten)
    truth = open_truth(scene / "truth", check=False)

    def bake(view: View, layers: Layers) -> Layers:
        true = truth.layers(view)
        power = share + 7 if view.name == "test_003" else share
        return layers | {"base_color": true["base_color"] * true["shading"] ** power}

    score = ge.score_predictions(predict(scene, bake), scene).score("albedo.leakage")
    others = {name: found for name, found in score.per_view.items() if name != "test_003"}
    assert score.value == pytest.approx(share, abs=1e-3)
    assert score.breakdown["signed"] == pytest.approx(share, abs=1e-3)
    assert score.per_view["test_003"] == pytest.approx(share + 7, abs=1e-3)
    assert list(others.values()) == pytest.approx([share] * len(others), abs=1e-3)


def asked(gloss: float) -> object:
    """The pairs of a gray wall in a ramp of light, of which a share of the diffuse light is mirrored."""
    ramp = np.linspace(0.2, 1.0, 80)[None, :, None] * np.ones((60, 80, 3), np.float32)
    layers = {
        "base_color": np.full_like(ramp, 0.5),
        "shading": ramp,
        "object_id": np.ones((60, 80), np.uint32),
        "direct.diffuse.lamp": 0.3 * ramp,
        "indirect.diffuse.lamp": 0.2 * ramp,
        "indirect.specular.lamp": 0.25 * gloss * ramp,
        "direct.specular.lamp": 0.25 * gloss * ramp,
    }
    return ge.find_metric("albedo.leakage").rule.prepare(TrueView(VIEW, layers, frozenset()), 1.0)


def test_a_third_of_the_diffuse_light_is_the_limit() -> None:
    """Both lobes count whole, direct light and bounced."""
    assert asked(0.99 * MOST_GLOSS) is not None
    assert asked(1.01 * MOST_GLOSS) is None


def test_a_scene_whose_truth_has_no_lobes_is_judged_everywhere(
    rewrite: Callable[..., Path], predict: Predict
) -> None:
    def strip(view: View, layers: Layers) -> None:
        for name in [n for n in layers if n.startswith(("direct.", "indirect."))]:
            del layers[name]

    scene = rewrite(strip)
    assert leak(ge.score_predictions(predict(scene), scene)) == 0


def test_each_pair_has_a_slope() -> None:
    light, errors = np.array([0.0, 1.0, 3.0]), np.array([0.0, 0.5, 3.0])
    found = slopes(errors, light, np.array([0, 0, 1]), np.array([1, 2, 2]))
    assert found.tolist() == [0.5, 1.0, 1.25]
    assert ge.median_slope(errors, light, np.array([0, 0, 1]), np.array([1, 2, 2])) == 1.0
