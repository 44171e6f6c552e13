# SPDX-License-Identifier: Apache-2.0
"""Faults of a fitted method: what it renders, its lights, relighting, removal, and what it saves."""

import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from graycard import Camera, Capture, EnvironmentLight, GraycardError, Light, View, open_truth
from graycard.benchmarks.kit._faults import Fault
from graycard.benchmarks.kit._layers import differences, faults_of_facts, faults_of_layers, usable
from graycard.benchmarks.kit._raised import fault_of
from graycard.methods import Relightable, Removable, Surrounded
from graycard.methods.confined import ProbedMethod, of_kind
from graycard.tiny import brighter

PICTURES = "radiance"
_SAME = 1e-6
"""Share of a layer's range by which a second rendering may differ."""
_TWICE = 2.0
_FOLLOWS = 1.2
"""Ratio of radiance under lights twice as bright from which it follows them."""
_SLOW_S = 10.0
"""Processor time of a tiny view from which rendering is slow."""
_TRAINING = 2
"""Training views that are rendered: one alone could be right by chance."""
_HEAD = 2**16
Arrays = dict[str, np.ndarray]


def rendered_views(
    method: ProbedMethod, made: Any, capture: Capture, faults: list[Fault]
) -> dict[str, Arrays]:
    """Return layers of held-out and some training views as they came, and add what is wrong with them.

    A view that fails ends it: the others would fail alike. Of what is slow two views are enough.
    """
    found: dict[str, Arrays] = {}
    for view in (*capture.test, *capture.train[:_TRAINING]):
        if len(found) > 1 and _is_slow(method):
            break
        try:
            found[view.name] = made.render(view.camera, sorted(made.provides))
        except GraycardError as error:
            faults.append(fault_of(error, "render"))
            break
        faults.extend(faults_of_layers(found[view.name], view))
    return found


def faults_of_decomposition(
    method: ProbedMethod, made: Any, capture: Capture, rendered: Mapping[str, Arrays]
) -> Iterator[Fault]:
    """Yield faults beyond those of single arrays.

    Args:
        method: In its process.
        made: What it fitted.
        capture: To what.
        rendered: Its layers by the name of the view, as they came.
    """
    view = capture.test[0]
    if rendered.get(view.name):
        yield from _again(made, view, rendered[view.name])
        yield from _other_size(made, view, rendered[view.name])
    facts = method.facts()
    yield from faults_of_facts(facts)
    if (seconds := _is_slow(method)) is not None:
        size = f"{view.camera.width} x {view.camera.height}"
        yield Fault("slow", f"{seconds:.1f} s of processor time for a view of {size} pixels")


def _is_slow(method: ProbedMethod) -> float | None:
    """Return the least seconds of a view, where even they are too many."""
    found = [fact.number for fact in of_kind(method.facts(), "render-seconds")]
    return min(found) if found and min(found) > _SLOW_S else None


def _again(made: Any, view: View, before: Arrays) -> Iterator[Fault]:
    """Yield a fault if a view differs the second time, or if one layer alone is another."""
    try:
        after = made.render(view.camera, sorted(before))
        alone = made.render(view.camera, sorted(before)[:1])
    except GraycardError as error:
        yield fault_of(error, "layers")
        return
    if found := differences(before, after, _SAME) or differences(before, alone, _SAME):
        yield Fault("stateful", f"view {view.name}: {', '.join(found)}")


def _other_size(made: Any, view: View, usual: Arrays) -> Iterator[Fault]:
    """Yield a fault if twice the size is not rendered; a MethodError is a method's way to say that."""
    camera = view.camera
    matrix = camera.K * np.array([[2], [2], [1]])
    larger = Camera(2 * camera.width, 2 * camera.height, matrix, camera.camera_to_world)
    try:
        found = made.render(larger, sorted(made.provides))
    except GraycardError as error:
        if error.__cause__ is not None:
            yield replace(fault_of(error, "size"), name="size")
        return
    ours = {fault.name for fault in faults_of_layers(usual, view)}
    for fault in faults_of_layers(found, replace(view, camera=larger)):
        if fault.name not in ours:
            yield Fault("size", fault.found)


def lights_of(made: Any, faults: list[Fault]) -> tuple[Light, ...] | None:
    """Return the lights of a decomposition; what is wrong with them is added."""
    try:
        lights = made.lights()
        for light in lights or ():
            if isinstance(light, EnvironmentLight):
                faults += _of_environment(made, light)
    except GraycardError as error:
        faults.append(fault_of(error, "lights"))
        return None
    return lights


def _of_environment(made: Any, light: EnvironmentLight) -> Iterator[Fault]:
    """Yield a fault if an environment has no image, or one of another shape."""
    if not isinstance(made, Surrounded):
        yield Fault("lights", f"no environment(light) gives the image of {light.name!r}")
        return
    shape = np.shape(made.environment(light))
    if len(shape) != 3 or shape[2] != 3:
        yield Fault("lights", f"expected the image of {light.name!r} of shape (H, W, 3), got {shape}")


def faults_of_relighting(made: Any, capture: Capture, scene: Path) -> Iterator[Fault]:
    """Yield faults of relighting: twice the light is to give more radiance."""
    if not isinstance(made, Relightable):
        return
    lights, view, found = open_truth(scene / "truth", check=False).lights(), capture.test[0], []
    try:
        for factor in (1.0, _TWICE):
            relit = made.relight(brighter(lights, factor))
            if relit is None:
                return  # not provided
            layers = relit.render(view.camera, [PICTURES])
            yield from (Fault("relight", fault.found) for fault in faults_of_layers(layers, view))
            found.append(float(np.nanmean(usable(layers, view.camera)[PICTURES])))
    except GraycardError as error:
        yield fault_of(error, "relight")
        return
    except KeyError:
        yield Fault("relight", "what it gives renders no radiance that can be used")
        return
    if found[1] < _FOLLOWS * found[0]:
        yield Fault(
            "relight", f"twice the light gives {found[1] / max(found[0], 1e-12):.3g} times the radiance"
        )


def faults_of_removal(made: Any, capture: Capture) -> Iterator[Fault]:
    """Yield faults of removal on a capture with a target."""
    if not isinstance(made, Removable) or capture.target is None:
        return
    view = capture.test[0]
    try:
        without: Any = made.remove(capture.target)
        if without is None:
            yield Fault("remove", "remove gave None")
            return
        layers = without.render(view.camera, [PICTURES])
    except GraycardError as error:
        yield fault_of(error, "remove")
        return
    if PICTURES not in layers:
        yield Fault("remove", "what it gives renders no radiance")
    yield from (Fault("remove", fault.found) for fault in faults_of_layers(layers, view))


def faults_of_saving(made: Any, folder: Path) -> Iterator[Fault]:
    """Save a decomposition, and yield what is wrong with the files."""
    try:
        made.save(folder)
    except GraycardError as error:
        yield fault_of(error, "save")
        return
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    if not files:
        yield Fault("save", "save wrote no file")
    if pickles := [path.name for path in files if _is_pickle(path)]:
        yield Fault("pickle", ", ".join(pickles))


def _is_pickle(path: Path) -> bool:
    """Tell whether a file holds pickled objects: a pickle, what torch.save writes, or NPY of objects."""
    with path.open("rb") as file:
        head = file.read(_HEAD)
    if head[:1] == b"\x80" and head[1:2] in b"\x02\x03\x04\x05":
        return True
    if head.startswith(b"\x93NUMPY"):
        return b"'|O'" in head[:200]
    if not zipfile.is_zipfile(path):
        return False
    with zipfile.ZipFile(path) as parts:
        names = parts.namelist()
        return any(name.endswith(".pkl") for name in names) or any(
            b"'|O'" in parts.open(name).read(200) for name in names if name.endswith(".npy")
        )
