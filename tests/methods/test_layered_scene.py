# SPDX-License-Identifier: Apache-2.0
"""The skeleton that scenes and methods on surfels share, with a scene of its own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import pytest
import torch

from graycard import Camera, Light, MethodError, methods, open_capture
from graycard.io import silent
from graycard.methods.splat import Parameters, arrays_of, parameters_from, parameters_of, surfels_from_points
from graycard.methods.surfels import FitTask, LayeredScene, SceneContents, SceneMethod, check_lamp_on_camera

EYE = Camera.from_fov(4, 3, 60, np.eye(4))


@dataclass(frozen=True, eq=False)
class GrayScene(LayeredScene):
    level: float

    @property
    def provides(self) -> frozenset[str]:
        return frozenset({"radiance", "depth"})

    def _images(self, camera: Camera, layers: Sequence[str]) -> Mapping[str, np.ndarray]:
        assert not torch.is_grad_enabled()
        shape = camera.height, camera.width
        return {
            "radiance": np.full((*shape, 3), self.level),
            "depth": np.ones(shape),
            "spare": np.ones(shape),
        }

    def lights(self) -> tuple[Light, ...] | None:
        return None

    def _contents(self) -> SceneContents:
        return SceneContents("gray-surfels", {"level": self.level}, arrays_of(self.parameters))

    @classmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        return cls(parameters_from(saved.arrays), saved.facts["level"])

    def _export(self, path: Path) -> None:
        path.write_text("ply")


class GrayMethod(SceneMethod[methods.NoSettings, GrayScene]):
    name = "gray-surfels"
    summary = "surfels of one level"
    settings_type = methods.NoSettings
    scene_type = GrayScene
    checks = (check_lamp_on_camera,)

    def _fitted(self, task: FitTask[methods.NoSettings]) -> GrayScene:
        return GrayScene(some_surfels(), task.capture.exposure * task.seed)


def some_surfels() -> Parameters:
    points = np.random.default_rng(0).normal(size=(5, 3))
    return parameters_of(surfels_from_points(points, points, np.zeros((5, 0))))


def test_it_renders_the_layers_that_were_asked_for_and_no_others():
    found = GrayScene(some_surfels(), 0.18).render(EYE, ["radiance"])
    assert found.keys() == {"radiance"}
    np.testing.assert_array_equal(found["radiance"], np.full((3, 4, 3), 0.18))
    assert torch.is_grad_enabled(), "gradients are off within alone"


@pytest.mark.parametrize("name", ["normal", "spare"])
def test_a_layer_that_is_not_provided_is_refused(name: str):
    with pytest.raises(
        MethodError, match=rf"expected layers out of \['depth', 'radiance'\], got \['{name}'\]"
    ):
        GrayScene(some_surfels(), 0.18).render(EYE, ["depth", name])


def test_a_saved_scene_comes_back_with_the_same_bits(tmp_path: Path):
    scene = GrayScene(some_surfels(), 0.18)
    scene.save(tmp_path)
    back = GrayMethod().load(tmp_path)
    assert back.level == scene.level
    assert all(torch.equal(v, back.parameters.all[name]) for name, v in scene.parameters.all.items())
    assert (tmp_path / "surfels.ply").read_text() == "ply"


def test_a_scene_of_another_method_is_refused(tmp_path: Path):
    GrayScene(some_surfels(), 0.18).save(tmp_path)
    with pytest.raises(MethodError, match="expected a decomposition by 'other' .* got one by 'gray-surfels'"):
        GrayScene.load(tmp_path, "other")


def test_a_scene_that_cannot_be_drawn_is_damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Loading draws a few pixels: what is wrong with the arrays is said there, and not by whoever renders."""
    GrayScene(some_surfels(), 0.18).save(tmp_path)

    def fail(self: GrayScene, *_: object) -> Mapping[str, np.ndarray]:
        raise KeyError("tone weights 1")

    monkeypatch.setattr(GrayScene, "_images", fail)
    with pytest.raises(MethodError, match="expected a whole decomposition in .*: no 'tone weights 1'"):
        GrayMethod().load(tmp_path)


def test_a_capture_is_checked_before_it_is_fitted(tiny_scenes: Mapping[str, Path]):
    dark, bright = (open_capture(tiny_scenes[t] / "capture", check=False) for t in ("dark", "tabletop"))
    method = GrayMethod()
    assert isinstance(method, methods.Method)
    assert method.fit(dark, methods.Priors(), methods.NoSettings(), 2, silent).level == 2 * dark.exposure
    with pytest.raises(MethodError, match="expected a capture whose light moves with the camera"):
        method.fit(bright, methods.Priors(), methods.NoSettings(), 0, silent)


def test_stages_have_other_settings_and_nothing_else(tiny_scenes: Mapping[str, Path]):
    capture = open_capture(tiny_scenes["dark"] / "capture", check=False)
    task = FitTask(capture, methods.Priors(), methods.NoSettings(), 3, silent)
    stage = task.with_settings("other")
    assert (stage.settings, stage.seed, stage.capture, stage.extent) == ("other", 3, capture, task.extent)
