# SPDX-License-Identifier: Apache-2.0
"""``sunfaded-oracle``: the lights alone on true surfaces, in a box room whose every pixel is known."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import Camera, MethodError, SpotLight, look_at, methods, open_capture, open_truth
from graycard.io import silent
from graycard.layers import find_fault
from graycard.methods._store import restore, store
from graycard.methods.shading import light_at
from graycard.methods.splat import Maps
from graycard.methods.sunfaded import OracleSunFadedScene, SunFadedSettings
from graycard.methods.sunfaded._light import POSITION, lamp_parameters
from graycard.methods.sunfaded._model import AMBIENT, picture_of
from graycard.methods.sunfaded._objective import DisplayedPhotograph
from graycard.methods.sunfaded._oracle import as_drawn, fit_lights
from graycard.methods.sunfaded._tiles import lens_of
from graycard.methods.sunfaded._weight import unlit_weight
from graycard.methods.surfels import srgb_encode_tensor

ROOM = np.array([2.0, 1.5, 1.2])
"""Half sides of a box, metres."""
SIZE = 32
QUICK = {"iterations": 60}


@dataclass(frozen=True)
class Room:
    """Views of the inside of a box, cast ray by ray."""

    cameras: list[Camera]
    surfaces: list[dict[str, np.ndarray]]

    @property
    def drawn(self) -> list[Maps]:
        return [as_drawn(known, "linear") for known in self.surfaces]


def seen_from(camera: Camera) -> dict[str, np.ndarray]:
    """The wall that each ray meets first: nearest of the planes ``|x| = ROOM``."""
    rays = camera.rays()
    distances = (np.sign(rays) * ROOM - camera.position) / rays
    axis, distance = distances.argmin(axis=-1), distances.min(axis=-1)
    points = camera.position + rays * distance[..., None]
    normal = -np.sign(np.take_along_axis(rays, axis[..., None], axis=-1)) * np.eye(3)[axis]
    checks = (np.floor(points * 2.5 + 1e-6).sum(axis=-1) % 2)[..., None]
    return {
        "base_color": 0.2 + checks * np.array([0.5, 0.35, 0.2]),
        "normal": normal,
        "depth": distance * (rays @ camera.forward),
    }


@pytest.fixture(scope="module")
def room() -> Room:
    places = [(-1.0, 0.4, 0.2), (-0.6, -0.7, 0.1), (-0.8, 0.0, -0.5), (-0.2, 0.6, 0.4)]
    return seen_by([camera_at(eye, 0.3 * n - 0.5) for n, eye in enumerate(places)])


def camera_at(eye: tuple[float, float, float], aside: float) -> Camera:
    return Camera.from_fov(SIZE, SIZE, 70, look_at(np.array(eye), np.array([1.9, aside, -0.3])))


def seen_by(cameras: list[Camera]) -> Room:
    return Room(cameras, [seen_from(camera) for camera in cameras])


def photographed(room: Room, light: Callable[[int], torch.Tensor]) -> list[DisplayedPhotograph]:
    """Pictures of the room, exposed to below white and encoded; ``light`` by the number of the view."""
    taken = []
    for n, (camera, drawn) in enumerate(zip(room.cameras, room.drawn, strict=True)):
        shown = srgb_encode_tensor(drawn.features * light(n))
        assert shown.max() < 1
        weight = unlit_weight((drawn.features * light(n)).numpy(), SunFadedSettings())
        taken.append(DisplayedPhotograph(camera, shown, torch.from_numpy(weight)[..., None], lens_of(camera)))
    return taken


def quality(room: Room, views: list[DisplayedPhotograph], values: dict, settings: SunFadedSettings) -> float:
    """PSNR of the views as displayed, dB."""
    errors = []
    for drawn, view in zip(room.drawn, views, strict=True):
        picture = picture_of(drawn, values, view.camera, view.lens, settings).whole
        errors.append(float(((srgb_encode_tensor(picture) - view.shown) ** 2).mean()))
    return -10 * np.log10(np.mean(errors))


def test_a_lamp_of_its_own_kind_is_learnt_on_true_surfaces(room: Room):
    """A network with other numbers, brighter in some directions: what is left is the fit's own fault.

    Also from where no photograph was taken: it is the lamp that was learnt, not the pictures.
    """
    settings = SunFadedSettings(tile=1 / SIZE, iterations=800)
    teacher = lamp_parameters(7) | {
        POSITION: torch.tensor([0.3, -0.1, 0.05]), AMBIENT: torch.tensor([0.02, 0.03, 0.04])
    }  # fmt: skip
    teacher["lamp weights 4"] = teacher["lamp weights 4"] * 6

    def lit_by_it(room: Room) -> list[torch.Tensor]:
        return [
            picture_of(drawn, teacher, camera, lens_of(camera), settings).whole / drawn.features
            for drawn, camera in zip(room.drawn, room.cameras, strict=True)
        ]

    elsewhere = seen_by([camera_at((-0.5, 0.1, 0.0), 0.2), camera_at((-0.9, -0.3, 0.3), -0.2)])
    lit, unseen = lit_by_it(room), lit_by_it(elsewhere)
    brightness = torch.stack([*lit, *unseen]).detach()
    assert brightness.quantile(0.95) > 3 * brightness.quantile(0.05)
    views = photographed(room, lambda n: lit[n] / brightness.max())
    values = fit_lights(room.drawn, views, settings, 0, silent)
    assert quality(room, views, values, settings) > 45
    held_out = photographed(elsewhere, lambda n: unseen[n] / brightness.max())
    assert quality(elsewhere, held_out, values, settings) > 42


def test_the_falloff_and_the_beam_of_a_spot_are_learnt(room: Room):
    """Neither is built in: inverse square and cone are found from pictures, and where the lamp is."""
    settings = SunFadedSettings(tile=1 / SIZE, iterations=800)
    lamp = SpotLight("lamp", (0.3, 0.0, 0.0), (-0.1, 0.0, 1.0), (3.0, 2.5, 2.0), 20.0, 50.0, "camera")

    def light(number: int) -> torch.Tensor:
        camera, known = room.cameras[number], room.surfaces[number]
        rays = camera.rays()
        points = camera.position + rays * (known["depth"] / (rays @ camera.forward))[..., None]
        return torch.from_numpy(light_at([lamp], points, known["normal"], camera) + 0.01).float()

    views = photographed(room, light)
    values = fit_lights(room.drawn, views, settings, 0, silent)
    assert quality(room, views, values, settings) > 50
    assert values[POSITION][0] == pytest.approx(0.3, abs=0.1)


def oracle(scene: Path) -> methods.Priors:
    truth = open_truth(scene / "truth", check=False)
    return methods.Priors("oracle", {view.name: truth.layers(view) for view in truth.views})


def fitted(scene: Path, seed: int = 0, **changes: object) -> OracleSunFadedScene:
    method = methods.load_method("sunfaded-oracle")
    chosen = methods.settings_of(method, QUICK | changes)
    capture = open_capture(scene / "capture", check=False)
    found = method.fit(capture, oracle(scene), chosen, seed, silent)
    assert isinstance(found, OracleSunFadedScene)
    return found


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    return write_tiny(tmp_path_factory.mktemp("oracle"), train=5, test=2)


def test_surfaces_are_true_and_only_light_is_found(tiny: Path):
    found, truth = fitted(tiny), open_truth(tiny / "truth", check=False)
    assert isinstance(methods.load_method("sunfaded-oracle"), methods.Method)
    assert isinstance(found, methods.Decomposition)
    for view in truth.views:
        drawn, true = found.render(view.camera, sorted(found.provides)), truth.layers(view)
        for layer, values in drawn.items():
            assert find_fault(layer, values, view.camera.height, view.camera.width) is None
        seen = np.isfinite(true["depth"])
        np.testing.assert_allclose(drawn["base_color"][seen], true["base_color"][seen], atol=1e-6)
        np.testing.assert_allclose(drawn["normal"][seen], true["normal"][seen], atol=1e-5)
        np.testing.assert_array_equal(drawn["depth"], true["depth"].astype(np.float32))
    again, other = fitted(tiny), fitted(tiny, seed=1)
    for name, values in found.values.items():
        assert torch.equal(values, again.values[name])
    assert not torch.equal(found.values[POSITION], other.values[POSITION])


def test_without_ambient_light_the_lamp_has_all(tiny: Path):
    found = fitted(tiny, ambient=False)
    assert torch.equal(found.values[AMBIENT], torch.zeros(3))


def test_albedo_of_a_fit_in_display_space_is_linear_again(tiny: Path):
    found, truth = fitted(tiny, space="srgb", iterations=3), open_truth(tiny / "truth", check=False)
    view = truth.views[0]
    true = truth.layers(view)
    drawn = found.render(view.camera, ["base_color"])["base_color"]
    seen = np.isfinite(true["depth"])
    np.testing.assert_allclose(drawn[seen], true["base_color"][seen], atol=1e-5)
    assert "shading" not in found.provides


def test_it_is_saved_and_loaded(tiny: Path, tmp_path: Path):
    found, view = fitted(tiny, iterations=3), open_capture(tiny / "capture", check=False).views[0]
    method = methods.load_method("sunfaded-oracle")
    found.save(tmp_path / "saved")
    loaded = method.load(tmp_path / "saved")
    assert loaded.lights() == found.lights()
    for layer, values in found.render(view.camera, sorted(found.provides)).items():
        assert np.array_equal(values, loaded.render(view.camera, [layer])[layer])
    with pytest.raises(MethodError, match="expected a decomposition by 'sunfaded'"):
        methods.load_method("sunfaded").load(tmp_path / "saved")


@pytest.mark.parametrize("what", ["a light is missing", "a buffer is missing", "a buffer of another size"])
def test_what_cannot_be_drawn_is_damaged(tiny: Path, tmp_path: Path, what: str):
    fitted(tiny, iterations=3).save(tmp_path)
    facts, arrays = restore(tmp_path, "sunfaded-oracle")
    buffer = next(name for name in arrays if name.endswith("/normal"))
    if what == "a buffer of another size":
        arrays[buffer] = arrays[buffer][1:]
    else:
        del arrays["lights/lamp biases 1" if what == "a light is missing" else buffer]
    store(tmp_path, "sunfaded-oracle", facts, arrays)
    with pytest.raises(MethodError, match="expected a whole decomposition in"):
        methods.load_method("sunfaded-oracle").load(tmp_path)


def test_what_is_not_known_is_refused(tiny: Path):
    found, capture = fitted(tiny, iterations=3), open_capture(tiny / "capture", check=False)
    moved = look_at(np.array([0.1, 0.2, 1.0]), np.array([1.0, 1.0, 0.5]))
    with pytest.raises(MethodError, match="cameras of the capture"):
        found.render(Camera.from_fov(8, 8, 50, moved), ["depth"])
    with pytest.raises(MethodError, match="expected layers out of"):
        found.render(capture.views[0].camera, ["roughness"])
    method = methods.load_method("sunfaded-oracle")
    with pytest.raises(MethodError, match="expected a prior for layer 'base_color'"):
        method.fit(capture, methods.Priors(), method.settings_type(), 0, silent)
    with pytest.raises(ValueError, match="tile and blur"):
        method.settings_type(tile=0.0)
