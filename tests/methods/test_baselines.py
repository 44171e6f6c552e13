# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from graycard import (
    Camera,
    GraycardError,
    MethodError,
    look_at,
    methods,
    open_capture,
    open_predictions,
    open_truth,
)
from graycard.benchmarks._fit import FitSpec, fit_scene
from graycard.dataset import manifest_of
from graycard.io import silent, write_layers, write_manifest
from graycard.layers import LOBES, PARTS, find_fault, with_derived
from graycard.methods._retinex import RetinexSettings, integrate_steps, split
from graycard.methods._store import store, whole_decomposition

NAMES = ("truth", "gray", "input", "retinex")


def oracle(scene: Path) -> methods.Priors:
    truth = open_truth(scene / "truth")
    return methods.Priors("oracle", {v.name: truth.layers(v) for v in truth.views}, truth.lights())


def fit(name: str, scene: Path, **settings: float) -> methods.Decomposition:
    method = methods.load_method(name)
    capture = open_capture(scene / "capture")
    return method.fit(capture, oracle(scene), methods.settings_of(method, settings), 0, silent)


@pytest.mark.parametrize("name", NAMES)
def test_each_follows_the_contract(name: str, tiny_scenes: dict[str, Path]):
    scene = tiny_scenes["dark"]
    decomposition = fit(name, scene)
    assert isinstance(methods.load_method(name), methods.Method)
    assert isinstance(decomposition, methods.Decomposition)
    views = open_capture(scene / "capture").views
    for view in views:
        layers = decomposition.render(view.camera, sorted(decomposition.provides))
        assert layers.keys() == decomposition.provides
        for layer, values in layers.items():
            assert find_fault(layer, values, view.camera.height, view.camera.width) is None
    with pytest.raises(MethodError, match="expected layers out of"):
        decomposition.render(views[0].camera, ["roughness"])


@pytest.mark.parametrize("name", NAMES)
def test_what_is_saved_renders_the_same(name: str, tiny_scenes: dict[str, Path], tmp_path: Path):
    scene = tiny_scenes["tabletop"]
    decomposition = fit(name, scene)
    decomposition.save(tmp_path)
    back = methods.load_method(name).load(tmp_path)
    assert back.provides == decomposition.provides
    assert back.lights() == decomposition.lights()
    views = open_capture(scene / "capture").views
    for view in views:
        for layer in decomposition.provides:
            expected = decomposition.render(view.camera, [layer])[layer]
            assert np.array_equal(back.render(view.camera, [layer])[layer], expected)
    if isinstance(decomposition, methods.Removable):
        assert isinstance(back, methods.Removable)
        assert np.array_equal(
            back.remove(3).render(views[0].camera, ["radiance"])["radiance"],
            decomposition.remove(3).render(views[0].camera, ["radiance"])["radiance"],
        )


@pytest.mark.parametrize("name", NAMES)
def test_another_methods_save_is_refused(name: str, tiny_scenes: dict[str, Path], tmp_path: Path):
    other = "gray" if name != "gray" else "input"
    fit(other, tiny_scenes["dark"]).save(tmp_path)
    message = f"expected a decomposition by '{name}' in .*, got one by '{other}'"
    with pytest.raises(MethodError, match=message):
        methods.load_method(name).load(tmp_path)


def test_a_damaged_save(tiny_scenes: dict[str, Path], tmp_path: Path):
    fit("gray", tiny_scenes["dark"]).save(tmp_path)
    (tmp_path / "arrays.safetensors").write_bytes(b"\x08")
    with pytest.raises(MethodError, match="expected a whole decomposition in .*, got a damaged one"):
        methods.load_method("gray").load(tmp_path)
    with pytest.raises(MethodError, match="expected a JSON file"):
        methods.load_method("gray").load(tmp_path / "nowhere")


class KernelError(Exception):
    """An error that is none of Python's kinds, as Numba's about arrays of other dimensions."""


@pytest.mark.parametrize("shape", [(), (1,), (2,), (4,), (3, 1), (1, 3)])
def test_a_radiance_of_another_shape_is_a_damaged_save(
    shape: tuple[int, ...], tiny_scenes: dict[str, Path], tmp_path: Path
):
    fit("gray", tiny_scenes["dark"]).save(tmp_path)
    store(tmp_path, "gray", {"reflectance": 0.2}, {"radiance": np.zeros(shape)})
    with pytest.raises(MethodError, match=r"got a damaged one: expected a radiance of shape \(3,\)"):
        methods.load_method("gray").load(tmp_path)


@pytest.mark.parametrize(
    "error", [KernelError("no such types\nmany lines more"), SystemError("no such types")]
)
def test_any_error_of_a_stranger_s_arrays_is_damage(error: Exception, tmp_path: Path):
    with (
        pytest.raises(MethodError, match=r"got a damaged one: no such types$"),
        whole_decomposition(tmp_path),
    ):
        raise error


def test_words_about_a_decomposition_stay_as_they_are(tmp_path: Path):
    with pytest.raises(MethodError, match="^expected another method$"), whole_decomposition(tmp_path):
        raise MethodError("expected another method")


def test_truth_removes_its_target_and_nothing_else(tiny_scenes: dict[str, Path]):
    scene = tiny_scenes["tabletop"]
    truth, decomposition = open_truth(scene / "truth"), fit("truth", scene)
    assert isinstance(decomposition, methods.Removable)
    view = truth.view("test_001")
    clean = decomposition.remove(3).render(view.camera, ["radiance"])["radiance"]
    assert np.array_equal(clean, truth.layers(view)["counterfactual.radiance"])
    with pytest.raises(MethodError, match=r"expected the target of the scene \(3\), got object 1"):
        decomposition.remove(1)
    assert "counterfactual.radiance" not in decomposition.provides


def test_truth_needs_the_truth(tiny_scenes: dict[str, Path]):
    capture = open_capture(tiny_scenes["dark"] / "capture")
    for name, message in (
        ("truth", "as an oracle prior, got source 'none'"),
        ("input", "prior for layer 'radiance'"),
    ):
        method = methods.load_method(name)
        with pytest.raises(MethodError, match=message):
            method.fit(capture, methods.Priors(), methods.settings_of(method, {}), 0, silent)


def test_single_image_methods_know_no_views_in_between(tiny_scenes: dict[str, Path]):
    elsewhere = Camera.from_fov(8, 8, 50, look_at(np.array([9, 9, 9]), np.zeros(3)))
    with pytest.raises(MethodError, match="knows no views in between"):
        fit("input", tiny_scenes["dark"]).render(elsewhere, ["base_color"])


def test_gray_is_gray_and_faces_any_camera(tiny_scenes: dict[str, Path]):
    camera = Camera.from_fov(9, 7, 50, look_at(np.array([9, 9, 9]), np.zeros(3)))
    layers = fit("gray", tiny_scenes["dark"], reflectance=0.3).render(camera, ["base_color", "normal"])
    assert np.all(layers["base_color"] == np.float32(0.3))
    assert np.allclose((layers["normal"] * camera.rays()).sum(-1), -1, atol=1e-6)


def test_input_is_the_exposed_photograph(tiny_scenes: dict[str, Path]):
    capture = open_capture(tiny_scenes["dark"] / "capture")
    view = capture.train[1]
    albedo = fit("input", tiny_scenes["dark"]).render(view.camera, ["base_color"])["base_color"]
    assert np.allclose(albedo, capture.photograph(view) * capture.exposure)


def test_input_takes_no_light_apart(tiny_scenes: dict[str, Path]):
    capture = open_capture(tiny_scenes["dark"] / "capture")
    view = capture.train[1]
    lobes = fit("input", tiny_scenes["dark"]).render(view.camera, LOBES)
    assert np.array_equal(lobes["diffuse"], capture.photograph(view))
    assert not lobes["specular"].any()


def test_gray_knows_of_no_lobes(tiny_scenes: dict[str, Path]):
    assert fit("gray", tiny_scenes["dark"]).provides.isdisjoint({*LOBES, "f0", "glossy"})


def test_truth_knows_what_its_views_know(make_scene: Callable[..., Path], tmp_path: Path):
    scene = make_scene()
    truth = open_truth(scene / "truth")
    more = {"f0": np.full((24, 28, 3), 0.04), "roughness": np.full((24, 28), 0.3)}
    for view in truth.views:
        layers = truth.layers(view)
        parts = {f"{part}.lamp": layers["radiance"] / 4 for part in PARTS}
        write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers | more | parts)
    write_manifest(scene / "truth", manifest_of(truth))
    fit_scene(FitSpec("truth", {}, 0, scene), tmp_path / "p", silent)
    found = open_predictions(tmp_path / "p").layers("test_001")
    true = with_derived(truth.layers(truth.view("test_001")))
    for name in ("f0", "glossy", *LOBES):
        assert np.array_equal(found[name], true[name]), name
    assert 0 < found["glossy"].mean() < 1


def test_steps_integrate_back_to_the_image():
    """Without any step set to 0 the reconstruction is exact, up to the mean."""
    image = np.random.default_rng(0).normal(size=(13, 17, 3))
    back = integrate_steps(np.diff(image, axis=1), np.diff(image, axis=0))
    assert np.allclose(back, image - image.mean(axis=(0, 1)), atol=1e-10)


def test_retinex_takes_smooth_light_out_of_flat_paint():
    """Two paints under light that falls off smoothly: the light goes, the edge between them stays."""
    paint = np.full((40, 40, 3), 0.2)
    paint[:, 20:] = [0.5, 0.4, 0.1]
    light = np.exp(-np.linspace(0, 2, 40))[:, None, None]
    albedo = split(paint * light, RetinexSettings())
    ratio = albedo / paint
    assert np.ptp(ratio, axis=(0, 1)).max() < 1e-9
    assert np.exp(np.log(albedo).mean()) == pytest.approx(0.18)


def test_retinex_keeps_hard_edges_whatever_makes_them():
    """Its known failure: a hard shadow edge looks like paint."""
    image = np.full((20, 20, 3), 0.4)
    image[:, 10:] = 0.04
    albedo = split(image, RetinexSettings())
    assert albedo[0, 0, 0] / albedo[0, -1, 0] == pytest.approx(10)


@pytest.mark.parametrize(
    ("method", "settings", "message"),
    [
        ("gray", {"reflectance": 0.0}, r"expected a reflectance in \(0, 1\], got 0.0"),
        ("retinex", {"colour_step": -1.0}, "expected steps >= 0"),
        ("retinex", {"mean_albedo": 2.0}, "expected a mean albedo"),
        ("gray", {"reflectence": 0.2}, "did you mean 'reflectance'"),
        ("gray", {"reflectance": "bright"}, "expected a number, got 'bright'"),
    ],
)
def test_bad_settings(method: str, settings: dict[str, object], message: str):
    with pytest.raises(GraycardError, match=message):
        methods.settings_of(methods.load_method(method), settings)


def test_predictions_hold_every_view_and_the_removal(make_scene: Callable[..., Path], tmp_path: Path):
    scene = make_scene(track="tabletop")
    capture = open_capture(scene / "capture")
    methods.write_predictions(fit("truth", scene), capture, "truth", tmp_path / "p", silent)
    found = open_predictions(tmp_path / "p")
    assert found.view_names() == sorted(v.name for v in capture.views)
    assert "counterfactual.radiance" in found.layers("test_001")
    assert found.lights() == open_truth(scene / "truth").lights()
    methods.write_predictions(fit("gray", scene), capture, "gray", tmp_path / "q", silent)
    assert open_predictions(tmp_path / "q").layers("test_001").keys() == {
        "base_color",
        "normal",
        "radiance",
    }
    assert open_predictions(tmp_path / "q").lights() is None
