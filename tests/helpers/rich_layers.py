# SPDX-License-Identifier: Apache-2.0
"""The tiny scene with all layers of material and light, three lights, and a ball that is a colour chart."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from graycard import EnvironmentLight, RectangleLight, SpotLight, open_truth
from graycard.dataset import manifest_of, write_index
from graycard.io import write_layers, write_manifest, write_rgb
from graycard.layers import PARTS, glossy_mask
from graycard.lights import write_lights

Layers = dict[str, np.ndarray]
LAMPS = (
    SpotLight("left", (-1.0, 0.0, 2.0), (0.5, 0.0, -1.0), (5.0, 4.0, 3.0), 20, 40),
    RectangleLight("right", (1.0, 0.5, 2.0), (0.2, 0, 0), (0, -0.2, 0), (30.0, 20.0, 10.0)),
)
SKY = EnvironmentLight("sky", "sky.exr")
NAMES = ("left", "right", "sky")
PATCHES = np.array([(0.6, 0.1, 0.1), (0.1, 0.5, 0.2), (0.1, 0.2, 0.6)])
EXACT = ("object_id", "pure", "radiance.var", "counterfactual.radiance.var")


def enriched(layers: Layers) -> Layers:
    """More true layers for a view of the tiny scene: a mixed metal, and three lights with uneven shares."""
    color, metal = layers["base_color"].copy(), (layers["object_id"] == 1).astype(np.float32)
    ball, columns = layers["object_id"] == 2, np.arange(color.shape[1])[None] + 0 * layers["object_id"]
    color[ball] = PATCHES[(columns[ball] * 3 // color.shape[1]).astype(int)]
    rough = np.where(metal > 0, 0.3, 1.0).astype(np.float32)
    more = {
        "base_color": color,
        "diffuse_reflectance": color * (1 - 0.5 * metal[..., None]),
        "albedo": color * 0.9 + 0.02,
        "f0": np.repeat(metal[..., None], 3, axis=-1) * 0.5,
        "roughness": rough,
        "metallic": metal,
        "shading": layers["radiance"] * 2 + 0.1,
    }
    for share, name in zip((0.5, 0.3, 0.2), NAMES, strict=True):
        more[f"irradiance.{name}"] = layers["radiance"] * (share * 6)
        for part, of in zip(PARTS, (0.5, 0.15, 0.3, 0.05), strict=True):
            more[f"{part}.{name}"] = layers["radiance"] * (share * of)
    return layers | {k: v.astype(np.float32) for k, v in more.items()}


def glossy_in(layers: Layers) -> np.ndarray:
    return glossy_mask(layers["object_id"], layers["roughness"], layers["f0"])


def write_rich(tiny: Path, folder: Path) -> Path:
    """Copy the tiny multilight scene to a folder, enrich the copy, and return its folder."""
    shutil.copytree(tiny, folder)
    truth = open_truth(folder / "truth")
    for view in truth.views:
        write_layers(folder / "truth" / "views" / f"{view.name}.exr", enriched(truth.layers(view)))
    objects = tuple(replace(o, name="color chart") if o.id == 2 else o for o in truth.objects)
    write_index(folder / "truth", replace(truth, objects=objects))
    write_rgb(folder / "truth" / "sky.exr", np.random.default_rng(12).uniform(0.2, 2, (8, 16, 3)))
    write_lights(folder / "truth" / "lights.json", (*LAMPS, SKY))
    write_manifest(folder / "truth", manifest_of(truth))
    return folder
