# SPDX-License-Identifier: Apache-2.0
"""Faults of the picture without the target and of the masks of its effects."""

from pathlib import Path

import numpy as np
import pytest

from fault_planting import Copied, Fault, Faults, Layers, render_otherwise, settings_of, swap
from graycard import View
from graycard.layers import with_sums

pytestmark = pytest.mark.usefixtures("llvm")
FAULTS = Faults()


@FAULTS.in_layers("tabletop", "footprint of the target", "looks like a mask that is lost")
def no_effect_marked(layers: Layers, view: View):
    for name in [n for n in layers if n.startswith("effect.")]:
        layers[name] = np.zeros_like(layers[name])


@FAULTS.in_layers("tabletop", "untouched pixels marked", "looks like a mask that is lost")
def nothing_untouched(layers: Layers, view: View):
    layers["effect.untouched"] = np.zeros_like(layers["effect.untouched"])


@FAULTS.in_layers("tabletop", "untouched pixels marked", "looks like a mask that is lost")
def a_part_not_untouched(layers: Layers, view: View):
    upper = len(layers["effect.untouched"]) // 2
    layers["effect.untouched"][:upper] = 0


@FAULTS.in_layers("tabletop", "effects marked", "looks like masks that are lost")
def no_shadow_and_no_mirror_image(layers: Layers, view: View):
    for name in ("shadow", "mirror", "bleeding"):
        layers[f"effect.{name}"] = np.zeros_like(layers[f"effect.{name}"])


def left_half(mask: np.ndarray) -> slice:
    """Return the columns that hold half of a mask's pixels."""
    return slice(0, int(np.median(np.nonzero(mask)[1])) + 1)


@FAULTS.in_layers("tabletop", "effects marked", "looks like masks that are lost")
def half_of_all_effects(layers: Layers, view: View):
    names = [f"effect.{name}" for name in ("shadow", "mirror", "bleeding")]
    lost = left_half(np.any([layers[name] > 0 for name in names], axis=0))
    for name in names:
        layers[name][:, lost] = 0


@FAULTS.in_layers("tabletop", "effects again: inside", "a part of the mask that is lost", views=1)
def half_of_the_mirror_image(layers: Layers, view: View):
    layers["effect.mirror"][:, left_half(layers["effect.mirror"] > 0)] = 0


@FAULTS.in_layers("tabletop", "effects again: inside", "the mask of another effect", views=1)
def half_of_the_view_in_shadow(layers: Layers, view: View):
    upper = len(layers["effect.shadow"]) // 2
    layers["effect.shadow"][upper:][layers["effect.untouched"][upper:] == 0] = 1


@FAULTS.in_layers("tabletop", "footprint at the target", "mask of another object or view")
def footprint_of_everything(layers: Layers, view: View):
    layers["effect.footprint"] = np.ones_like(layers["effect.footprint"])


@FAULTS.in_layers("tabletop", "effects again", "effect.shadow is where another rendering has it", views=1)
def no_shadow(layers: Layers, view: View):
    layers["effect.shadow"] = np.zeros_like(layers["effect.shadow"])


@FAULTS.in_scene("tabletop", "counterfactual's random numbers", "another seed")
def counterfactual_with_another_seed(scene: Path):
    render_otherwise(scene, "counterfactual.radiance", settings_of(scene), seed=5)


@FAULTS.in_layers("tabletop", "specular light of mirror images", "looks like the light with the target")
def specular_light_with_the_target(layers: Layers, view: View):
    layers["counterfactual.specular"] = with_sums(layers)["specular"]


@FAULTS.in_layers("tabletop", "specular light of untouched pixels", "looks like the other lobe")
def lobes_swapped(layers: Layers, view: View):
    swap(layers, "counterfactual.diffuse", "counterfactual.specular")


@FAULTS.in_layers("tabletop", "lobes without the target", "a lobe of another view")
def diffuse_light_upside_down(layers: Layers, view: View):
    layers["counterfactual.diffuse"] = layers["counterfactual.diffuse"][::-1].copy()


@FAULTS.in_layers("tabletop", "surfaces beside the target", "looks like another view")
def surfaces_upside_down(layers: Layers, view: View):
    layers["counterfactual.normal"] = layers["counterfactual.normal"][::-1].copy()


@FAULTS.in_layers("tabletop", "surfaces behind the target", "still there")
def surfaces_with_the_target(layers: Layers, view: View):
    for name in ("normal", "f0", "roughness"):
        layers[f"counterfactual.{name}"] = layers[name]


@FAULTS.in_layers("tabletop", "target removed", "still there")
def counterfactual_with_its_target(layers: Layers, view: View):
    for end in ("", ".var", ".half_a", ".half_b"):
        layers[f"counterfactual.radiance{end}"] = layers[f"radiance{end}"]


@pytest.mark.parametrize("fault", FAULTS.known, ids=str)
def test_it_is_found_by_name(copied: Copied, fault: Fault):
    fault.must_be_found(copied)
