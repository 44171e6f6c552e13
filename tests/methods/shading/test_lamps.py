# SPDX-License-Identifier: Apache-2.0
"""Lamps of spherical Gaussians: against the vocabulary's lights, and against the renderer."""

import numpy as np
import pytest
import torch

from graycard import Camera, GaussianLight, PointLight, SphericalGaussian, View, look_at
from graycard.methods.shading import Lamps, Material, arriving, lamps_of, lights_of, lit_by_lamps
from graycard.synth import Ball, LambertGGX, Quad, Scene, Thing

DOWN = SphericalGaussian((0.0, 0.0, -1.0), 6.0, (7.0, 6.0, 5.0))
ASIDE = SphericalGaussian((0.6, 0.0, -0.8), 25.0, (0.5, 2.0, 8.0))
TWO = GaussianLight("two", (0.4, -0.3, 1.7), (DOWN, ASIDE))
ONE = GaussianLight("one", (-0.8, -0.9, 1.2), (SphericalGaussian((0.6, 0.0, -0.8), 2.0, (3.0, 4.0, 2.0)),))
POINT = PointLight("point", (0.2, -1.0, 0.9), (0.5, 0.7, 1.0))
POINTS = np.random.default_rng(0).uniform(-1, 1, (40, 3))


def double(lights: list[GaussianLight | PointLight]) -> Lamps:
    return lamps_of(lights, torch.float64)


def test_they_send_what_the_lights_send() -> None:
    found = arriving(double([TWO, ONE, POINT]), torch.from_numpy(POINTS))
    for number, light in enumerate((TWO, ONE, POINT)):
        away = POINTS - light.position
        distance = np.linalg.norm(away, axis=-1, keepdims=True)
        sent = (
            light.intensity_towards(away / distance) if isinstance(light, GaussianLight) else light.intensity
        )
        np.testing.assert_allclose(found.facing[:, number], sent / distance**2, rtol=1e-12)
        np.testing.assert_allclose(found.toward[:, number], -away / distance, atol=1e-14)
        np.testing.assert_allclose(found.distance[:, number], distance[:, 0])


@pytest.mark.parametrize("sharpness", [0.0, 5e-4, 0.5, 8.0, 60.0])
def test_their_flux_is_what_they_send_all_round(sharpness: float) -> None:
    lamp = double(
        [GaussianLight("a", (0, 0, 0), (SphericalGaussian((0.0, 0.6, 0.8), sharpness, (3, 2, 1)),))]
    )
    height, weights = np.polynomial.legendre.leggauss(160)
    azimuth = 2 * np.pi * np.arange(160) / 160
    across = np.sqrt(1 - height**2)[:, None]
    parts = across * np.cos(azimuth), across * np.sin(azimuth), height[:, None] + 0 * azimuth
    sent = lamp.intensity(torch.from_numpy(np.stack(parts, axis=-1))[..., None, :])[:, :, 0]
    expected = (sent.mean(dim=1) * torch.from_numpy(weights)[:, None]).sum(dim=0) * 2 * np.pi
    torch.testing.assert_close(lamp.flux()[0], expected, rtol=1e-6, atol=0)


def test_axes_of_any_length() -> None:
    lamps = double([TWO])
    longer = Lamps(lamps.positions, lamps.axes * 7, lamps.sharpness, lamps.amplitudes)
    at = torch.from_numpy(POINTS)
    torch.testing.assert_close(arriving(longer, at).facing, arriving(lamps, at).facing)


def test_softened_they_stay_finite_where_they_are() -> None:
    lamps = double([POINT])
    here = torch.tensor([POINT.position], dtype=torch.float64)
    assert arriving(lamps, here).facing.isfinite().all()
    near = arriving(lamps, here + torch.tensor([0.1, 0.0, 0.0]), soften=0.1).facing[0, 0]
    torch.testing.assert_close(
        near, torch.tensor(POINT.intensity, dtype=torch.float64) / 0.02, rtol=1e-6, atol=0
    )


def test_each_reflects_by_itself() -> None:
    """Each of many lamps reflects as it does alone."""
    at, rng = torch.from_numpy(POINTS), np.random.default_rng(1)
    normal, eye = (
        torch.nn.functional.normalize(torch.from_numpy(rng.normal(size=(40, 3))), dim=-1) for _ in range(2)
    )
    some = Material(*(torch.from_numpy(rng.uniform(0.2, 1, shape)) for shape in ((40, 3), (40,), (40,))))
    all_of_them = lit_by_lamps(some, normal, eye, arriving(double([TWO, ONE]), at))
    for number, light in enumerate((TWO, ONE)):
        alone = lit_by_lamps(some, normal, eye, arriving(double([light]), at))
        torch.testing.assert_close(all_of_them.whole[:, number], alone.whole[:, 0])
        assert (alone.specular > 0).any()


@pytest.mark.parametrize(("roughness", "metallic"), [(0.35, 0.0), (0.5, 1.0), (0.8, 0.3)])
def test_on_true_surfaces_they_give_the_renderers_direct_light(
    llvm: str, roughness: float, metallic: float
) -> None:
    """A ball on a floor, light by light, wherever the light is not blocked: to far less than 1 %."""
    from graycard.synth.layers._direct_light import direct_light
    from graycard.synth.layers._views import _image, surface_layers
    from graycard.synth.renderer._mitsuba import centre_sensor, load, load_scene

    shiny = LambertGGX((0.6, 0.4, 0.2), roughness, metallic)
    things = (
        Thing("floor", Quad((0, 0, 0), (2, 0, 0), (0, 2, 0)), shiny),
        Thing("ball", Ball((0, 0, 0.5), 0.5), shiny),
    )
    camera = Camera.from_fov(32, 28, 50.0, look_at(np.array([1.2, -2.0, 1.6]), np.array([0.0, 0.0, 0.4])))
    for light in (TWO, ONE, POINT):
        scene = Scene(things, (light,), (View("train_000", "train", camera),))
        loaded = load_scene(scene, camera)
        path = load({"type": "path", "max_depth": 2})
        expected = _image(loaded, centre_sensor(camera), path, spp=1)
        layers = surface_layers(loaded, scene, camera)
        lit = (direct_light(loaded, camera, [1], 4).visibility()[0] > 0.5) & (layers["object_id"] > 0)
        found = shaded(layers, light, camera)
        assert lit.mean() > 0.3
        off = np.abs(found[lit] / expected[lit] - 1)
        assert np.median(off) < 1e-4
        assert off.max() < 0.01


def shaded(layers: dict[str, np.ndarray], light: GaussianLight | PointLight, camera: Camera) -> np.ndarray:
    parts = {name: torch.from_numpy(values.astype(np.float64)) for name, values in layers.items()}
    some = Material(parts["base_color"], parts["roughness"], parts["metallic"])
    eye = torch.from_numpy(-camera.rays())
    arrival = arriving(double([light]), parts["position"])
    return lit_by_lamps(some, parts["normal"], eye, arrival).whole[..., 0, :].numpy()


def test_gradients() -> None:
    lamps = double([TWO, ONE])
    inputs = [x.requires_grad_() for x in (lamps.positions, lamps.axes, lamps.sharpness, lamps.amplitudes)]
    at = torch.from_numpy(POINTS[:3]).requires_grad_()

    def value(points: torch.Tensor, *parts: torch.Tensor) -> torch.Tensor:
        return arriving(Lamps(*parts), points, 0.05).facing

    assert torch.autograd.gradcheck(value, (at, *inputs))


def test_a_lamp_that_is_everywhere_alike_can_learn_to_be_a_beam() -> None:
    """At the sharpness 0 there is a slope, of the flux too."""
    lamps = double([POINT])
    sharpness = lamps.sharpness.clone().requires_grad_()
    beam = Lamps(lamps.positions, lamps.axes, sharpness, lamps.amplitudes)
    slope = torch.autograd.grad(beam.flux().sum(), sharpness, retain_graph=True)[0]
    assert float(slope) == pytest.approx(-4 * np.pi * sum(POINT.intensity), rel=1e-6)


def test_there_and_back() -> None:
    back = lights_of(double([TWO, POINT]), ["two", "point"])
    at = np.array([[0.0, 0.6, -0.8], [0.6, 0.0, -0.8]])
    np.testing.assert_allclose(back[0].intensity_towards(at), TWO.intensity_towards(at), rtol=1e-12)
    np.testing.assert_allclose(back[1].intensity_towards(at), [POINT.intensity] * 2, rtol=1e-12)
    assert (back[0].name, back[0].position, back[1].position) == ("two", TWO.position, POINT.position)


def test_single_precision_gives_lights_of_the_vocabulary() -> None:
    """Its axes must be of unit length to 1e-5."""
    lamps = lamps_of([TWO])
    lights_of(Lamps(lamps.positions, lamps.axes * 31.7, lamps.sharpness, lamps.amplitudes), ["a"])


def test_some_of_them() -> None:
    lamps = double([TWO, ONE, POINT])
    some = lamps[torch.tensor([True, False, True])]
    assert len(some) == 2
    torch.testing.assert_close(some.positions[1], lamps.positions[2])


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="expected one light or more"):
        lamps_of([])
    with pytest.raises(ValueError, match="expected 1 names, got 2"):
        lights_of(double([TWO]), ["a", "b"])
    lamps = double([TWO])
    with pytest.raises(ValueError, match=r"expected positions \(K, 3\)"):
        Lamps(lamps.positions[:, :2], lamps.axes, lamps.sharpness, lamps.amplitudes)
