# SPDX-License-Identifier: Apache-2.0
"""Checks of the files themselves: there, unchanged, of a known format, complete and readable."""

from collections.abc import Iterator
from pathlib import Path

import graycard as gc
from graycard.synth.verify._check import At, Check

FILES = "files"
"""Name of the check; a scene that fails it is not looked at any further."""


def is_imported(folder: Path) -> bool:
    """Whether a scene folder holds a user's own photographs, which have no truth."""
    try:
        manifest = gc.read_manifest(folder / "capture", "graycard-capture")
    except gc.GraycardError:
        return False
    return manifest.generator.get("name") == gc.IMPORTER and not (folder / "truth").exists()


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
        manifest = gc.read_manifest(folder, f"graycard-{part}")
        damaged = gc.damaged_files(folder, manifest)
    except (gc.GraycardError, OSError) as cause:
        yield f"{part}: {cause}"
        return
    for name, fault in damaged.items():
        yield f"{part}/{name}: {fault}"


def _unreadable(folder: Path) -> Iterator[str]:
    try:
        truth = gc.open_truth(folder / "truth", check=False)
        capture = gc.open_capture(folder / "capture", check=False)
        _read_lights(folder / "truth", truth)
        capture.points()
    except gc.GraycardError as cause:
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


def _read_lights(folder: Path, truth: gc.Truth) -> None:
    """Read the lights and the images of surroundings, as they were and after each edit.

    Raises:
        GraycardError: A file of them is missing or broken.
    """
    sets = {"": truth.lights(), **{edit.folder: truth.relit_lights(edit.name) for edit in truth.edits}}
    for beside, lights in sets.items():
        for light in lights:
            if isinstance(light, gc.EnvironmentLight):
                gc.read_rgb(folder / beside / light.image)


def _broken_picture(path: Path, size: tuple[int, int] | None) -> Iterator[str]:
    """What is wrong with a picture beside the views themselves; ``size`` is that of its view."""
    try:
        layers = gc.read_layers(path)
    except gc.GraycardError as cause:
        yield str(cause)
        return
    for name, values in layers.items():
        fault = gc.find_fault(name, values, *(size or values.shape[:2]))
        if fault:
            yield f"{path.parent.parent.name}/{path.stem}: {fault}"


def _unreadable_view(truth: gc.Truth, capture: gc.Capture, view: gc.View) -> Iterator[str]:
    size = view.camera.height, view.camera.width
    try:
        shapes = {values.shape[:2] for values in truth.layers(view).values()}
        if view.split == "train":
            shapes.add(capture.photograph(view).shape[:2])
            if capture.target is not None:
                shapes.add(capture.target_mask(view).shape)
    except (gc.GraycardError, KeyError) as cause:
        yield str(cause)
        return
    if shapes != {size}:
        yield f"{view.name}: expected images of {size[1]}x{size[0]}, got sizes {sorted(shapes)}"
