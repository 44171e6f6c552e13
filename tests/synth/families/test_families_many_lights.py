# SPDX-License-Identifier: Apache-2.0
"""The multilight families: lights, colours and materials are what the knobs say, up to their ends."""

from dataclasses import fields
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from graycard import GaussianLight, LocalLight, PointLight, RectangleLight, SphereLight, SpotLight, luminance
from graycard.synth import (
    Glossy,
    LambertGGX,
    RenderSettings,
    Scene,
    SceneSpec,
    all_families,
    family_of,
)
from graycard.synth.families._gallery import STANDS as GALLERY
from graycard.synth.families._gallery import Gallery
from graycard.synth.families._many_lights import _shares, gaussian_light
from graycard.synth.families._studio import STANDS as STUDIO
from graycard.synth.families._studio import Studio

SETTINGS = RenderSettings(16, 16, 2, 1, 16)
ROOMS = "studio", "gallery"
ALL = *ROOMS, "objects"


@lru_cache(maxsize=8)
def build(name: str, seed: int = 0, **knobs: Any) -> Scene:
    return family_of(SceneSpec("multilight", name, seed, knobs)).build(seed, SETTINGS)


def lamps(name: str, **knobs: Any) -> tuple[LocalLight, ...]:
    """The local lights of a room without the room."""
    room, stands = {"studio": (Studio, STUDIO), "gallery": (Gallery, GALLERY)}[name]
    return room(**knobs).lamps(0, stands)


@pytest.mark.parametrize("name", ROOMS)
@pytest.mark.parametrize("lights", [1, 2, 4, 8])
@pytest.mark.parametrize("emitters", ["mixed", "gaussian"])
def test_there_are_as_many_lights_as_asked_for(name: str, lights: int, emitters: str) -> None:
    found = lamps(name, lights=lights, emitters=emitters)
    assert [x.name for x in found] == [f"lamp-{k + 1}" for k in range(lights)]
    kinds = {type(x) for x in found}
    mixed = (RectangleLight, SphereLight, SpotLight, PointLight)
    assert kinds == ({GaussianLight} if emitters == "gaussian" else set(mixed[:lights]))


@pytest.mark.parametrize("name", ROOMS)
@pytest.mark.parametrize("lights", [1, 8])
def test_lights_of_a_scene_are_named_weighted_and_have_their_surfaces(name: str, lights: int) -> None:
    scene = build(name, lights=lights)
    assert [x.name for x in scene.lights] == [*(f"lamp-{k + 1}" for k in range(lights)), "sky"]
    assert set(scene.light_weights) == {x.name for x in scene.lights}
    surfaces = [t.light for t in scene.things if t.light]
    assert surfaces == (["lamp-1"] if lights == 1 else ["lamp-1", "lamp-2", "lamp-5", "lamp-6"])


@pytest.mark.parametrize("name", ROOMS)
def test_more_lights_leave_the_others_where_they_are(name: str) -> None:
    few, many = (lamps(name, lights=n) for n in (2, 8))
    assert [x.position for x in few] == [x.position for x in many[:2]]


@pytest.mark.parametrize("lights", [1, 2, 8])
@pytest.mark.parametrize("ratio", [1.0, 5.0])
def test_shares_have_the_ratio_and_add_up(lights: int, ratio: float) -> None:
    shares = _shares(lights, ratio, 3)
    assert shares.sum() == pytest.approx(1)
    assert shares.max() / shares.min() == pytest.approx(ratio if lights > 1 else 1)
    assert len({tuple(np.argsort(_shares(8, 5.0, seed))) for seed in range(4)}) == 4


def test_a_gaussian_light_sends_what_it_is_told_along_its_beam() -> None:
    forward, intensity = np.array([1.0, 2.0, -2.0]), np.array([3.0, 2.0, 1.0])
    light = gaussian_light("a", np.zeros(3), forward, intensity, np.random.default_rng(0))
    np.testing.assert_allclose(light.intensity_towards(forward / 3), intensity, rtol=1e-12)
    assert len(light.lobes) == 2


@pytest.mark.parametrize("name", ROOMS)
def test_color_is_the_saturation_of_the_lights(name: str) -> None:
    """White at 0; at any value one luminance, so that a knob of colour is none of brightness."""
    white, half, full = (lamps(name, lights=8, color=c) for c in (0.0, 0.5, 1.0))
    spread = [[np.ptp(x.axial_intensity) / x.axial_intensity.max() for x in s] for s in (white, half, full)]
    assert np.max(spread[0]) == pytest.approx(0, abs=1e-12)
    assert (np.array(spread[1]) < np.array(spread[2])).all()
    assert np.max(spread[2]) > 0.6
    levels = [[luminance(x.axial_intensity) for x in s] for s in (white, half, full)]
    np.testing.assert_allclose(levels[0], levels[2], rtol=1e-3)
    np.testing.assert_allclose(levels[1], levels[2], rtol=1e-3)


@pytest.mark.parametrize("name", ROOMS)
def test_size_changes_extents_and_no_intensity(name: str) -> None:
    small, large = (lamps(name, size=s) for s in (0.5, 2.0))
    for a, b in zip(small, large, strict=True):
        np.testing.assert_allclose(a.axial_intensity, b.axial_intensity)
    assert isinstance(small[0], RectangleLight)
    assert isinstance(large[0], RectangleLight)
    np.testing.assert_allclose(4 * np.array(small[0].half_u), large[0].half_u)
    assert isinstance(small[1], SphereLight)
    assert isinstance(large[1], SphereLight)
    assert 4 * small[1].radius == pytest.approx(large[1].radius)


@pytest.mark.parametrize("name", ROOMS)
def test_brightness_is_the_ratio_of_what_lights_send_to_their_aims(name: str) -> None:
    """Lights of one kind keep their distance, so intensities change as the shares do."""
    even, uneven = (lamps(name, lights=8, brightness=b) for b in (1.0, 9.0))
    pairs = zip(even, uneven, strict=True)
    change = [(luminance(b.axial_intensity)) / (luminance(a.axial_intensity)) for a, b in pairs]
    assert max(change) / min(change) == pytest.approx(9)


@pytest.mark.parametrize("name", ALL)
def test_gloss_and_material_are_those_of_the_knobs(name: str) -> None:
    def shining(kind: type, **knobs: Any) -> int:
        return sum(isinstance(t.material, kind) for t in build(name, 1, **knobs).things)

    assert shining(LambertGGX, gloss=0.0) == 0
    assert 0 < shining(LambertGGX, gloss=0.5) < shining(LambertGGX, gloss=1.0)
    assert shining(Glossy, gloss=1.0) == 0
    assert shining(Glossy, gloss=1.0, material="principled") == shining(LambertGGX, gloss=1.0)
    assert shining(LambertGGX, gloss=1.0, material="principled") == 0


@pytest.mark.parametrize(("name", "metals"), [("studio", 1), ("gallery", 2), ("objects", 1)])
def test_metal_is_as_rough_as_its_knob_says(name: str, metals: int) -> None:
    materials = [t.material for t in build(name, metal_roughness=0.7).things]
    found = [m.roughness for m in materials if isinstance(m, LambertGGX) and m.metallic == 1]
    assert found == [0.7] * metals


@pytest.mark.parametrize("windows", [1, 2, 5])
def test_windows_share_one_light(windows: int) -> None:
    """Whatever their number they are as bright together: the mean of the sky stays, its peak falls."""
    one, some = (build("objects", windows=n).sky for n in (1, windows))
    assert one is not None
    assert some is not None
    assert some.mean() == pytest.approx(one.mean(), rel=0.15)
    assert (luminance(some).max() < 0.7 * luminance(one).max()) == (windows > 1)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("end", [0, -1])
def test_all_knobs_at_their_ends_build(name: str, end: int) -> None:
    knobs = {
        field.name: (field.metadata.get("range") or field.metadata["words"])[end]
        for field in fields(all_families()[name])  # pyright: ignore[reportArgumentType]
    }
    scene = build(name, 1, **knobs)
    assert len({x.name for x in scene.lights}) == len(scene.lights) == knobs.get("lights", 0) + 1


@pytest.mark.parametrize(
    ("name", "knobs"),
    [
        ("studio", {"lights": 8, "brightness": 30.0, "metal_roughness": 0.1, "gloss": 1.0}),
        ("gallery", {"lights": 8, "emitters": "gaussian", "material": "principled", "size": 0.5}),
        ("objects", {"windows": 5, "gloss": 0.0, "daylight": 0.0}),
    ],
)
def test_extremes_render(scalar: str, name: str, knobs: dict[str, Any]) -> None:
    from graycard.synth.layers._views import render_view

    layers = render_view(build(name, 1, **knobs), 1, 1, SETTINGS)
    assert np.isfinite(layers["radiance"]).all()
    assert (layers["radiance"].max() > 0) == (knobs.get("daylight") != 0.0)
