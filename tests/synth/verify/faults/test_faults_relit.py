# SPDX-License-Identifier: Apache-2.0
"""Faults of the pictures under changed lights and of the lists of edits."""

from pathlib import Path

import pytest

from fault_planting import Copied, Fault, Faults, edit_index, swap_files
from graycard.io import read_json, read_layers, write_layers
from graycard.lights import write_lights

pytestmark = pytest.mark.usefixtures("llvm")
FAULTS = Faults()


def swap_edits(scene: Path, a: str, b: str) -> None:
    for path in (scene / "truth" / "relighting" / a / "views").iterdir():
        swap_files(path, scene / "truth" / "relighting" / b / "views" / path.name)


@FAULTS.in_scene("multilight", "relit by its parts", "looks like the picture of another edit")
def pictures_of_two_edits_swapped(scene: Path):
    swap_edits(scene, "without-lamp-1", "without-lamp-2")


@FAULTS.in_scene("multilight", "relit again: level", "is that of an independent rendering", views=1)
def pictures_of_two_surroundings_swapped(scene: Path):
    swap_edits(scene, "environment-1", "environment-2")


@FAULTS.in_scene("tabletop", "relit by its parts", "or of other light")
def relit_pictures_twice_as_bright(scene: Path):
    for path in (scene / "truth" / "relighting").glob("*/views/*.exr"):
        gains = {name: 4 if name.endswith(".var") else 2 for name in read_layers(path)}
        write_layers(path, {name: values * gains[name] for name, values in read_layers(path).items()})


@FAULTS.in_scene("multilight", "relit halves average", "halves of another edit")
def halves_of_another_edit(scene: Path):
    folder = scene / "truth" / "relighting"
    for path in (folder / "environment-1" / "views").iterdir():
        other = read_layers(folder / "environment-2" / "views" / path.name)
        halves = {name: other[name] for name in ("radiance.half_a", "radiance.half_b")}
        write_layers(path, read_layers(path) | halves)


@FAULTS.in_scene("dark", "relit layers", "missing are ['radiance.half_a'", views=1)
def relit_without_its_noise(scene: Path):
    for path in (scene / "truth" / "relighting" / "flash-moved" / "views").iterdir():
        write_layers(path, {"radiance": read_layers(path)["radiance"]})


@FAULTS.in_scene("dark", "lights of the edits", "other ones are of without-")
def lights_of_the_edits_lost(scene: Path):
    for path in (scene / "truth" / "relighting").glob("*/lights.json"):
        write_lights(path, ())


@FAULTS.in_scene("multilight", "lights of the edits", "environment-1, environment-2")
def surroundings_of_two_edits_swapped(scene: Path):
    folder = scene / "truth" / "relighting"
    swap_files(folder / "environment-1" / "environment.exr", folder / "environment-2" / "environment.exr")


@FAULTS.in_scene("dark", "edits of the spec", "flash-moved")
def an_edit_left_out(scene: Path):
    edits = [e for e in read_json(scene / "truth" / "truth.json")["edits"] if e["name"] != "flash-moved"]
    edit_index(scene, "truth/truth.json", edits=edits)


@FAULTS.in_scene("dark", "files", "expected truth/relighting/flash-moved/views/test_001.exr, got none")
def a_relit_picture_missing(scene: Path):
    (scene / "truth" / "relighting" / "flash-moved" / "views" / "test_001.exr").unlink()


@pytest.mark.parametrize("fault", FAULTS.known, ids=str)
def test_it_is_found_by_name(copied: Copied, fault: Fault):
    fault.must_be_found(copied)
