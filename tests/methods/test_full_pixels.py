# SPDX-License-Identifier: Apache-2.0
"""Photographs of several exposures are full at several whites: a fit may be brighter there, never darker."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import Capture, Sensor, methods, open_truth, srgb_encode
from graycard.io import silent, write_rgb
from graycard.methods.surfels import EncodedPhotograph, SurfelScene, SurfelSettings, photographs
from sparse_points import with_points

EXPOSURES = (8.0, 0.5, 4.0, 1.0, 2.0)


@pytest.fixture
def scene(make_scene: Callable[..., Path]) -> Path:
    return make_scene(train=5, test=2)


def bracketed(scene: Path, exposures: Mapping[str, float] | None = None) -> Capture:
    """Return the capture with photographs that are cut off at the white of their own exposure."""
    capture = with_points(scene)
    if exposures is None:
        exposures = {v.name: factor for v, factor in zip(capture.train, EXPOSURES, strict=True)}
    for view in capture.train:
        white = 1 / (capture.exposure * exposures.get(view.name, 1.0))
        light = np.minimum(capture.photograph(view), np.float32(white))
        write_rgb(scene / "capture" / "photographs" / f"{view.name}.exr", light)
    return replace(capture, sensor=Sensor(bits=8, exposures=exposures))


def test_full_pixels_are_those_at_the_white_of_their_exposure(scene: Path) -> None:
    before = [with_points(scene).photograph(v) for v in with_points(scene).train]
    capture = bracketed(scene)
    found = [photograph.full for photograph in photographs(capture, SurfelSettings())]
    for light, full, factor in zip(before, found, EXPOSURES, strict=True):
        level = light * capture.exposure * factor
        sure = np.abs(level - 1) > 0.02
        marked = np.zeros(level.shape, bool) if full is None else full.numpy()
        np.testing.assert_array_equal(marked[sure], (level > 1)[sure])
    assert found[1] is None, "half of the exposure fills nothing"
    assert sum(full is not None and bool(full.float().mean() > 0.1) for full in found) >= 2


@pytest.mark.parametrize("sensor", [None, Sensor(), Sensor(bits=8, shot_noise=8000)])
def test_photographs_of_one_white_are_left_as_they_are(sensor: Sensor | None, scene: Path) -> None:
    capture = replace(bracketed(scene, {}), sensor=sensor)
    assert all(photograph.full is None for photograph in photographs(capture, SurfelSettings()))


def test_what_is_brighter_than_a_full_pixel_is_not_pulled(scene: Path) -> None:
    whole = photographs(bracketed(scene), SurfelSettings())[0]
    encoded = torch.tensor([[[0.5] * 3, [0.5] * 3, [0.5] * 3]])
    full = torch.tensor([[[True] * 3, [True] * 3, [False] * 3]])
    view = EncodedPhotograph(whole.camera, encoded, whole.sky, full=full)
    picture = torch.tensor([[[0.8] * 3, [0.2] * 3, [0.8] * 3]], requires_grad=True)
    taken = view.taken(picture)
    assert taken[..., 0].tolist() == [[pytest.approx(x) for x in (0.5, 0.2, 0.8)]]
    (taken - encoded).abs().sum().backward()
    assert picture.grad is not None
    assert picture.grad[0, :, 0].tolist() == [0, -1, 1]
    assert replace(view, full=None).taken(picture) is picture


def test_a_fit_finds_light_that_most_photographs_cut_off(scene: Path) -> None:
    """Told of the exposures it is nearer to the truth than one that takes each white for the light."""
    told = bracketed(scene)
    truth = open_truth(scene / "truth", check=False)
    errors = []
    for capture in (told, replace(told, sensor=None)):
        method = methods.load_method("2dgs")
        settings = methods.settings_of(method, {"iterations": 150, "surfels": 400, "degree": 0, "fill": 0.0})
        found = method.fit(capture, methods.Priors("none", {}), settings, 0, silent)
        assert isinstance(found, SurfelScene)
        views = [view for view in truth.views if view.split == "test"]
        drawn = [found.render(view.camera, ["radiance"])["radiance"] for view in views]
        true = [truth.layers(view)["radiance"] for view in views]
        shown = [
            [srgb_encode(image * truth.exposure) for image in pair] for pair in zip(drawn, true, strict=True)
        ]
        errors.append(float(np.mean([((a - b) ** 2).mean() for a, b in shown])))
    assert errors[0] < 0.7 * errors[1]
