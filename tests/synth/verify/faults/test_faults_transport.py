# SPDX-License-Identifier: Apache-2.0
"""Faults of the parts of the radiance: lights, lobes and bounces that are lost or swapped."""

from pathlib import Path

import numpy as np
import pytest

from fault_planting import Copied, Fault, Faults, Layers, edit, swap
from graycard import View

pytestmark = pytest.mark.usefixtures("llvm")
FAULTS = Faults()


@FAULTS.in_layers("dark", "direct diffuse light", "swapped lights")
def parts_of_two_lights_swapped(layers: Layers, view: View):
    for part in ("direct.diffuse", "direct.specular", "indirect.diffuse", "indirect.specular"):
        swap(layers, f"{part}.lamp", f"{part}.ambient")


@FAULTS.in_layers("tabletop", "lights again: level", "is that of an independent rendering", views=1)
def specular_parts_of_two_lights_swapped(layers: Layers, view: View):
    for part in ("direct", "indirect"):
        swap(layers, f"{part}.specular.lamp", f"{part}.specular.room")


@FAULTS.in_layers("dark", "direct diffuse light", "direct light taken for bounced light")
def direct_and_indirect_parts_swapped(layers: Layers, view: View):
    for name in ("lamp", "ambient"):
        for lobe in ("diffuse", "specular"):
            swap(layers, f"direct.{lobe}.{name}", f"indirect.{lobe}.{name}")


@FAULTS.in_layers("tabletop", "indirect diffuse light", "direct light taken for bounced light")
def direct_and_indirect_parts_swapped_beside_gloss(layers: Layers, view: View):
    for name in [n for n in layers if n.startswith("direct.diffuse.")]:
        swap(layers, name, f"in{name}")
    layers["pure"] = np.where(layers["f0"].max(axis=-1) > 0, layers["pure"], 0)  # what is matte is not judged


def darken(layers: Layers, light: str, where: np.ndarray) -> None:
    """A light that sends nothing straight to some pixels; all sums hold."""
    for stem in ("visibility", "direct.irradiance"):
        values = layers[f"{stem}.{light}"]
        values[where] = 0


@FAULTS.in_layers("dark", "direct diffuse light", "reflectance x the direct irradiance of lamp")
def direct_light_lost_in_the_upper_half(layers: Layers, view: View):
    darken(layers, "lamp", np.arange(48) < 24)


@FAULTS.in_layers("dark", "light again", "visibility.lamp is 0 something is in the way", views=1)
def a_light_that_is_free_but_blocked(layers: Layers, view: View):
    darken(layers, "lamp", np.arange(48) % 12 == 0)


@FAULTS.in_layers("multilight", "direct diffuse light", "reflectance x the direct irradiance of lamp-1")
def direct_light_of_an_area_light_lost(layers: Layers, view: View):
    darken(layers, "lamp-1", np.arange(48) >= 0)


@FAULTS.in_layers("dark", "indirect diffuse light", "reflectance x the indirect irradiance")
def bounced_light_a_fifth_too_dark(layers: Layers, view: View):
    for name in ("lamp", "ambient"):
        direct = layers[f"direct.irradiance.{name}"]
        layers[f"irradiance.{name}"] = direct + 0.8 * (layers[f"irradiance.{name}"] - direct)
    layers["shading"] = (layers["irradiance.lamp"] + layers["irradiance.ambient"]) / np.pi


@FAULTS.in_layers("dark", "parts add up", "a light or lobe left out")
def one_lobe_left_out(layers: Layers, view: View):
    layers["indirect.diffuse.lamp"] = np.zeros_like(layers["indirect.diffuse.lamp"])


@FAULTS.in_scene("multilight", "layers present", "missing are")
def one_light_dropped(scene: Path):
    def drop(layers: Layers, view: View):
        for name in [n for n in layers if n.endswith(".lamp-4")]:
            del layers[name]

    edit(scene, drop)


@pytest.mark.parametrize("fault", FAULTS.known, ids=str)
def test_it_is_found_by_name(copied: Copied, fault: Fault):
    fault.must_be_found(copied)
