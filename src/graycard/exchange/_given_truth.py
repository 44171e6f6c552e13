# SPDX-License-Identifier: Apache-2.0
"""True layers that a source brings along become the truth of an imported scene."""

from pathlib import Path
from typing import Any

import numpy as np

from graycard._capture import Capture
from graycard._truth import SceneObject, Truth
from graycard.dataset import write_index
from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._develop import develop, develop_mask
from graycard.exchange._doctor import ImportRow
from graycard.exchange._plan import ImportPlan
from graycard.exchange._tensoir import read_truth_layers
from graycard.io import FORMAT_VERSION, Manifest, atomic_folder, write_layers, write_manifest
from graycard.lights import write_lights

OBJECT = SceneObject(1, "object", False)


def write_given_truth(plan: ImportPlan, capture: Capture, out: Path, generator: dict[str, Any]) -> ImportRow:
    """Write the truth of a plan's views.

    Args:
        plan: Each of its shots has layers.
        capture: As it was imported.
        out: ``DATASET/<track>/<scene>/truth``.
        generator: Who made it, for the manifest.

    Returns:
        A row that says which layers there are.

    Raises:
        DatasetError: A layer is missing, broken or of another size.
        OutputError: The folder cannot be written to.
    """
    names: dict[str, None] = {}
    with atomic_folder(out) as folder:
        for shot in plan.shots:
            layers = _developed(read_truth_layers(shot, plan.pictures.options.background), shot)
            names |= dict.fromkeys(layers)
            write_layers(folder / f"views/{shot.name}.exr", layers)
        places = np.array([view.camera.position for view in capture.views])
        diameter = float(np.linalg.norm(np.ptp(places, axis=0)))
        objects = (OBJECT,)
        truth = Truth(capture.track, capture.scene, capture.views, capture.exposure, diameter, objects)
        write_index(folder, truth)
        write_lights(folder / "lights.json", ())
        write_manifest(
            folder,
            Manifest(
                "graycard-truth", FORMAT_VERSION, capture.track, capture.scene, generator, {}, plan.settings
            ),
        )
    said = f"kept as truth: {', '.join(names)}; lights are not known, albedo.png is taken as linear"
    return ImportRow("true layers", len(plan.shots), said)


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
