# SPDX-License-Identifier: Apache-2.0
"""The worst square of a picture, and the property of the scene that its error follows."""

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.stats import spearmanr

from graycard import luminance
from graycard.reports._evidence import MethodEvidence, SceneEvidence, open_scene
from graycard.reports._explanations import EXPLAINS, explain, rank_correlation, scene_properties, steps
from graycard.reports.pictures._worst_tile import Tile, find_worst_tiles, worst_tile

RNG = np.random.default_rng(1003)


@pytest.fixture(scope="module")
def scene(tiny_scenes: dict[str, Path]) -> SceneEvidence:
    return open_scene(tiny_scenes["dark"])


def test_worst_tile_is_the_planted_one() -> None:
    error = np.full((80, 96), 0.1)
    error[37:47, 61:71] = 1.0
    found = worst_tile(error)
    assert found is not None
    assert (found.row, found.column, found.side) == (37, 61, 10)
    assert found.mean == pytest.approx(1.0)


def test_worst_tile_against_every_window() -> None:
    error = RNG.random((30, 26))
    error[RNG.random((30, 26)) < 0.3] = np.nan
    found = worst_tile(error)
    assert found is not None
    windows = np.lib.stride_tricks.sliding_window_view(error, (8, 8))
    means = np.where(np.isfinite(windows).sum(axis=(2, 3)) >= 32, np.nanmean(windows, axis=(2, 3)), 0)
    assert (found.row, found.column) == np.unravel_index(means.argmax(), means.shape)
    assert found.mean == pytest.approx(means.max())


def test_tile_that_is_mostly_outside_the_mask_does_not_enter() -> None:
    error = np.full((64, 64), 0.1)
    error[:8, :20] = np.nan
    error[2, 2] = 100.0
    found = worst_tile(error)
    assert found is not None
    assert found.mean == pytest.approx(0.1)


@pytest.mark.parametrize("error", [np.zeros((40, 40)), np.full((40, 40), np.nan)])
def test_exact_or_unseen_has_no_worst_tile(error: np.ndarray) -> None:
    assert worst_tile(error) is None


def test_region_stops_at_the_border() -> None:
    assert Tile(0, 90, 10, 1.0).region((100, 100)) == (slice(0, 20), slice(80, 100))


def test_rank_correlation_is_spearmans_with_ties_and_holes() -> None:
    a, b = RNG.integers(0, 4, (20, 20)).astype(float), RNG.random((20, 20))
    b += a
    b[3, 4] = np.nan
    expected = float(np.asarray(spearmanr(a[np.isfinite(b)], b[np.isfinite(b)]))[0])
    assert rank_correlation(a, b) == pytest.approx(expected)
    assert rank_correlation(a, -b) == pytest.approx(-expected)
    assert rank_correlation(a, np.ones_like(a)) == 0
    assert rank_correlation(a[:2, :2], b[:2, :2]) == 0


def test_explanation_is_the_property_that_made_the_error() -> None:
    properties = {name: RNG.random((40, 40)) for name in ("shading", "roughness", "metal")}
    whole = slice(0, 40), slice(0, 40)
    error = np.exp(-3 * properties["roughness"]) + 0.01 * RNG.random((40, 40))
    found = explain(error, properties, whole)
    assert found is not None
    assert found.name == "roughness"
    assert found.correlation < -0.9
    assert explain(RNG.random((40, 40)), properties, whole) is None
    assert explain(error, {}, whole) is None


def test_unrelated_smooth_patterns_explain_nothing() -> None:
    def blurred() -> np.ndarray:
        return gaussian_filter(RNG.normal(size=(60, 60)), 3)[9:51, 9:51]

    whole = slice(0, 42), slice(0, 42)
    draws = [explain(blurred(), {str(i): blurred() for i in range(18)}, whole) for _ in range(30)]
    assert sum(found is not None for found in draws) <= 1  # none in 120 when EXPLAINS was chosen


def test_bar_of_an_explanation() -> None:
    pattern = RNG.normal(size=(40, 40))
    whole = slice(0, 40), slice(0, 40)
    for noise, named in ((1.0, True), (2.0, False)):  # correlations of about 0.7 and 0.45
        error = pattern + noise * RNG.normal(size=pattern.shape)
        correlation = rank_correlation(error, pattern)
        assert (correlation >= EXPLAINS) == named
        assert (explain(error, {"pattern": pattern}, whole) is not None) == named


def test_steps_are_the_distance_to_a_neighbour_widened() -> None:
    values = np.zeros((9, 9, 3))
    values[:, 5:] = (3.0, 4.0, 0.0)
    found = steps(values)
    assert (found[:, 3:7] == 5).all()
    assert not found[:, :3].any()
    assert not found[:, 7:].any()


def test_properties_are_those_that_the_truth_has(scene: SceneEvidence) -> None:
    view = scene.shown[0]
    layers = dict(scene.layers[view.name])
    height, width = layers["depth"].shape
    light = RNG.random((3, height, width, 3))
    layers |= {
        "direct.specular.lamp": light[0],
        "indirect.specular.lamp": light[1],
        "indirect.diffuse.sky": light[2],
        "visibility.lamp": RNG.random((height, width)),
    }
    found = scene_properties(layers, view)
    np.testing.assert_allclose(found["specular light"], luminance(light[0]) + luminance(light[1]))
    np.testing.assert_allclose(found["indirect light"], luminance(light[2]))
    np.testing.assert_allclose(found["shadow of lamp"], 1 - layers["visibility.lamp"])
    assert "roughness" not in found
    assert all(values.shape == (height, width) for values in found.values())
    assert all(np.isfinite(values).all() for values in found.values())
    floor = layers["object_id"] == 1
    ray = view.camera.rays()[floor]
    np.testing.assert_allclose(found["grazing view"][floor], 1 + ray[:, 2], atol=1e-6)
    assert np.isfinite(scene_properties({"depth": np.full((4, 4), np.inf)}, view)["depth edge"]).all()


def test_worst_tiles_of_a_scene(scene: SceneEvidence) -> None:
    """A prediction that is wrong in one square of one view, shown from a view that is not embedded too."""
    wrong, test = {}, scene.test
    for view in test:
        layers = {k: v.copy() for k, v in scene.truth.layers(view).items() if k in ("base_color", "normal")}
        wrong[view.name] = layers
    seen = scene.mask("base_color", test[1])
    wrong[test[1].name]["base_color"][8:16, 10:18] += 0.5
    methods = [MethodEvidence("bad", layers=wrong), MethodEvidence("none")]
    bad, none = find_worst_tiles(scene, methods)
    assert none.tiles == ()
    (tile,) = bad.tiles  # its normals are exact
    assert (tile.title, tile.method) == ("Base color", "bad")
    assert tile.where.startswith(f"{test[1].name}, row ")
    inside = seen[8:16, 10:18].any()
    assert inside
    assert tile.truth.width == tile.prediction.width == tile.error.width
    left, top, side = tile.frame
    assert 0 <= left < 1
    assert top >= 0
    assert side == pytest.approx(8 / tile.truth.width)


def test_tile_names_the_layer_that_its_error_was_made_of(scene: SceneEvidence) -> None:
    """Base colour that is too bright where surfaces are seen from the side."""
    layers = {}
    for view in scene.test:
        true = scene.truth.layers(view)
        grazing = scene_properties(true, view)["grazing view"]
        layers[view.name] = {"base_color": true["base_color"] + 0.4 * grazing[..., None] ** 2}
    (found,) = find_worst_tiles(scene, [MethodEvidence("baked", layers=layers)])
    (tile,) = found.tiles
    assert tile.reason.startswith("rises with: grazing view (rank correlation +")
    assert tile.explanation is not None
    assert tile.explanation.width == tile.truth.width
