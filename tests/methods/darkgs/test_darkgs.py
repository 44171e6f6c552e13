# SPDX-License-Identifier: Apache-2.0
"""``darkgs`` on a tiny scene, behind the contract."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import (
    Capture,
    EnvironmentLight,
    GraycardError,
    Light,
    MethodError,
    RectangleLight,
    methods,
    open_capture,
    open_truth,
)
from graycard.io import silent
from graycard.layers import find_fault
from graycard.methods.darkgs import DarkGsScene, DarkGsSettings
from graycard.methods.darkgs._method import learning_rates, start
from graycard.methods.darkgs._model import AMBIENT, NORMALS, PAINT
from graycard.methods.darkgs._objective import DarkGsObjective, photographs
from graycard.methods.priors import PriorSpec, make_priors
from graycard.methods.splat import LOGITS, Parameters, initial_state
from graycard.methods.splat.fit._optimise import leaves
from sparse_points import with_points

QUICK = {"iterations": 80, "surfels": 400, "fill": 0.0}
"""The sparse points alone: there are many of them here."""


@pytest.fixture
def scene(make_scene: Callable[..., Path]) -> Path:
    return make_scene(train=5, test=2)


def settings(**changes: object) -> DarkGsSettings:
    return methods.settings_of(methods.load_method("darkgs"), QUICK | changes)


def oracle(scene: Path, severity: int = 0) -> methods.Priors:
    lights = open_truth(scene / "truth", check=False).lights()
    capture = open_capture(scene / "capture", check=False)
    asks = methods.asks_of(methods.load_method("darkgs"))
    return make_priors(PriorSpec("oracle", severity), asks, capture, {}, lights)


def fitted(
    scene: Path, priors: methods.Priors | None = None, seed: int = 0, **changes: object
) -> DarkGsScene:
    method = methods.load_method("darkgs")
    found = method.fit(with_points(scene), priors or oracle(scene), settings(**changes), seed, silent)
    assert isinstance(found, DarkGsScene)
    return found


def test_it_follows_the_contract(scene: Path):
    found = fitted(scene)
    assert isinstance(methods.load_method("darkgs"), methods.Method)
    assert isinstance(methods.load_method("darkgs"), methods.Asking)
    assert isinstance(found, methods.Decomposition)
    assert found.lights() == open_truth(scene / "truth", check=False).lights()
    for view in open_capture(scene / "capture", check=False).views:
        layers = found.render(view.camera, sorted(found.provides))
        for layer, values in layers.items():
            assert find_fault(layer, values, view.camera.height, view.camera.width) is None
            assert values.dtype == np.float32
        apart = layers["radiance.lamp"] + layers["radiance.ambient"]
        np.testing.assert_allclose(layers["radiance"], apart, atol=1e-5)
        np.testing.assert_allclose(np.linalg.norm(layers["normal"], axis=-1), 1, atol=1e-5)
    with pytest.raises(MethodError, match="expected layers out of"):
        found.render(open_capture(scene / "capture", check=False).views[0].camera, ["roughness"])


def held_out(scene: Path, found: DarkGsScene, layer: str) -> tuple[np.ndarray, np.ndarray]:
    """Drawn and true values of the held-out pixels that see something."""
    truth = open_truth(scene / "truth", check=False)
    pairs = []
    for view in truth.views:
        if view.split == "test":
            true = truth.layers(view)
            seen = true["object_id"] > 0
            pairs.append((found.render(view.camera, [layer])[layer][seen], true[layer][seen]))
    drawn, true = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    return drawn, true


def test_a_fit_sees_the_scene_and_the_calibration_sets_the_scale_of_albedo(scene: Path):
    """A lamp that is said to be twice as strong makes the albedo half as large: no other gain is fitted."""
    told = oracle(scene)
    lamp = told.light()
    red, green, blue = (2 * np.array(lamp.intensity)).tolist()
    stronger = replace(told, calibration=replace(lamp, intensity=(red, green, blue)))
    once, half = (fitted(scene, priors, iterations=300) for priors in (told, stronger))
    for found in (once, half):
        drawn, true = held_out(scene, found, "radiance")
        assert ((drawn - true) ** 2).mean() < 0.3 * true.var(axis=0).mean()
    ratio = held_out(scene, half, "base_color")[0] / held_out(scene, once, "base_color")[0]
    assert np.median(ratio) == pytest.approx(0.5, abs=0.1)


def test_a_scene_of_its_own_class_is_recovered(scene: Path, monkeypatch: pytest.MonkeyPatch):
    """Oracle proof: photographs that the model drew itself, of random albedos; new views are found too.

    Albedo less well than the picture: a normal of its own may turn, and albedo makes up for the cosine. And
    of the ambient light only the colour: cameras that are all as far away hardly tell it from the lamp.
    """
    capture, told = with_points(scene), oracle(scene)
    own = start(capture, settings(), 0)
    random = torch.Generator().manual_seed(1)
    albedo = 0.1 + 0.6 * torch.rand(own.surfels[PAINT].shape, generator=random)
    surfels = {**own.surfels, PAINT: albedo.expm1().log(), LOGITS: torch.full((len(own),), 3.0)}
    ambient = torch.tensor([0.05, 0.2, 0.4]).log()
    parameters, lamp = Parameters(surfels, {AMBIENT: ambient}), told.light()
    true = DarkGsScene(parameters, lamp, capture.exposure, (lamp,))
    monkeypatch.setattr(
        Capture, "photograph", lambda capture, view: true.render(view.camera, ["radiance"])["radiance"]
    )
    found = fitted(scene, told, iterations=500)
    for view in capture.test:
        drawn, expected = (s.render(view.camera, ["radiance", "base_color"]) for s in (found, true))
        for layer, share in (("radiance", 0.1), ("base_color", 0.5)):
            wrong = np.abs(drawn[layer] - expected[layer]).mean()
            assert wrong < share * np.abs(expected[layer] - expected[layer].mean(axis=(0, 1))).mean(), layer
    red, green, blue = found.parameters.shared[AMBIENT].exp().tolist()
    assert red < green < blue


def test_each_number_gets_a_gradient_in_the_first_step(scene: Path):
    """Normals too, which begin as those of the discs: at zero the cosine would have none."""
    capture, chosen = with_points(scene), settings(geometry_start=0.0)
    views = photographs(capture)
    state = initial_state(start(capture, chosen, 0), 0)
    moving = leaves(state, learning_rates(2.0), 0.0)
    look = DarkGsObjective(views, oracle(scene).light(), capture.exposure, chosen, 0)(moving, 0)
    asked = {name: values for name, values in moving.items() if values.requires_grad}
    assert asked.keys() == state.parameters.all.keys()
    found = torch.autograd.grad(look.loss, list(asked.values()))
    for name, gradient in zip(asked, found, strict=True):
        assert torch.isfinite(gradient).all(), name
        assert gradient.abs().max() > 0, name
    faced = dict(zip(asked, found, strict=True))[NORMALS].abs().amax(dim=1) > 0
    assert faced.float().mean() > 0.5


def test_the_lamp_is_on_its_way_and_then_stays(scene: Path):
    capture, lamp = with_points(scene), oracle(scene).light()
    objective = DarkGsObjective(photographs(capture), lamp, 1.0, settings(iterations=90), 0)
    ways = [objective._lamp_at(step / 90).position[0] / lamp.position[0] for step in (0, 15, 30, 60, 89)]
    assert ways == pytest.approx([0, 0.5, 1, 1, 1])
    at_once = DarkGsObjective(photographs(capture), lamp, 1.0, settings(warm_up=0.0), 0)
    assert at_once._lamp_at(0.0).position == pytest.approx(lamp.position)


def test_surfels_may_be_shaded_by_their_discs(scene: Path):
    found = fitted(scene, normals="discs")
    assert NORMALS not in found.parameters.surfels
    drawn, true = held_out(scene, found, "radiance")
    assert ((drawn - true) ** 2).mean() < true.var(axis=0).mean()


def test_a_fit_is_a_function_of_its_seed(scene: Path):
    first, again, other = (fitted(scene, seed=seed) for seed in (1, 1, 2))
    for name, values in first.parameters.all.items():
        assert torch.equal(values, again.parameters.all[name])
    assert not torch.equal(first.parameters.shared[AMBIENT], other.parameters.shared[AMBIENT])


def test_a_fit_goes_on_where_it_was_cut_off(scene: Path, tmp_path: Path):
    def cut(share: float, message: str) -> None:
        if share >= 0.6:
            raise KeyboardInterrupt

    capture, method = with_points(scene), methods.load_method("darkgs")
    chosen, told = settings(checkpoint=str(tmp_path / "fit")), oracle(scene, 3)
    with pytest.raises(KeyboardInterrupt):
        method.fit(capture, told, chosen, 0, cut)
    resumed = method.fit(capture, told, chosen, 0, silent)
    whole = method.fit(capture, told, replace(chosen, checkpoint=""), 0, silent)
    assert isinstance(resumed, DarkGsScene)
    assert isinstance(whole, DarkGsScene)
    for name, values in whole.parameters.all.items():
        assert torch.equal(values, resumed.parameters.all[name])
    with pytest.raises(MethodError, match="to hold a fit of these photographs"):
        method.fit(capture, oracle(scene, 1), chosen, 0, no_step)  # another calibration


def no_step(share: float, message: str) -> None:
    raise AssertionError("a step was taken")


def test_a_scene_is_saved_and_loaded(scene: Path, tmp_path: Path):
    found, view = fitted(scene, iterations=5), open_capture(scene / "capture", check=False).views[0]
    found.save(tmp_path / "saved")
    loaded = methods.load_method("darkgs").load(tmp_path / "saved")
    assert loaded.lights() == found.lights()
    for layer, values in found.render(view.camera, sorted(found.provides)).items():
        assert np.array_equal(values, loaded.render(view.camera, [layer])[layer])
    assert (tmp_path / "saved" / "surfels.ply").is_file()
    with pytest.raises(MethodError, match="expected a decomposition by 'sunfaded'"):
        methods.load_method("sunfaded").load(tmp_path / "saved")
    ceiling = RectangleLight("ambient", (0, 0, 3), (0, 2.0, 0), (3.0, 0, 0), (0.1, 0.1, 0.1))
    replace(found, lamp=ceiling).save(tmp_path / "odd")  # pyright: ignore[reportArgumentType]
    with pytest.raises(MethodError, match="expected a point or spot light"):
        methods.load_method("darkgs").load(tmp_path / "odd")


def test_a_measured_beam_shines_and_is_saved(scene: Path, tmp_path: Path):
    """It is the told lamp's; one that is put in its place shines as it is told."""
    found, camera = (
        fitted(scene, iterations=300, beam="measured"),
        open_capture(scene / "capture", check=False).test[0].camera,
    )
    drawn, true = held_out(scene, found, "radiance")
    assert ((drawn - true) ** 2).mean() < 0.3 * true.var(axis=0).mean()
    assert found.lights() == open_truth(scene / "truth", check=False).lights()
    found.save(tmp_path / "saved")
    loaded = methods.load_method("darkgs").load(tmp_path / "saved")
    shown = found.render(camera, ["radiance.lamp"])["radiance.lamp"]
    assert np.array_equal(loaded.render(camera, ["radiance.lamp"])["radiance.lamp"], shown)
    told = replace(found, profile=None).render(camera, ["radiance.lamp"])["radiance.lamp"]
    assert 1e-5 < np.abs(told - shown).mean() < 0.03 * shown.mean()
    renamed = found.relight((replace(found.lamp, name="other"),))
    assert renamed is not None
    assert np.array_equal(renamed.render(camera, ["radiance.lamp"])["radiance.lamp"], told)


def test_lamps_and_the_light_that_stays_can_be_exchanged(scene: Path, tmp_path: Path):
    found = fitted(scene, iterations=20)
    assert isinstance(found, methods.Relightable)
    lamp, camera = found.lamp, open_capture(scene / "capture", check=False).test[0].camera
    ceiling = RectangleLight("ambient", (0, 0, 3), (0, 2.0, 0), (3.0, 0, 0), (0.1, 0.1, 0.1))

    def picture(*lights: Light) -> np.ndarray:
        relit = found.relight(lights)
        assert relit is not None
        return relit.render(camera, ["radiance"])["radiance"]

    layers = found.render(camera, ["radiance", "radiance.lamp", "radiance.ambient"])
    assert np.array_equal(picture(lamp, ceiling), layers["radiance"])
    assert np.array_equal(picture(lamp), layers["radiance.lamp"])
    assert np.array_equal(picture(ceiling), layers["radiance.ambient"])
    assert not picture().any()
    red, green, _ = lamp.intensity
    recoloured = replace(lamp, intensity=(2 * red, green, 0.0))
    np.testing.assert_allclose(picture(recoloured), layers["radiance.lamp"] * [2, 1, 0], rtol=1e-5)
    moved = replace(lamp, position=(-0.3, -0.1, 0.0))
    assert np.abs(picture(moved) - layers["radiance.lamp"]).max() > 1e-3
    np.testing.assert_allclose(picture(lamp, moved), picture(lamp) + picture(moved), rtol=1e-5, atol=1e-8)
    assert found.relight((EnvironmentLight("sky", "sky.exr"),)) is None
    assert found.relight((replace(ceiling, frame="camera"),)) is None
    relit = found.relight((moved,))
    assert relit is not None
    relit.save(tmp_path / "relit")
    again = methods.load_method("darkgs").load(tmp_path / "relit")
    assert again.lights() == (moved,)
    assert np.array_equal(again.render(camera, ["radiance"])["radiance"], picture(moved))


@pytest.mark.parametrize("track", ["multilight", "tabletop"])
def test_a_light_that_stays_is_refused(make_scene: Callable[..., Path], track: str):
    other = make_scene(track=track, train=5, test=2)
    with pytest.raises(MethodError, match="light moves with the camera"):
        fitted(other, methods.Priors())


def test_without_a_calibration_it_says_what_it_needs(scene: Path):
    with pytest.raises(MethodError, match="expected a prior that gives light, got one of source 'none'"):
        fitted(scene, methods.Priors("none", layers={"x": {}}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda image: image * 0, "expected light in the photographs"),
        (lambda image: np.where(np.arange(image.size).reshape(image.shape) == 7, np.nan, image), "finite"),
    ],
)
def test_photographs_without_light_or_sense_are_refused(
    scene: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[np.ndarray], np.ndarray], message: str
):
    told, honest = oracle(scene), Capture.photograph
    monkeypatch.setattr(Capture, "photograph", lambda capture, view: change(honest(capture, view)))
    capture = open_capture(scene / "capture", check=False)
    with pytest.raises(MethodError, match=message):
        methods.load_method("darkgs").fit(capture, told, settings(), 0, silent)


def test_one_view_is_refused(make_scene: Callable[..., Path]):
    with pytest.raises(MethodError, match="from different places"):
        fitted(make_scene(train=1, test=1))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"iterations": 0}, "1 or more iterations"),
        ({"surfels": 1}, "2 or more surfels"),
        ({"warm_up": 1.5}, r"warm_up and geometry_start in \[0, 1\]"),
        ({"cover_weight": -1.0}, "weights of 0 or more"),
    ],
)
def test_bad_settings(changes: dict[str, object], message: str):
    with pytest.raises(GraycardError, match=message):
        settings(**changes)
