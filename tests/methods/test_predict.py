# SPDX-License-Identifier: Apache-2.0
"""What a method gives is checked where it is written, before it is taken for a prediction."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from graycard import (
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

    with pytest.raises(MethodError, match="method 'mine' to fit, got OutputError: no room for a cache"):
        write(make_scene(), tmp_path / "p", make(**{member: raises}))
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        write(make_scene(), tmp_path / "file", make())
