# SPDX-License-Identifier: Apache-2.0
"""Faults of values, files, photographs, and of what the index says of all views."""

from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from fault_planting import Copied, Fault, Faults, Layers, edit_index
from graycard import View
from graycard.io import read_json, read_layers, read_rgb, write_layers, write_rgb

pytestmark = pytest.mark.usefixtures("llvm")
FAULTS = Faults()


@FAULTS.in_scene("tabletop", "noise ceiling", "variance of another rendering")
def a_noise_ceiling_of_nothing(scene: Path):
    edit_index(scene, "truth/truth.json", noise_ceiling=99.0)


@FAULTS.in_scene("tabletop", "noise ceiling", "got none")
def no_noise_ceiling(scene: Path):
    edit_index(scene, "truth/truth.json", noise_ceiling=None)


@FAULTS.in_scene("dark", "diameter", "has a diagonal of")
def another_diameter(scene: Path):
    edit_index(scene, "truth/truth.json", diameter=1234.0)


@FAULTS.in_layers("tabletop", "values in float32", "float16")
def truth_in_half_precision(layers: Layers, view: View):
    for name in layers:
        layers[name] = layers[name].astype(np.float16) if name != "object_id" else layers[name]


@FAULTS.in_layers("dark", "values finite", "expected finite values in radiance")
def one_pixel_not_a_number(layers: Layers, view: View):
    layers["radiance"][3, 4, 1] = np.nan


@FAULTS.in_layers("dark", "values in range", "expected base_color in [0, 1]")
def colors_of_eight_bits(layers: Layers, view: View):
    layers["base_color"] = layers["base_color"] * 255


@FAULTS.in_scene("dark", "files", "breaks off")
def truncated_file(scene: Path):
    path = scene / "truth" / "views" / "train_000.exr"
    path.write_bytes(path.read_bytes()[:-2000])


@FAULTS.in_scene("tabletop", "files", "got none")
def view_missing(scene: Path):
    (scene / "truth" / "views" / "train_000.exr").unlink()


@FAULTS.in_scene("multilight", "files", "expected finite values in radiance")
def relit_picture_not_a_number(scene: Path):
    path = next((scene / "truth" / "relighting").glob("*/views/*.exr"))
    layers = read_layers(path)
    layers["radiance"][0, 0, 0] = np.inf
    write_layers(path, layers)


@FAULTS.in_scene("dark", "files", "list other views")
def views_listed_for_the_truth_alone(scene: Path):
    path = scene / "capture" / "capture.json"
    edit_index(scene, "capture/capture.json", views=read_json(path)["views"][1:])


@FAULTS.in_scene("tabletop", "files", "to be 48x48 pixels, as its camera is, got 40x48")
def photograph_of_another_size(scene: Path):
    path = scene / "capture" / "photographs" / "train_000.exr"
    write_rgb(path, read_rgb(path)[:, :40])


@FAULTS.in_scene("tabletop", "files", "expected a whole EXR file")
def mask_that_is_no_image(scene: Path):
    (scene / "capture" / "masks" / "target" / "train_000.exr").write_text("no image")


@FAULTS.in_scene("dark", "photograph is the radiance", "another filter")
def photograph_with_a_gaussian_filter(scene: Path):
    for path in (scene / "capture" / "photographs").iterdir():
        write_rgb(path, ndimage.gaussian_filter(read_rgb(path), (0.5, 0.5, 0)))


@FAULTS.in_scene("multilight", "exposure", "99th percentile")
def exposure_of_a_view(scene: Path):
    brightest = np.percentile(read_rgb(scene / "capture" / "photographs" / "train_000.exr"), 99)
    for part in ("capture", "truth"):
        edit_index(scene, f"{part}/{part}.json", exposure=float(1 / brightest))


@pytest.mark.parametrize("fault", FAULTS.known, ids=str)
def test_it_is_found_by_name(copied: Copied, fault: Fault):
    fault.must_be_found(copied)
