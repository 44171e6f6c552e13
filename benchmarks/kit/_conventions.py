# SPDX-License-Identifier: Apache-2.0
"""Conventions that layers and lights mistake, found by the truth of the tiny scene."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from graycard import Capture, Light, Predictions, Truth, View, open_predictions, open_truth
from graycard.benchmarks.kit._faults import Fault
from graycard.eval import find_hints, light_hints
from graycard.lights import EnvironmentLight
from graycard.predictions import finish_predictions, write_view

_FACING, _TURNED = 0.5, 0.9
"""Share of normals that face the camera: below the first in the world's axes, above the second in others."""
_HINTS = (
    ("normal", "unit length", "normal-length"),
    ("normal", "(n + 1) / 2", "normal-code"),
    ("normal", "2 n - 1", "normal-code"),
    ("normal", "", "normal-axes"),
    ("depth", "scaled", "depth-scale"),
    ("depth", "metres", "depth-scale"),
    ("depth", "", "depth-kind"),
    ("roughness", "", "roughness"),
    ("", "B, G, R", "channel-order"),
    ("", "0 to 255", "range"),
    ("", "π", "factor"),
    ("", "sRGB", "encoding"),
    ("", "decoded twice", "encoding"),
    ("", "exposure", "exposure"),
)
"""Layer and words of a hint about single pixels, and the name of the fault; the first that fits holds."""
_LIGHT_HINTS = {"light.position": "light-frame", "light.intensity": "light-unit"}

Rendered = Mapping[str, Mapping[str, np.ndarray]]
"""Layers by the name of their view."""


def write_rendered(
    rendered: Rendered, lights: tuple[Light, ...] | None, capture: Capture, folder: Path
) -> None:
    """Write what was rendered as predictions of a scene; images of environments are left out."""
    for view in capture.views:
        if rendered.get(view.name):
            write_view(folder, view.name, rendered[view.name])
    local = None if lights is None else tuple(x for x in lights if not isinstance(x, EnvironmentLight))
    finish_predictions(folder, Predictions("checked", capture.track, capture.scene), local)


def faults_of_conventions(predictions: Path, scene: Path) -> Iterator[Fault]:
    """Yield the conventions that predictions mistake.

    Args:
        predictions: The predictions folder.
        scene: ``DATASET/<track>/<scene>``, with truth.
    """
    truth = open_truth(scene / "truth", check=False)
    found = open_predictions(predictions)
    hints = find_hints(predictions, scene)
    faults = [Fault(_name_of(hint.layer, hint.says), hint.says) for hint in hints]
    if pictures := [fault for fault in faults if fault.name == "pictures"]:
        yield from pictures  # all else is said of pixels that are others
        return
    yield from faults
    if not any(hint.layer == "normal" for hint in hints):
        yield from _facing(found, truth)
    for score, says in light_hints(found, truth):
        yield Fault(_LIGHT_HINTS.get(score, "lights"), says)


def _name_of(layer: str, says: str) -> str:
    """Return the name of the fault that a hint tells of: of whole pictures if nothing else fits."""
    if any(words in says for words in ("mirrored: ", "exchanged", "moved", "rounded", "clipped", "removed")):
        return "pictures"
    return next((name for of, words, name in _HINTS if of in ("", layer) and words in says), "pictures")


def _facing(found: Predictions, truth: Truth) -> Iterator[Fault]:
    """Yield a fault if normals face the camera in its own axes and not in the world's: no truth is needed."""
    shares = [
        share
        for view in truth.views
        if view.name in found.view_names()
        and (normal := found.layers(view.name).get("normal")) is not None
        and (share := _shares(normal, view, truth)) is not None
    ]
    if not shares:
        return
    world, opencv, opengl = np.mean(shares, axis=0)
    if world < _FACING and max(opencv, opengl) > _TURNED:
        axes = "OpenCV (x right, y down)" if opencv > opengl else "OpenGL (x right, y up)"
        yield Fault("normal-axes", f"normals face the camera in camera axes, {axes}, and not in the world's")


def _shares(normal: np.ndarray, view: View, truth: Truth) -> tuple[float, float, float] | None:
    """Return shares of normals that face the camera, taken as the world's, as OpenCV's and as OpenGL's."""
    seen = np.asarray(truth.layers(view)["object_id"]) > 0
    if not seen.any():
        return None
    rays, turned = view.camera.rays()[seen], view.camera.camera_to_world[:3, :3]
    given = normal[seen]
    ways = given, given @ turned.T, (given * (1, -1, -1)) @ turned.T
    world, opencv, opengl = (float(((n * rays).sum(-1) < 0).mean()) for n in ways)
    return world, opencv, opengl
