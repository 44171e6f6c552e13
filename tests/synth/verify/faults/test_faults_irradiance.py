# SPDX-License-Identifier: Apache-2.0
"""Faults of irradiance, visibility, and of the lights that both follow from."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fault_planting import Copied, Fault, Faults, Layers, edit_index, edit_lights, swap
from graycard import Light, RectangleLight, SphereLight, SpotLight, View
from graycard.io import read_rgb, write_rgb
from graycard.lights import read_lights

pytestmark = pytest.mark.usefixtures("llvm")
FAULTS = Faults()


@FAULTS.in_layers("multilight", "direct light of the formula", "swapped lights")
def irradiance_of_lights_permuted(layers: Layers, view: View):
    for stem in ("irradiance", "direct.irradiance", "visibility"):
        swap(layers, f"{stem}.lamp-1", f"{stem}.lamp-4")


@FAULTS.in_layers("multilight", "direct part of irradiance", "permuted")
def irradiance_permuted_without_its_direct_part(layers: Layers, view: View):
    swap(layers, "irradiance.lamp-3", "irradiance.lamp-4")


@FAULTS.in_layers("tabletop", "irradiances add up", "a shading without 1/pi")
def shading_without_pi(layers: Layers, view: View):
    # every layer of irradiance is right: only their quotient tells
    layers["shading"] = layers["shading"] * np.pi


@FAULTS.in_layers("dark", "diffuse light", "diffuse_reflectance x shading")
def irradiance_and_shading_divided_by_pi(layers: Layers, view: View):
    for name in [n for n in layers if "irradiance" in n or n == "shading"]:
        layers[name] = layers[name] / np.pi


@FAULTS.in_layers("dark", "visible where lit", "inverted")
def visibility_inverted(layers: Layers, view: View):
    layers["visibility.lamp"] = 1 - layers["visibility.lamp"]


@FAULTS.in_layers("multilight", "shadows again", "inverted or swapped", views=1)
def shadows_left_out(layers: Layers, view: View):
    layers["visibility.lamp-4"] = np.ones_like(layers["visibility.lamp-4"])


@FAULTS.in_scene("dark", "direct light of the formula", "another frame")
def light_in_the_world_instead_of_on_the_camera(scene: Path):
    edit_lights(scene, lambda light: replace(light, frame="world"))
    edit_index(scene, "capture/capture.json", light_on_camera=False)


@FAULTS.in_scene("multilight", "direct light of the formula", "another frame, axis, angle")
def full_angles_of_a_spot_light(scene: Path):
    def double(light: Light) -> Light:
        if isinstance(light, SpotLight):
            return replace(light, beam_width=2 * light.beam_width, cutoff_angle=2 * light.cutoff_angle)
        return light

    edit_lights(scene, double)


@FAULTS.in_scene("multilight", "direct light of the formula", "swapped lights")
def powers_of_two_lights_swapped(scene: Path):
    lights = {light.name: light for light in read_lights(scene / "truth" / "lights.json")}
    softbox, bulb = lights["lamp-1"], lights["lamp-2"]
    assert isinstance(softbox, RectangleLight)
    assert isinstance(bulb, SphereLight)
    swapped = {"lamp-1": bulb.radiance, "lamp-2": softbox.radiance}
    edit_lights(
        scene, lambda light: replace(light, radiance=swapped[light.name]) if light.name in swapped else light
    )


@FAULTS.in_scene("multilight", "colour of direct light", "tinted by [1.5, 0.75, 0.75]")
def color_of_a_light_tinted(scene: Path):
    edit_lights(scene, lambda light: tinted(light) if isinstance(light, SphereLight) else light)


def tinted(light: SphereLight) -> SphereLight:
    red, green, blue = light.radiance
    return replace(light, radiance=(red / 1.5, green / 0.75, blue / 0.75))


@FAULTS.in_scene("tabletop", "direct light of the formula", "another frame, axis")
def environment_turned(scene: Path):
    path = scene / "truth" / "environment.exr"
    write_rgb(path, np.roll(read_rgb(path), 32, axis=1))


@FAULTS.in_scene("tabletop", "environment of the spec", "one that is mirrored")
def environment_mirrored(scene: Path):
    path = scene / "truth" / "environment.exr"
    write_rgb(path, read_rgb(path)[:, ::-1])


@pytest.mark.parametrize("fault", FAULTS.known, ids=str)
def test_it_is_found_by_name(copied: Copied, fault: Fault):
    fault.must_be_found(copied)
