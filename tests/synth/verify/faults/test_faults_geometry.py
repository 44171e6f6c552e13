# SPDX-License-Identifier: Apache-2.0
"""Faults of depth, position, normal and cameras."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from fault_planting import Copied, Fault, Faults, Layers, edit, swap_files
from graycard import View
from graycard.io import read_json, write_json

pytestmark = pytest.mark.usefixtures("llvm")
FAULTS = Faults()


@FAULTS.in_layers("tabletop", "depth along the axis", "looks like depth stored along the ray")
def ray_distance_as_z(layers: Layers, view: View):
    layers["depth"] = layers["distance"]


@FAULTS.in_layers("dark", "depth along the axis", "another unit, factor 100")
def depth_in_centimetres(layers: Layers, view: View):
    layers["depth"] = layers["depth"] * 100


@FAULTS.in_layers("multilight", "position on the ray", "looks like a world moved by [0.5, -0.25, 0.1] m")
def world_recentred(layers: Layers, view: View):
    layers["position"] = layers["position"] + np.array([0.5, -0.25, 0.1])


@FAULTS.in_layers("dark", "position at the pixel centre", "shift by (+0.50, +0.50) px")
def geometry_half_a_pixel_off(layers: Layers, view: View):
    K = view.camera.K + np.array([[0, 0, -0.5], [0, 0, -0.5], [0, 0, 0]])
    rays = replace(view.camera, K=K).rays()
    layers["position"] = view.camera.position + layers["distance"][..., None] * rays


@FAULTS.in_layers("dark", "normal across the surface", "mirrored axis")
def normals_with_a_mirrored_axis(layers: Layers, view: View):
    layers["normal"] = layers["normal"] * np.array([1, -1, 1])


@FAULTS.in_layers("multilight", "normal across the surface", "normals in camera axes")
def normals_in_camera_axes(layers: Layers, view: View):
    layers["normal"] = layers["normal"] @ view.camera.camera_to_world[:3, :3]


@FAULTS.in_layers("tabletop", "normal faces the camera", "inside out")
def normals_inside_out(layers: Layers, view: View):
    layers["normal"] = -layers["normal"]


@FAULTS.in_layers("tabletop", "normal of unit length", "average over several surfaces")
def normals_averaged_over_the_pixel(layers: Layers, view: View):
    layers["normal"] = ndimage.uniform_filter(layers["normal"], size=3, axes=(0, 1))


@FAULTS.in_scene("multilight", "position on the ray", "swapped views")
def swapped_view_files(scene: Path):
    a, b, *_ = sorted((scene / "truth" / "views").iterdir())
    swap_files(a, b)


@FAULTS.in_scene("tabletop", "cameras of the spec", "swapped or moved views")
def cameras_moved_in_both_index_files(scene: Path):
    for part in ("capture", "truth"):
        path = scene / part / f"{part}.json"
        data = read_json(path)
        for view in data["views"]:
            view["camera"]["camera_to_world"][0][3] += 0.01
        write_json(path, data)


@FAULTS.in_scene("tabletop", "position in other views", "another world or camera")
def one_view_in_a_world_of_its_own(scene: Path):
    def shrink(layers: Layers, view: View):
        for name in ("depth", "distance"):
            layers[name] = layers[name] * 0.8
        layers["position"] = view.camera.position + 0.8 * (layers["position"] - view.camera.position)

    edit(scene, shrink, ("train_000",))


@pytest.mark.parametrize("fault", FAULTS.known, ids=str)
def test_it_is_found_by_name(copied: Copied, fault: Fault):
    fault.must_be_found(copied)
