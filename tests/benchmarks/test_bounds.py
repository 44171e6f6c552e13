# SPDX-License-Identifier: Apache-2.0
"""A vector a point and the lights that reach it: known cases, and a scene."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from changed_scene import DESK, LAMP, enrich
from graycard import DatasetError, open_truth
from graycard.benchmarks.bounds import best_vector_errors, vector_bound
from graycard.cli import main
from graycard.dataset import manifest_of
from graycard.io import read_json, write_layers, write_manifest
from graycard.lights import write_lights

UP, DOWN, EAST = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)


def errors(ways: list[tuple[float, float, float]], arrives: list[float]) -> dict[str, float]:
    return best_vector_errors(np.array([ways]), np.array([arrives]), np.ones((1, len(ways)), bool))


def test_one_light_is_told_by_every_reading():
    for share in (0.0, 1.0):
        found = errors([UP], [share])
        assert max(found[form] for form in ("vector", "vector_half", "vector_relu")) < 0.01
        assert found["none"] == pytest.approx(1 - share)


def test_a_half_sphere_that_is_open_is_not_two_lights_that_are_seen_apart():
    """Both of two opposite lights arrive: cosines of one vector are c and -c."""
    found = errors([UP, DOWN], [1.0, 1.0])
    assert found["vector"] < 0.01, "a vector across both leaves both"
    assert found["vector_half"] == pytest.approx(0.5, abs=0.01), "(1 + c) / 2 and (1 - c) / 2"
    assert found["vector_relu"] == pytest.approx(np.sqrt(0.5), abs=0.02), "one is seen and the other is not"


def test_neighbours_in_light_and_in_shadow():
    """Lights at a right angle: each reading can do it."""
    found = errors([UP, EAST], [1.0, 0.0])
    assert found["vector"] < 0.01
    assert found["vector_relu"] < 0.05
    assert found["vector_half"] == pytest.approx((1 - np.sqrt(0.5)) / 2, abs=0.01), (
        "at half a right angle more"
    )


def test_lights_that_a_point_faces_away_from_do_not_count():
    ways, arrives = np.array([[UP, DOWN]]), np.array([[0.0, 1.0]])
    assert best_vector_errors(ways, arrives, np.array([[True, False]]))["none"] == 1.0
    assert best_vector_errors(ways, arrives, np.array([[False, True]]))["none"] == 0.0


@pytest.fixture
def scene(make_scene: Callable[..., Path]) -> Path:
    folder = enrich(make_scene(track="multilight"))
    truth = open_truth(folder / "truth")
    for view in truth.views:
        layers = truth.layers(view)
        layers["visibility.desk"] = np.ones_like(layers["depth"])
        write_layers(folder / f"truth/views/{view.name}.exr", layers)
    write_lights(folder / "truth/lights.json", (replace(LAMP, frame="world", position=(0, 0, 3.0)), DESK))
    write_manifest(folder / "truth", manifest_of(truth))
    return folder


def test_a_scene(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Stripes of shadow of the lamp, 5 of 12 columns, under a desk lamp that reaches everything."""
    found = vector_bound(scene)
    assert found.lights == 2
    assert found.errors["none"] == pytest.approx(np.sqrt(5 / 12 / 2), abs=0.06)
    assert found.errors["vector"] < 0.5 * found.errors["none"]
    assert found == vector_bound(scene)
    assert main(["bounds", str(scene), "--json", str(tmp_path / "b.json")]) == 0
    assert "bounds: 1 scenes" in capsys.readouterr().out
    assert read_json(tmp_path / "b.json")["result"][0]["scene"] == "multilight/tiny-0000"


def test_a_scene_without_visibility_is_refused(
    make_scene: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    with pytest.raises(DatasetError, match=r"expected layers visibility\.<light> in view .* none of lamp"):
        vector_bound(make_scene())
    assert main(["bounds"]) == 2
