# SPDX-License-Identifier: Apache-2.0
"""Faults of object ids, masks and materials."""

from pathlib import Path

import numpy as np
import pytest

from fault_planting import Copied, Fault, Faults, Layers, edit, swap
from graycard import View, open_truth, srgb_encode
from graycard.io import write_layers

pytestmark = pytest.mark.usefixtures("llvm")
FAULTS = Faults()


@FAULTS.in_layers("tabletop", "object ids named", "ids that were shifted")
def object_ids_shifted(layers: Layers, view: View):
    layers["object_id"] = np.where(layers["object_id"] > 0, layers["object_id"] + 50, 0)


@FAULTS.in_layers("multilight", "object_id again", "shifted ids", views=1)
def object_ids_permuted(layers: Layers, view: View):
    ids = layers["object_id"]
    layers["object_id"] = np.where((ids > 0) & (ids < 6), ids % 5 + 1, ids)


@FAULTS.in_layers("dark", "object_id again", "shifted ids", views=1)
def object_ids_counted_from_two(layers: Layers, view: View):
    layers["object_id"] = layers["object_id"] + np.uint32(1)


@FAULTS.in_scene("dark", "object in other views", "counted anew in a view")
def object_ids_counted_anew_in_a_view(scene: Path):
    edit(scene, object_ids_reversed, ("test_001",))


def object_ids_reversed(layers: Layers, view: View):
    layers["object_id"] = np.where(layers["object_id"] > 0, 20 - layers["object_id"].clip(max=19), 0)


@FAULTS.in_scene("tabletop", "mask of the target", "mask of another object")
def mask_of_another_object(scene: Path):
    truth = open_truth(scene / "truth", check=False)
    for path in (scene / "capture" / "masks" / "target").iterdir():
        ids = truth.layers(truth.view(path.stem))["object_id"]
        write_layers(path, {"object_id": np.where(ids == 2, ids, 0)})


@FAULTS.in_layers("multilight", "diffuse reflectance", "metal's colour taken for diffuse")
def color_of_a_metal_as_diffuse(layers: Layers, view: View):
    layers["diffuse_reflectance"] = layers["base_color"]


@FAULTS.in_layers("tabletop", "alpha of roughness", "the two swapped")
def roughness_and_alpha_swapped(layers: Layers, view: View):
    swap(layers, "roughness", "alpha")


@FAULTS.in_layers("multilight", "f0 of the material", "another f0, or metallic")
def f0_of_a_metal_as_of_a_dielectric(layers: Layers, view: View):
    layers["f0"] = np.full_like(layers["f0"], 0.04)


@FAULTS.in_layers("multilight", "metallic again", "metallic, to 1e-05", views=1)
def metallic_forgotten(layers: Layers, view: View):
    layers["metallic"] = np.zeros_like(layers["metallic"])
    layers["diffuse_reflectance"] = layers["base_color"]
    layers["f0"] = np.where(layers["f0"] > 0, np.float32(0.04), 0)


@FAULTS.in_layers("tabletop", "roughness again", "roughness, to 1e-05", views=1)
def one_roughness_for_all_that_shines(layers: Layers, view: View):
    shines = layers["f0"].max(axis=-1) > 0
    layers["roughness"] = np.where(shines, np.float32(0.7), layers["roughness"])
    layers["alpha"] = layers["roughness"] ** 2


@FAULTS.in_layers("tabletop", "albedo again: level", "is that of an independent rendering", views=1)
def albedo_of_what_shines_lost(layers: Layers, view: View):
    layers["albedo"] = np.where(layers["f0"].max(axis=-1, keepdims=True) > 0, 0, layers["albedo"])


@FAULTS.in_layers("dark", "base_color again", "layer of another scene", views=1)
def base_color_encoded(layers: Layers, view: View):
    for name in ("base_color", "diffuse_reflectance"):
        layers[name] = srgb_encode(layers[name])


@pytest.mark.parametrize("fault", FAULTS.known, ids=str)
def test_it_is_found_by_name(copied: Copied, fault: Fault):
    fault.must_be_found(copied)
