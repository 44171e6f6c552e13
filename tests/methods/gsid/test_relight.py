# SPDX-License-Identifier: Apache-2.0
"""Surfels with materials under lights that are handed in, and under their own, edited."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import (
    Camera,
    DatasetError,
    EnvironmentLight,
    GaussianLight,
    PointLight,
    RectangleLight,
    SpotLight,
    look_at,
    methods,
)
from graycard.io import silent, write_rgb
from graycard.methods.gsid import GsidMethod, GsidScene, GsidSettings
from graycard.methods.gsid._candidates import FirstLights
from graycard.methods.gsid._lights import POSITIONS, first_lights
from graycard.methods.gsid._settings import Shading, Visibility
from graycard.methods.splat import Parameters
from lit_sheets import EXTENT, World
from sparse_points import with_points

CAMERA = Camera.from_fov(20, 16, 50, look_at(np.array([1.5, -2.6, 1.6]), np.array([0.0, 0.0, 0.4])))
QUICK = GsidSettings(iterations=8, surfels=300, fill=0.0, lamps=2, sky_size=4)


@pytest.fixture(scope="module")
def found(write_tiny: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> GsidScene:
    scene = write_tiny(tmp_path_factory.mktemp("gsid"), track="multilight", train=4, test=1)
    return GsidMethod().fit(with_points(scene), methods.Priors(), QUICK, 0, silent)


def seen(scene: GsidScene, layer: str = "radiance") -> np.ndarray:
    return scene.render(CAMERA, [layer])[layer]


def lamps_of(scene: GsidScene) -> list[GaussianLight]:
    lamps = [light for light in scene.lights() if isinstance(light, GaussianLight)]
    assert lamps
    return lamps


def close(one: np.ndarray, other: np.ndarray) -> None:
    np.testing.assert_allclose(one, other, atol=1e-4 * other.max())


def test_it_can_be_relit(found: GsidScene):
    assert isinstance(found, methods.Relightable)
    relit = found.relight(found.lights())
    assert isinstance(relit, methods.Decomposition)
    assert relit.provides == {"radiance", "base_color", "roughness", "metallic", "normal", "depth"}
    close(seen(relit), seen(found))


def test_a_lamp_is_switched_off(found: GsidScene):
    first, *others = found.lights()
    close(seen(found.relight(tuple(others))), seen(found) - seen(found, f"radiance.{first.name}"))
    (sky,) = (light for light in others if isinstance(light, EnvironmentLight))
    close(seen(found.relight((first,))), seen(found, f"radiance.{first.name}"))
    close(seen(found.relight((sky,))), seen(found, "radiance.sky"))
    assert not seen(found.relight(())).any()


def test_a_lamp_gets_another_colour(found: GsidScene):
    lamp = lamps_of(found)[0]
    lobes = tuple(replace(lobe, amplitude=(2 * lobe.amplitude[0], 0.0, 0.0)) for lobe in lamp.lobes)
    red = seen(found.relight((replace(lamp, lobes=lobes),)))
    own = seen(found, f"radiance.{lamp.name}")
    close(red, own * [2, 0, 0])


def test_a_lamp_is_moved_with_its_shadow(found: GsidScene):
    """The lamp acts as if it had been found there, with the shadows that rays find."""
    lamp = lamps_of(found)[0]
    shared = {name: values.clone() for name, values in found.parameters.shared.items()}
    shared[POSITIONS][0, 0] += 1
    traced = replace(found.settings, visibility="traced")
    there = replace(found, parameters=replace(found.parameters, shared=shared), settings=traced)
    x, y, z = lamp.position
    moved = found.relight((replace(lamp, position=(x + 1, y, z)),))
    close(seen(moved), seen(there, f"radiance.{lamp.name}"))
    assert np.abs(seen(moved) - seen(found, f"radiance.{lamp.name}")).max() > 0.01 * seen(moved).max()


@pytest.mark.parametrize("visibility", ["none", "vector"])
@pytest.mark.parametrize("shading", ["deferred", "forward"])
def test_given_lamps_cast_shadows_whatever_was_known_of_the_old_ones(
    world: World, visibility: Visibility, shading: Shading
):
    """Here a board stands in the way, and a panel is sixteen points."""
    panel = RectangleLight("p", (0.1, 0.1, 1.5), (0.2, 0, 0), (0, -0.2, 0), (3.0, 2.0, 1.0))
    pictures = []
    for form in (visibility, "traced"):
        chosen = GsidSettings(visibility=form, shading=shading, bounces=False, sky_size=4)
        dark = FirstLights(torch.zeros(0, 3), torch.zeros(0, 2, 3), torch.zeros(3), torch.zeros(6, 3))
        parameters = Parameters(world.surface, first_lights(dark, chosen))
        relit = GsidScene(parameters, chosen, 1.0, EXTENT).relight((panel,))
        pictures.append(relit.render(world.shots[0].ground.camera, ["radiance"])["radiance"])
    np.testing.assert_array_equal(*pictures)
    assert pictures[0].max() > 0


def test_other_surroundings_come_from_their_file(found: GsidScene, tmp_path: Path):
    image = np.ones((8, 16, 3), np.float32) * np.array([1.0, 2.0, 0.0], np.float32)
    for name, factor in (("one", 1), ("two", 2)):
        write_rgb(tmp_path / f"{name}.exr", factor * image)
    one, two = (found.relight((EnvironmentLight("e", str(tmp_path / f"{n}.exr")),)) for n in ("one", "two"))
    close(seen(two), 2 * seen(one))
    np.testing.assert_array_equal(seen(one)[..., 2], 0)
    sky = one.lights()[-1]
    assert isinstance(sky, EnvironmentLight)
    np.testing.assert_allclose(one.environment(sky), np.broadcast_to([1, 2, 0], (64, 128, 3)), rtol=1e-5)
    with pytest.raises(DatasetError, match=r"three\.exr"):
        found.relight((EnvironmentLight("e", str(tmp_path / "three.exr")),))


def test_a_small_panel_is_a_point_of_its_strength_and_a_light_on_the_camera_goes_with_it(found: GsidScene):
    x, y, z = (float(v) for v in CAMERA.position)
    panel = RectangleLight("p", (x, y, z), (1e-3, 0.0, 0.0), (0.0, 1e-3, 0.0), (1e6, 1e6, 1e6))
    assert panel.axial_intensity == pytest.approx([4.0, 4.0, 4.0])
    down = SpotLight("s", (x, y, z), (0.0, 0.0, 1.0), (4.0, 4.0, 4.0), 90.0, 90.0)
    lit = seen(found.relight((panel,))).sum()
    facing = float(np.cross(panel.half_u, panel.half_v)[2])
    assert facing > 0  # it shines up, where nothing is
    assert lit < 0.05 * seen(found.relight((replace(panel, half_u=panel.half_v, half_v=panel.half_u),))).sum()
    world = seen(found.relight((PointLight("w", (x, y, z), (4.0, 4.0, 4.0)),)))
    mounted = seen(found.relight((PointLight("c", (0.0, 0.0, 0.0), (4.0, 4.0, 4.0), "camera"),)))
    close(mounted, world)
    assert seen(found.relight((down,))).sum() < world.sum()


def test_relit_and_saved_it_is_the_same(found: GsidScene, tmp_path: Path):
    lamp = lamps_of(found)[0]
    write_rgb(tmp_path / "sky.exr", np.full((8, 16, 3), 0.5, np.float32))
    relit = found.relight((lamp, EnvironmentLight("e", str(tmp_path / "sky.exr"))))
    relit.save(tmp_path / "d")
    loaded = GsidMethod().load(tmp_path / "d")
    assert loaded.provides == relit.provides
    assert loaded.lights() == relit.lights()
    np.testing.assert_array_equal(seen(loaded), seen(relit))
