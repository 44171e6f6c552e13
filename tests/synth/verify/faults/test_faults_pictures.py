# SPDX-License-Identifier: Apache-2.0
"""Faults of pictures and their noise that only a second rendering tells, and some that show without."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from fault_planting import Copied, Fault, Faults, Layers, render_otherwise, settings_of
from graycard import View, srgb_encode

pytestmark = pytest.mark.usefixtures("llvm")
FAULTS = Faults()


@FAULTS.in_layers("dark", "variance of the mean", "looks like identical halves")
def identical_halves(layers: Layers, view: View):
    layers["radiance.half_a"] = layers["radiance.half_b"] = layers["radiance"]


@FAULTS.in_layers("multilight", "variance of the mean", "variance of one image")
def variance_of_an_image_instead_of_the_mean(layers: Layers, view: View):
    layers["radiance.var"] = layers["radiance.var"] * 4


@FAULTS.in_layers("tabletop", "halves average", "halves of another picture")
def halves_of_another_picture(layers: Layers, view: View):
    for end in ("half_a", "half_b"):
        layers[f"radiance.{end}"] = layers[f"counterfactual.radiance.{end}"]


def scale_picture(layers: Layers, factor: np.ndarray | float) -> None:
    """A gain that all that depends on the radiance follows, so that no sum betrays it."""
    for name in [n for n in layers if n.startswith(("radiance", "emitted", "direct.", "indirect."))]:
        layers[name] = layers[name] * (factor**2 if name.endswith(".var") else factor)


@FAULTS.in_layers("tabletop", "radiance again: level", "channel G", views=3)
def half_a_percent_of_gain_in_one_channel(layers: Layers, view: View):
    scale_picture(layers, np.array([1, 1.005, 1]))


@FAULTS.in_layers("dark", "radiance again: level", "% off", views=1)
def one_light_missing_in_the_picture(layers: Layers, view: View):
    names = [n for n in layers if n.endswith(".ambient") and n.startswith(("direct.", "indirect."))]
    lost = np.sum([layers[n] for n in names if "irradiance" not in n], axis=0)
    for name in ("radiance", "radiance.half_a", "radiance.half_b"):
        layers[name] = layers[name] - lost


@FAULTS.in_layers("multilight", "radiance again: level", "% off", views=1)
def radiance_encoded(layers: Layers, view: View):
    for name in ("radiance", "radiance.half_a", "radiance.half_b"):
        layers[name] = srgb_encode(layers[name])


@FAULTS.in_layers("dark", "radiance again: pattern", "show something else", views=1)
def picture_of_another_paint(layers: Layers, view: View):
    """A texture that is brighter here and darker there: no mean tells."""
    stripes = 1 + 0.2 * (-1) ** np.arange(48)[:, None]
    for name in ("radiance", "radiance.half_a", "radiance.half_b"):
        layers[name] = layers[name] * stripes


@FAULTS.in_layers("tabletop", "radiance again: place", "shifted by (+0.", views=1)
def picture_half_a_pixel_off(layers: Layers, view: View):
    for name in ("radiance", "radiance.half_a", "radiance.half_b"):
        layers[name] = ndimage.shift(layers[name], (0, 0.5, 0), order=1, mode="nearest")


@FAULTS.in_scene("multilight", "radiance again: level", "% off", views=1)
def one_bounce_less(scene: Path):
    render_otherwise(scene, "radiance", replace(settings_of(scene), max_depth=2), seed=1000)


@pytest.mark.parametrize("fault", FAULTS.known, ids=str)
def test_it_is_found_by_name(copied: Copied, fault: Fault):
    fault.must_be_found(copied)
