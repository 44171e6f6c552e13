# SPDX-License-Identifier: Apache-2.0
"""True layers that a source brings along become the truth of an imported scene."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from graycard._capture import Capture
from graycard._truth import SceneObject, Truth
from graycard.dataset import write_index
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._develop import develop, develop_mask
from graycard.exchange._doctor import ImportRow, some
from graycard.exchange._plan import ImportPlan
from graycard.exchange._tensoir import has_true_layers, read_truth_layers
from graycard.io import FORMAT_VERSION, Manifest, write_layers, write_manifest
from graycard.lights import write_lights

OBJECT = SceneObject(1, "object", False)


def write_given_truth(
    plan: ImportPlan, capture: Capture, folder: Path, generator: dict[str, Any]
) -> list[ImportRow]:
    """Write the truth of a plan's views.

    Args:
        plan: Some of its held-out shots have layers.
        capture: As it was imported.
        folder: Where to: the truth of a scene that is not yet whole.
        generator: Who made it, for the manifest.

    Returns:
        Rows that say which layers there are, and which views have none.

    Raises:
        DatasetError: A layer is missing, broken or of another size.
        OutputError: The folder cannot be written to.
    """

    def keep(shot: PosedPhotograph, layers: dict[str, np.ndarray]) -> None:
        write_layers(folder / f"views/{shot.name}.exr", layers)

    rows = develop_given_truth(plan, keep)
    places = np.array([view.camera.position for view in capture.views])
    diameter = float(np.linalg.norm(np.ptp(places, axis=0)))
    truth = Truth(capture.track, capture.scene, capture.views, capture.exposure, diameter, (OBJECT,))
    write_index(folder, truth)
    write_lights(folder / "lights.json", ())
    scene = capture.track, capture.scene
    write_manifest(folder, Manifest("graycard-truth", FORMAT_VERSION, *scene, generator, {}, plan.settings))
    return rows


def develop_given_truth(
    plan: ImportPlan, keep: Callable[[PosedPhotograph, dict[str, np.ndarray]], None]
) -> list[ImportRow]:
    """Read the true layers of a plan's views and hand them on, one view after the other.

    A view without those that scores need has no object that is seen, so that nothing in it is judged.

    Args:
        plan: It names the files.
        keep: Called with the layers of each view, as its camera sees them, where there is any truth.

    Returns:
        As of :func:`write_given_truth`.

    Raises:
        DatasetError: As of :func:`write_given_truth`.
    """
    known = [shot for shot in plan.shots if shot.layers]
    if not plan.has_truth:
        said = "left out: no held-out view has both albedo.png and normal.png, which scores need"
        return [ImportRow("true layers", len(known), said, warns=True)] if known else []
    names: dict[str, None] = {}
    lacking = [shot.name for shot in plan.shots if not has_true_layers(shot)]
    for shot in plan.shots:
        if shot.name not in lacking:
            layers = _developed(read_truth_layers(shot, plan.pictures.options.background), shot)
            names |= dict.fromkeys(layers)
        else:
            layers = _nothing_seen(shot)
        keep(shot, layers)
    said = f"kept as truth: {', '.join(names)}; lights are not known, albedo.png is taken as linear"
    rows = [ImportRow("true layers", len(plan.shots) - len(lacking), said)]
    if lacking:
        told = f"none, or not those that scores need, in {some(lacking)}: nothing in these views is judged"
        rows.append(ImportRow("true layers", len(lacking), told, warns=True))
    return rows


def _nothing_seen(shot: PosedPhotograph) -> dict[str, np.ndarray]:
    size = shot.camera.height, shot.camera.width
    return {"radiance": np.zeros((*size, 3), np.float32), "object_id": np.zeros(size, np.uint32)}


def _developed(layers: dict[str, np.ndarray], shot: PosedPhotograph) -> dict[str, np.ndarray]:
    """Return layers at the size of the shot's camera: means over what is seen, and normals of unit length."""
    seen = layers["object_id"] > 0
    if seen.shape == (shot.camera.height, shot.camera.width):
        return layers
    share = np.maximum(develop(seen.astype(np.float32), shot), 1e-6)[..., None]
    kept = develop_mask(seen, shot)
    found = {"radiance": develop(layers["radiance"], shot), "object_id": kept.astype(np.uint32)}
    for name in layers.keys() - found.keys():
        values = np.where(kept[..., None], develop(layers[name], shot) / share, 0)
        if name == "normal":
            values = values / np.maximum(np.linalg.norm(values, axis=-1, keepdims=True), 1e-6)
        found[name] = values.astype(np.float32)
    return found
