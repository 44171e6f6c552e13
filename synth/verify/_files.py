# SPDX-License-Identifier: Apache-2.0
"""Checks of the files themselves: there, unchanged, of a known format, complete and readable."""

from collections.abc import Iterator
from pathlib import Path

from graycard import Capture, EnvironmentLight, GraycardError, Truth, View, open_capture, open_truth
from graycard.dataset import IMPORTER
from graycard.io import damaged_files, read_layers, read_manifest, read_rgb
from graycard.layers import find_fault
from graycard.synth.verify._check import At, Check

FILES = "files"
"""Name of the check; a scene that fails it is not looked at any further."""


def is_imported(folder: Path) -> bool:
    """Return whether a scene folder holds a user's own photographs, which have no truth."""
    try:
        manifest = read_manifest(folder / "capture", "graycard-capture")
    except GraycardError:
        return False
    return manifest.generator.get("name") == IMPORTER and not (folder / "truth").exists()


def check_files(folder: Path, at: At) -> Iterator[Check]:
    """Each file is there, has its SHA-256, and can be read to its end.

    Hashes tell what changed after the scene was made; only reading tells what was broken when it was sealed.
    """
    faults = [fault for part in ("capture", "truth") for fault in _faults(folder / part, part)]
    if not faults:
        faults = list(_unreadable(folder))
    told = "; ".join(faults[:3])
    yield at.judge(FILES, len(faults), 0, "faults", f"{told}. Render the scene again")


def _faults(folder: Path, part: str) -> Iterator[str]:
    try:
        manifest = read_manifest(folder, f"graycard-{part}")
        damaged = damaged_files(folder, manifest)
    except (GraycardError, OSError) as cause:
        yield f"{part}: {cause}"
        return
    for name, fault in damaged.items():
        yield f"{part}/{name}: {fault}"


def _unreadable(folder: Path) -> Iterator[str]:
    try:
        truth = open_truth(folder / "truth", check=False)
        capture = open_capture(folder / "capture", check=False)
        _read_lights(folder / "truth", truth)
        capture.points()
    except GraycardError as cause:
        yield str(cause)
        return
    if truth.views != capture.views:
        yield "truth.json and capture.json list other views"
    for view in truth.views:
        yield from _unreadable_view(truth, capture, view)
    relit = [e.view_file(v.name) for e in truth.edits for v in truth.views if v.split == "test"]
    yield from (
        f"expected truth/{name}, got none" for name in relit if not (folder / "truth" / name).is_file()
    )
    sizes = {view.name: (view.camera.height, view.camera.width) for view in truth.views}
    for path in sorted((folder / "truth").glob("*/**/views/*.exr")):  # under changed lights, or composed
        yield from _broken_picture(path, sizes.get(path.stem))


def _read_lights(folder: Path, truth: Truth) -> None:
    """Read the lights and the images of surroundings, as they were and after each edit.

    Raises:
        GraycardError: A file of them is missing or broken.
    """
    sets = {"": truth.lights(), **{edit.folder: truth.relit_lights(edit.name) for edit in truth.edits}}
    for beside, lights in sets.items():
        for light in lights:
            if isinstance(light, EnvironmentLight):
                read_rgb(folder / beside / light.image)


def _broken_picture(path: Path, size: tuple[int, int] | None) -> Iterator[str]:
    """Return what is wrong with a picture beside the views themselves; ``size`` is that of its view."""
    try:
        layers = read_layers(path)
    except GraycardError as cause:
        yield str(cause)
        return
    for name, values in layers.items():
        fault = find_fault(name, values, *(size or values.shape[:2]))
        if fault:
            yield f"{path.parent.parent.name}/{path.stem}: {fault}"


def _unreadable_view(truth: Truth, capture: Capture, view: View) -> Iterator[str]:
    """Return the faults of the images of a view, which are of the size of its camera."""
    try:
        truth.layers(view)
        if view.split == "train":
            capture.photograph(view)
            if capture.target is not None:
                capture.target_mask(view)
    except GraycardError as cause:
        yield str(cause)
