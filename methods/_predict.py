# SPDX-License-Identifier: Apache-2.0
"""From a decomposition to the predictions folder that is scored."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from graycard import (
    Capture,
    Composition,
    EnvironmentLight,
    Light,
    MethodError,
    Predictions,
    Progress,
    View,
    find_layer,
)
from graycard.layers import find_codes, find_fault, shape_of
from graycard.methods._blame import blame
from graycard.methods._contract import Composable, Decomposition, Guest, Relightable, Removable, Surrounded
from graycard.predictions import (
    finish_predictions,
    write_composed,
    write_environment,
    write_relit,
    write_view,
)


@dataclass(frozen=True, slots=True)
class Changes:
    """Changes that a fitted method shall show besides the scene as it is; nothing of it is seen in the
    fit.
    """

    relighting: Mapping[str, tuple[Light, ...]] = field(default_factory=dict)
    """The lights that shine after each change of them, by the name of the change."""
    composition: Composition | None = None
    """The object that is put in."""
    guest: Guest | None = None
    """That object as the method has fitted it where it comes from; None where it has not."""


def write_predictions(
    decomposition: Decomposition,
    capture: Capture,
    method: str,
    folder: Path,
    progress: Progress,
    changes: Changes | None = None,
) -> None:
    """Render every layer that a decomposition provides, for every view, and its lights.

    Training views are rendered too: gauges are fitted on them. If the scene has a target and the
    decomposition can remove objects, the radiance without the target is rendered as well; if it can be
    relit or be given another object, the held-out views after each change.

    Args:
        decomposition: What was fitted.
        capture: What it was fitted to.
        method: Its name.
        folder: The predictions folder.
        progress: Called now and then.
        changes: What it is to show besides; nothing if None.

    Raises:
        UnknownNameError: The decomposition provides a layer that is not in the vocabulary.
        MethodError: It is none, breaks, or does not give what it claims.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    with blame(method):
        check_decomposition(method, decomposition)
        without = _without_target(decomposition, capture)
    for done, view in enumerate(capture.views):
        progress(done / len(capture.views), f"rendering {view.name}")
        with blame(method):
            layers = _layers(decomposition, without, view)
        write_view(folder, view.name, layers)
    with blame(method):
        lights, images = lights_found(decomposition), _environments(decomposition)
    lights = lights and tuple(
        write_environment(folder, light, images[light.name]) if isinstance(light, EnvironmentLight) else light
        for light in lights
    )
    _write_changed(decomposition, capture, method, folder, changes or Changes(), progress)
    finish_predictions(folder, Predictions(method, capture.track, capture.scene), lights)


def _write_changed(
    decomposition: Decomposition,
    capture: Capture,
    method: str,
    folder: Path,
    changes: Changes,
    progress: Progress,
) -> None:
    if isinstance(decomposition, Relightable):
        for done, (edit, lights) in enumerate(changes.relighting.items()):
            progress(done / len(changes.relighting), f"relighting: {edit}")
            with blame(method):
                relit = decomposition.relight(lights)
            _write_held_out(relit, capture, method, partial(write_relit, folder, edit))
    if isinstance(decomposition, Composable) and changes.composition is not None:
        with blame(method):
            composed = decomposition.compose(changes.composition, changes.guest)
        _write_held_out(composed, capture, method, partial(write_composed, folder))


def _write_held_out(
    changed: Decomposition | None, capture: Capture, method: str, write: Callable[[str, np.ndarray], None]
) -> None:
    """Write the radiance of the held-out views; None is not provided."""
    if changed is None:
        return
    for view in capture.test:
        with blame(method):
            picture = _render(changed, view, ["radiance"])["radiance"]
        write(view.name, picture)


def _without_target(decomposition: Decomposition, capture: Capture) -> Decomposition | None:
    if capture.target is None or not isinstance(decomposition, Removable):
        return None
    return decomposition.remove(capture.target)


def _layers(decomposition: Decomposition, without: Decomposition | None, view: View) -> dict[str, np.ndarray]:
    layers = _render(decomposition, view, sorted(decomposition.provides))
    if without is not None:
        layers["counterfactual.radiance"] = _render(without, view, ["radiance"])["radiance"]
    return layers


def _render(decomposition: Decomposition, view: View, names: list[str]) -> dict[str, np.ndarray]:
    """Return exactly the layers that were asked for, of the right shape and type, and finite.

    Raises:
        MethodError: The decomposition gives others, or values that no file of predictions should hold.
    """
    rendered = decomposition.render(view.camera, names)
    if not isinstance(rendered, Mapping) or set(rendered) != set(names):
        got = sorted(rendered) if isinstance(rendered, Mapping) else rendered
        raise MethodError(f"expected the layers {names} of view {view.name}, got {got!r}")
    return {name: _checked(name, np.asarray(rendered[name]), view) for name in names}


def _checked(name: str, values: np.ndarray, view: View) -> np.ndarray:
    """Return the values of a layer in the type that is stored.

    Raises:
        MethodError: They have another shape, are whole numbers in place of measured ones, or not finite.
    """
    height, width = view.camera.height, view.camera.width
    shape, stored = shape_of(name, height, width), find_layer(name).dtype
    if values.shape != shape or values.dtype.kind not in "fiub":
        raise MethodError(
            f"expected {name} of view {view.name} as real numbers of shape {shape}, "
            f"got {values.dtype} of shape {values.shape}"
        )
    if fault := find_codes(name, values):
        raise MethodError(f"view {view.name}: {fault}")
    with np.errstate(over="ignore", invalid="ignore"):  # what float32 cannot hold is refused as infinite
        written = values.astype(stored, copy=False)
    if fault := find_fault(name, written, height, width):
        raise MethodError(
            f"view {view.name}: {fault}. Write 0 where nothing is seen (+inf in depth), or leave {name} out "
            "of `provides`"
        )
    return written


def check_decomposition(method: str, decomposition: Decomposition) -> None:
    """Refuse what is no decomposition.

    Raises:
        MethodError: A member is missing, or it provides nothing.
        UnknownNameError: It provides a layer that does not exist.
    """
    missing = [m for m in ("provides", "render", "lights", "save") if not hasattr(decomposition, m)]
    if missing:
        raise MethodError(
            f"expected fit of {method!r} to give a decomposition, got {decomposition!r} without "
            f"{', '.join(missing)}"
        )
    if not decomposition.provides:
        raise MethodError(f"expected the decomposition of {method!r} to provide a layer, got none")
    for name in decomposition.provides:
        find_layer(name)


def lights_found(decomposition: Decomposition) -> tuple[Light, ...] | None:
    """Return the lights of a decomposition; None where it does not look for any.

    Raises:
        MethodError: They are none.
    """
    lights = decomposition.lights()
    if lights is None:
        return None
    if not isinstance(lights, Sequence) or not all(isinstance(item, Light) for item in lights):
        raise MethodError(f"expected lights as a sequence of graycard lights or None, got {lights!r}")
    return tuple(lights)


def _environments(decomposition: Decomposition) -> dict[str, np.ndarray]:
    """Images of the environments among the lights, by name."""
    distant = [light for light in decomposition.lights() or () if isinstance(light, EnvironmentLight)]
    if not distant:
        return {}
    if not isinstance(decomposition, Surrounded):
        raise MethodError(
            f"expected a method environment(light) that gives the image of {distant[0].name!r}, got none"
        )
    found = {light.name: np.asarray(decomposition.environment(light)) for light in distant}
    for name, image in found.items():
        if image.ndim != 3 or image.shape[-1] != 3 or image.dtype.kind not in "fiu":
            raise MethodError(
                f"expected the image of {name!r} as real numbers of shape (H, W, 3), got {image.dtype} of "
                f"shape {image.shape}"
            )
        if fault := find_codes("radiance", image):
            raise MethodError(f"image of {name!r}: {fault}")
        if fault := find_fault("radiance", image, *image.shape[:2]):
            raise MethodError(f"image of {name!r}: {fault}. Give finite radiance of 0 or more")
    return found
