# SPDX-License-Identifier: Apache-2.0
"""Layers of a method are checked as they are written, before they are taken for a prediction."""

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from graycard import (
    Camera,
    EnvironmentLight,
    GraycardError,
    MethodError,
    OutputError,
    PointLight,
    Predictions,
    methods,
    open_capture,
    open_predictions,
)
from graycard.io import silent
from graycard.layers import shape_of
from graycard.predictions import write_composed, write_environment, write_relit, write_view

LIGHT = PointLight("lamp", (0, 0, 0), (1, 1, 1))

SKY = EnvironmentLight("sky", "")


def make(**changes: object) -> SimpleNamespace:
    """A decomposition that provides a flat base colour, with some members changed."""
    members: dict[str, object] = {
        "provides": frozenset({"base_color"}),
        "render": lambda camera, layers: {"base_color": np.full((camera.height, camera.width, 3), 0.5)},
        "lights": lambda: None,
        "save": lambda folder: None,
    }
    return SimpleNamespace(**(members | changes))


def write(scene: Path, folder: Path, decomposition: object) -> Predictions:
    capture = open_capture(scene / "capture")
    methods.write_predictions(decomposition, capture, "mine", folder, silent)  # pyright: ignore
    return open_predictions(folder)


def test_what_follows_the_contract_is_written(make_scene: Callable[..., Path], tmp_path: Path):
    found = write(make_scene(), tmp_path / "p", make(lights=lambda: [LIGHT]))
    assert found.is_whole()
    assert found.lights() == (LIGHT,)


def test_the_image_of_an_environment_is_written(make_scene: Callable[..., Path], tmp_path: Path):
    image = np.arange(96.0).reshape(4, 8, 3)
    decomposition = make(lights=lambda: [LIGHT, SKY], environment=lambda light: image)
    found = write(make_scene(), tmp_path / "p", decomposition)
    lights = found.lights()
    assert lights is not None
    sky = lights[-1]
    assert isinstance(sky, EnvironmentLight)
    assert np.array_equal(found.environment(sky), image)
    assert f"environments/{sky.name}.exr" in found.files


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"provides": frozenset()}, "to provide a layer, got none"),
        ({"provides": frozenset({"albdo"})}, "did you mean 'albedo'"),
        ({"render": lambda camera, layers: {}}, r"expected the layers \['base_color'\] of view .*, got \[\]"),
        ({"render": lambda camera, layers: 42}, r"expected the layers \['base_color'\] of view .*, got 42"),
        ({"render": lambda camera, layers: {"base_color": np.zeros((3, 3))}}, "as real numbers of shape"),
        (
            {"render": lambda camera, layers: {"base_color": np.zeros((24, 28, 3), complex)}},
            "got complex128 of shape",
        ),
        ({"lights": lambda: [SKY]}, r"expected a method environment\(light\) that gives the image of 'sky'"),
        (
            {"lights": lambda: [SKY], "environment": lambda light: np.ones((4, 8))},
            r"of shape \(H, W, 3\), got",
        ),
        ({"lights": lambda: LIGHT}, "expected lights as a sequence of graycard lights or None"),
        ({"lights": lambda: [{"type": "point"}]}, "expected lights as a sequence of graycard lights or None"),
    ],
)
def test_what_does_not_is_named(
    make_scene: Callable[..., Path], tmp_path: Path, changes: dict[str, object], message: str
):
    with pytest.raises(GraycardError, match=message):
        write(make_scene(), tmp_path / "p", make(**changes))
    assert not (tmp_path / "p" / "predictions.json").exists()


def test_a_fit_must_give_a_decomposition(make_scene: Callable[..., Path], tmp_path: Path):
    with pytest.raises(MethodError, match="expected fit of 'mine' to give a decomposition, got None"):
        write(make_scene(), tmp_path / "p", None)


@pytest.mark.parametrize("member", ["render", "lights"])
def test_a_method_that_cannot_write_is_told_from_an_output_that_cannot_be_written(
    make_scene: Callable[..., Path], tmp_path: Path, member: str
):
    def raises(*arguments: object) -> None:
        raise OutputError("no room for a cache")

    with pytest.raises(MethodError, match="method 'mine' failed with OutputError: no room for a cache"):
        write(make_scene(), tmp_path / "p", make(**{member: raises}))
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        write(make_scene(), tmp_path / "file", make())


def flat(**changes: float) -> SimpleNamespace:
    """A decomposition that provides flat layers, some of them with other values."""

    def render(camera: Camera, layers: list[str]) -> dict[str, np.ndarray]:
        made = {n: np.full(shape_of(n, camera.height, camera.width), 0.5) for n in layers}
        for name, value in changes.items():
            made[name].reshape(-1)[value_at(made[name])] = value
        return made

    return make(provides=frozenset(changes), render=render)


def value_at(values: np.ndarray) -> int:
    """Place of row 3, column 4, and channel 1 where there are channels."""
    return int(np.ravel_multi_index((3, 4, 1)[: values.ndim], values.shape))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39])
@pytest.mark.parametrize(("layer", "where"), [("base_color", "(3, 4, 1)"), ("roughness", "(3, 4)")])
def test_a_fit_writes_no_value_that_is_not_finite(
    make_scene: Callable[..., Path], tmp_path: Path, layer: str, where: str, value: float
):
    shown = "inf" if value == 1e39 else str(value)  # more than float32 can hold
    message = f"view train_000: expected finite values in {layer}, got {shown} (1 of "
    with pytest.raises(MethodError, match=re.escape(message)) as caught:
        write(make_scene(), tmp_path / "p", flat(**{layer: value}))
    axes = "row, column, channel" if "1)" in where else "row, column"
    assert f"the first at {where}: {axes}). Write 0 where nothing is seen" in str(caught.value)
    assert not (tmp_path / "p" / "predictions.json").exists()


def test_depth_may_end_nowhere_but_not_before_the_camera(make_scene: Callable[..., Path], tmp_path: Path):
    scene = make_scene()
    assert write(scene, tmp_path / "p", flat(depth=np.inf)).is_whole()
    with pytest.raises(MethodError, match="expected finite values in depth, got -inf"):
        write(scene, tmp_path / "q", flat(depth=-np.inf))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int64])
def test_a_fit_writes_no_codes_of_0_to_255(make_scene: Callable[..., Path], tmp_path: Path, dtype: type):
    def render(camera: Camera, layers: list[str]) -> dict[str, np.ndarray]:
        codes = np.full((camera.height, camera.width, 3), 7, dtype)
        codes[3, 4, 1] = 200
        return {"base_color": codes}

    message = (
        f"view train_000: expected base_color in floating point, got {np.dtype(dtype)}, as 200 at (3, 4, 1): "
        "row, column, channel. Divide codes of 0 to 255 by 255 and undo their sRGB curve"
    )
    with pytest.raises(MethodError, match=re.escape(message)):
        write(make_scene(), tmp_path / "p", make(render=render))


def test_a_mask_may_be_of_any_type(make_scene: Callable[..., Path], tmp_path: Path):
    def render(camera: Camera, layers: list[str]) -> dict[str, np.ndarray]:
        mask = np.arange(camera.height * camera.width).reshape(camera.height, camera.width) % 2
        return {"glossy": mask, "metallic": mask > 0}

    mine = make(provides=frozenset({"glossy", "metallic"}), render=render)
    found = write(make_scene(), tmp_path / "p", mine).layers("test_001")
    assert (found["glossy"][0, 1], found["metallic"][0, 1], found["glossy"].dtype) == (1, 1, np.float32)


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.full((4, 8, 3), 9, np.uint8), "image of 'sky': expected radiance in floating point, got uint8"),
        (np.full((4, 8, 3), np.nan), "image of 'sky': expected finite values in radiance, got nan"),
    ],
)
def test_the_image_of_an_environment_is_held_to_the_same(
    make_scene: Callable[..., Path], tmp_path: Path, image: np.ndarray, message: str
):
    with pytest.raises(MethodError, match=message):
        write(make_scene(), tmp_path / "p", make(lights=lambda: [SKY], environment=lambda light: image))


def test_writers_of_predictions_take_no_codes(tmp_path: Path):
    codes = np.full((4, 6, 3), 200, np.uint8)
    writers: dict[str, Callable[[], object]] = {
        "test_001": lambda: write_view(tmp_path, "test_001", {"base_color": codes}),
        "without-lamp, test_001": lambda: write_relit(tmp_path, "without-lamp", "test_001", codes),
        "composition, test_001": lambda: write_composed(tmp_path, "test_001", codes),
        "sky": lambda: write_environment(tmp_path, SKY, codes),
    }
    for where, writer in writers.items():
        with pytest.raises(ValueError, match=rf"^{where}: expected \w+ in floating point, got uint8, as 200"):
            writer()
    write_view(tmp_path, "test_001", {"object_id": codes[..., 0].astype(np.uint32)})
    assert not list(tmp_path.glob("relighting")) + list(tmp_path.glob("environments"))
