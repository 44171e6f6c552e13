# SPDX-License-Identifier: Apache-2.0
"""The tiny scene with what it lacks: shading, a shadow, gloss, effects of its target, changed lights."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from graycard import Composition, Donor, EnvironmentLight, LightEdit, PointLight, open_truth
from graycard.dataset import manifest_of, write_index
from graycard.edits import composed_file
from graycard.io import write_json, write_layers, write_manifest, write_rgb
from graycard.lights import write_lights

Layers = dict[str, np.ndarray]
EDITS = (
    LightEdit("without-lamp", "The lamp is switched off."),
    LightEdit("moved-lamp", "The lamp is moved."),
    LightEdit("recoloured-lamp", "The lamp is of another colour."),
    LightEdit("environment-1", "Other surroundings."),
)
SIGMA = 1e-3
EXPOSURE = 0.45
"""At which nothing in the pictures is white."""
DESK = PointLight("desk", (1.0, -2.0, 1.5), (2.0, 3.0, 4.0))
LAMP = PointLight("lamp", (0.3, -0.1, 0.0), (12.0, 10.0, 8.0), "camera")
SKY = EnvironmentLight("sky", "environment.exr")
EDITED_LIGHTS = (
    (DESK,),
    (replace(LAMP, position=(-0.3, 0.1, 0.0)), DESK),
    (replace(LAMP, intensity=(15.0, 8.0, 4.0)), DESK),
    (SKY,),
)
"""After each of the edits."""
DONOR = Donor("multilight", "objects", 3, {}, "pot", 5)
ADDED = 9
"""Id of the object that is put in."""


def enrich(scene: Path) -> Path:
    """Change the scene on disk: radiance is base_color · shading + gloss, plus noise of known size."""
    truth = open_truth(scene / "truth")
    manifest = manifest_of(truth)
    for number, view in enumerate(truth.views):
        layers = _lit(truth.layers(view), np.random.default_rng(number))
        write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers)
        if view.split == "test":
            _write_changed(scene / "truth", view.name, layers, np.random.default_rng(50 + number))
    for edit, lights in zip(EDITS, EDITED_LIGHTS, strict=True):
        write_lights(scene / "truth" / edit.folder / "lights.json", lights)
    write_rgb(scene / "truth" / EDITS[-1].folder / SKY.image, np.full((2, 4, 3), 0.5, np.float32))
    write_lights(scene / "truth" / "lights.json", (LAMP, DESK))
    write_json(scene / "truth" / "composition" / "composition.json", Composition(DONOR, np.eye(4), ADDED))
    write_index(scene / "truth", replace(truth, edits=EDITS, exposure=EXPOSURE))
    write_manifest(scene / "truth", manifest)
    return scene


def _lit(layers: Layers, rng: np.random.Generator) -> Layers:
    shape = layers["object_id"].shape
    column = np.linspace(0, 1, shape[1])[None, :, None] * np.ones((*shape, 3))
    in_shadow = (np.arange(shape[1]) % 12 < 5)[None] & np.ones(shape, bool)
    shading = (0.8 + 1.2 * column**2) * np.where(in_shadow, 0.2, 1)[..., None] * (1.0, 0.9, 0.8)
    base = np.maximum(layers["base_color"], 0.02) * (layers["object_id"] > 0)[..., None]
    gloss = np.where((np.arange(shape[0]) % 8 < 3)[:, None, None], 0.5, 0) * base * shading
    radiance = base * shading + gloss
    made = {
        "base_color": base,
        "shading": shading,
        "roughness": 0.2 + 0.5 * column[..., 0],
        "visibility.lamp": 1.0 - in_shadow,
        "direct.diffuse.lamp": base * shading,
        "direct.specular.lamp": gloss,
    }
    found = {k: v for k, v in layers.items() if not k.startswith("counterfactual")} | made
    found |= _noisy("radiance", radiance, rng)
    if any(k.startswith("counterfactual") for k in layers):
        found |= _without_target(found, radiance, rng)
    return {k: v if v.dtype == np.uint32 else v.astype(np.float32) for k, v in found.items()}


def _without_target(layers: Layers, radiance: np.ndarray, rng: np.random.Generator) -> Layers:
    footprint = layers["object_id"] == 3
    rows = np.arange(len(footprint))[:, None] * np.ones_like(footprint)
    shadow, mirror = (rows < 6) & ~footprint, (rows >= 18) & ~footprint
    change = np.select([footprint, shadow, mirror], [0.3, 0.1, -0.05], 0)[..., None]
    masks = {"footprint": footprint, "shadow": shadow, "mirror": mirror}
    without = np.maximum(radiance + change, 0)
    effects = {f"effect.{name}": mask.astype(np.float32) for name, mask in masks.items()}
    return effects | _noisy("counterfactual.radiance", without, rng)


def _noisy(name: str, values: np.ndarray, rng: np.random.Generator, sigma: float = SIGMA) -> Layers:
    """Two independent halves, their mean, and the variance of the mean."""
    a, b = (values + rng.normal(0, sigma * np.sqrt(2), values.shape) for _ in range(2))
    found = {name: (a + b) / 2, f"{name}.half_a": a, f"{name}.half_b": b}
    found[f"{name}.var"] = np.full_like(values, sigma**2)
    return {k: v.astype(np.float32) for k, v in found.items()}


def _write_changed(truth: Path, view: str, layers: Layers, rng: np.random.Generator) -> None:
    factors = ((0.3, 0.3, 0.3), (0.8, 0.8, 0.8), (1.2, 0.8, 0.5), (0.5, 0.6, 0.9))
    for edit, factor in zip(EDITS, factors, strict=True):
        relit = _noisy("radiance", layers["radiance"] * factor, rng)
        write_layers(truth / edit.view_file(view), relit)
    ids, picture = layers["object_id"].copy(), layers["radiance"].copy()
    ids[5:12, 8:15], picture[5:12, 8:15] = ADDED, 0.4
    composed = _noisy("radiance", picture, rng) | {"object_id": ids}
    write_layers(truth / composed_file(view), composed)
