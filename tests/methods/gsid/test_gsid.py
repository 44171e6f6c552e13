# SPDX-License-Identifier: Apache-2.0
"""``gsid`` on a tiny scene, behind the contract."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import Camera, EnvironmentLight, GaussianLight, MethodError, methods, open_capture, open_truth
from graycard.io import silent, write_rgb
from graycard.layers import find_fault
from graycard.methods.gsid import GsidMethod, GsidScene, GsidSettings, GsirMethod, GsirSettings
from graycard.methods.gsid._guess import ASKS
from graycard.methods.priors import PriorSpec, make_priors
from graycard.methods.splat import rasterize, surfels_of
from sparse_points import with_points

QUICK = GsidSettings(iterations=12, surfels=300, fill=0.0, lamps=3, sky_size=4)


@pytest.fixture(scope="module")
def scene(write_tiny: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny(tmp_path_factory.mktemp("gsid"), track="multilight", train=4, test=1)


def oracle(scene: Path) -> methods.Priors:
    """Normals and base colours, of which alone the tiny truth knows."""
    truth = open_truth(scene / "truth", check=False)
    known = {view.name: truth.layers(view) for view in truth.views}
    capture = open_capture(scene / "capture", check=False)
    asks = tuple(ask for ask in ASKS if ask.kind in ("normal", "base_color"))
    return make_priors(PriorSpec("oracle", 1), asks, capture, known)


@pytest.fixture(scope="module")
def fitted(scene: Path) -> GsidScene:
    return GsidMethod().fit(with_points(scene), oracle(scene), QUICK, 0, silent)


def cameras(scene: Path) -> list[Camera]:
    return [view.camera for view in open_capture(scene / "capture", check=False).views]


def test_it_follows_the_contract(scene: Path, fitted: GsidScene):
    assert isinstance(GsidMethod(), methods.Method)
    assert isinstance(fitted, methods.Decomposition)
    for camera in cameras(scene):
        layers = fitted.render(camera, sorted(fitted.provides))
        for layer, values in layers.items():
            assert find_fault(layer, values, camera.height, camera.width) is None, layer
            assert values.dtype == np.float32
    with pytest.raises(MethodError, match="expected layers out of"):
        fitted.render(cameras(scene)[0], ["shading"])


def test_its_lights_add_up_to_its_picture(scene: Path, fitted: GsidScene):
    layers = fitted.render(cameras(scene)[0], sorted(fitted.provides))
    lights = [values for name, values in layers.items() if name.startswith("radiance.")]
    assert len(lights) > 1
    np.testing.assert_allclose(sum(lights), layers["radiance"], atol=1e-4)


def test_its_lights_are_in_true_units(scene: Path, fitted: GsidScene):
    """Twice the exposure of the same numbers is half the light."""
    brighter = GsidScene(fitted.parameters, fitted.settings, fitted.exposure * 2, fitted.extent)
    one, half = fitted.lights()[0], brighter.lights()[0]
    assert isinstance(one, GaussianLight)
    assert isinstance(half, GaussianLight)
    np.testing.assert_allclose(one.axial_intensity, 2 * half.axial_intensity, rtol=1e-5)
    assert one.position == half.position
    sky = fitted.lights()[-1]
    assert isinstance(sky, EnvironmentLight)
    assert fitted.environment(sky).shape == (64, 128, 3)
    np.testing.assert_allclose(fitted.environment(sky), 2 * brighter.environment(sky), rtol=1e-5)


def test_saved_and_loaded_it_is_the_same(scene: Path, fitted: GsidScene, tmp_path: Path):
    fitted.save(tmp_path / "d")
    loaded = GsidMethod().load(tmp_path / "d")
    camera, names = cameras(scene)[-1], sorted(fitted.provides)
    assert loaded.provides == fitted.provides
    for name, values in fitted.render(camera, names).items():
        np.testing.assert_array_equal(loaded.render(camera, names)[name], values)


def test_the_same_seed_gives_the_same_bits(scene: Path, fitted: GsidScene):
    again = GsidMethod().fit(with_points(scene), oracle(scene), QUICK, 0, silent)
    other = GsidMethod().fit(with_points(scene), oracle(scene), QUICK, 1, silent)
    for name, values in fitted.parameters.all.items():
        np.testing.assert_array_equal(values, again.parameters.all[name])
    assert not all(torch.equal(fitted.parameters.shared[n], v) for n, v in other.parameters.shared.items())


def test_it_fits_without_a_prior(scene: Path):
    found = GsidMethod().fit(with_points(scene), methods.Priors(), QUICK, 0, silent)
    assert found.render(cameras(scene)[0], ["roughness"])["roughness"].mean() == pytest.approx(0.6, abs=0.1)


def test_an_environment_alone_is_fitted_and_saved(scene: Path, tmp_path: Path):
    """``gsir`` is asked nothing of a prior, and has no lamps."""
    method = GsirMethod()
    assert methods.asks_of(method) == ()
    chosen = GsirSettings(iterations=12, surfels=300, fill=0.0, sky_size=4)
    found = method.fit(with_points(scene), methods.Priors(), chosen, 0, silent)
    assert [light.name for light in found.lights()] == ["sky"]
    camera = cameras(scene)[0]
    layers = found.render(camera, sorted(found.provides))
    np.testing.assert_allclose(layers["radiance.sky"], layers["radiance"], atol=1e-6)
    found.save(tmp_path / "d")
    loaded = method.load(tmp_path / "d")
    assert loaded.settings == chosen
    np.testing.assert_array_equal(loaded.render(camera, ["radiance"])["radiance"], layers["radiance"])
    with pytest.raises(MethodError, match="expected a decomposition by 'gsid' .* got one by 'gsir'"):
        GsidMethod().load(tmp_path / "d")


def test_surfels_may_be_shaded_instead_of_pixels(scene: Path):
    """Both are fitted; light is found as often as there are surfels, or covered pixels."""
    camera = cameras(scene)[0]
    for shading in ("deferred", "forward"):
        chosen = replace(QUICK, shading=shading)
        found = GsidMethod().fit(with_points(scene), oracle(scene), chosen, 0, silent)
        layers = found.render(camera, sorted(found.provides))
        lights = [values for name, values in layers.items() if name.startswith("radiance.")]
        np.testing.assert_allclose(sum(lights), layers["radiance"], atol=1e-4)
        counted = found.counts(camera)["light evaluations"]
        covered = int((rasterize(surfels_of(found.parameters.surfels), camera).alpha > 0).sum())
        assert counted == (len(found.parameters) if shading == "forward" else covered)


def test_surfels_may_be_shaded_under_surroundings_alone(scene: Path):
    chosen = replace(QUICK, shading="forward", lamps=0)
    found = GsidMethod().fit(with_points(scene), oracle(scene), chosen, 0, silent)
    assert [light.name for light in found.lights()] == ["sky"]
    assert found.render(cameras(scene)[0], ["radiance"])["radiance"].mean() > 0


def test_materials_of_a_prior_that_knows_none_cannot_be_kept(scene: Path):
    def no_step(share: float, message: str) -> None:
        raise AssertionError("a step was taken")

    kept = replace(QUICK, materials="prior")
    with pytest.raises(MethodError, match="a prior that tells roughness, metallic"):
        GsidMethod().fit(with_points(scene), oracle(scene), kept, 0, no_step)


def test_black_photographs_are_refused(scene: Path, tmp_path: Path, write_tiny: Callable[..., Path]):
    folder = write_tiny(tmp_path, track="multilight", train=3, test=1)
    for view in open_capture(folder / "capture", check=False).train:
        camera = view.camera
        dark = np.zeros((camera.height, camera.width, 3), np.float32)
        write_rgb(folder / "capture" / "photographs" / f"{view.name}.exr", dark)
    with pytest.raises(MethodError, match="expected light in the photographs"):
        GsidMethod().fit(open_capture(folder / "capture", check=False), methods.Priors(), QUICK, 0, silent)
