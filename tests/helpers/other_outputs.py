# SPDX-License-Identifier: Apache-2.0
"""Outputs of other code: folders as published programs write them, made of graycard's own predictions."""

import gzip
import io
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import colour
import numpy as np
from PIL import Image

from graycard import Capture, Predictions, View, open_capture, open_predictions, open_truth
from graycard.dataset import manifest_of, write_index
from graycard.io import write_layers, write_manifest
from graycard.predictions import finish_predictions, write_view

Layers = Mapping[str, np.ndarray]
Writer = Callable[[Path, Path, Path], None]
LAYERS = ("radiance", "base_color", "normal", "depth", "roughness", "metallic")


def encode(linear: np.ndarray) -> np.ndarray:
    """Return sRGB values by colour-science, which cuts nothing off."""
    return np.asarray(colour.models.eotf_inverse_sRGB(linear))


def decode(display: np.ndarray) -> np.ndarray:
    return np.asarray(colour.models.eotf_sRGB(display))


def codes(values: np.ndarray) -> np.ndarray:
    """Return 8-bit codes as torchvision's save_image rounds them."""
    return np.clip(np.floor(values * 255 + 0.5), 0, 255).astype(np.uint8)


def add_metal(scene: Path) -> Path:
    """Give the truth of a scene a metallic layer, and its capture the truth's exposure."""
    truth, capture = open_truth(scene / "truth"), open_capture(scene / "capture")
    write_index(scene / "capture", replace(capture, exposure=truth.exposure))
    write_manifest(scene / "capture", manifest_of(capture))
    for view in truth.views:
        layers = dict(truth.layers(view))
        rows = np.linspace(0, 1, layers["depth"].shape[0], dtype=np.float32)[:, None]
        layers["metallic"] = rows * np.ones_like(layers["depth"])
        write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers)
    write_manifest(scene / "truth", manifest_of(truth))
    return scene


def write_own(folder: Path, scene: Path, keep: tuple[str, ...] = LAYERS, strength: float = 0.02) -> Path:
    """Write predictions near to the truth in graycard's own format."""
    truth, rng = open_truth(scene / "truth"), np.random.default_rng(3)
    for view in truth.views:
        found = {name: truth.layers(view)[name] for name in keep}
        write_view(folder, view.name, {name: _near(name, v, rng, strength) for name, v in found.items()})
    finish_predictions(folder, Predictions("mine", truth.track, truth.scene))
    return folder


def _near(name: str, values: np.ndarray, rng: np.random.Generator, strength: float) -> np.ndarray:
    finite = np.where(np.isfinite(values), values, 9.0)
    changed = finite * (1 + strength * rng.normal(size=values.shape))
    if name in ("base_color", "roughness", "metallic"):
        changed = np.clip(changed, 0, 1)
    if name == "normal":
        changed /= np.maximum(np.linalg.norm(changed, axis=-1, keepdims=True), 1e-9)
    return changed.astype(np.float32)


def rewritten(folder: Path, own: Path, change: Callable[[str, np.ndarray], np.ndarray]) -> Path:
    """Write predictions again with each layer changed."""
    found = open_predictions(own)
    for view in found.view_names():
        layers = {name: change(name, values) for name, values in found.layers(view).items()}
        write_view(folder, view, {name: values.astype(np.float32) for name, values in layers.items()})
    finish_predictions(folder, Predictions(found.method, found.track, found.scene))
    return folder


def numbered(own: Path, scene: Path) -> Iterator[tuple[View, int, Layers, Capture]]:
    """Yield each view with its number in its split and its predicted layers."""
    capture, found = open_capture(scene / "capture"), open_predictions(own)
    for views in (capture.train, capture.test):
        for number, view in enumerate(views):
            yield view, number, found.layers(view.name), capture


def save(path: Path, values: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(values).save(path)


def _grey(values: np.ndarray) -> np.ndarray:
    return np.repeat(values[..., None], 3, axis=-1)


def write_nerfstudio(folder: Path, own: Path, scene: Path) -> None:
    """Write ``ns-render dataset --rendered-output-names raw-rgb raw-depth``."""
    for view, _, layers, capture in numbered(own, scene):
        made = {"rgb": encode(layers["radiance"] * capture.exposure), "depth": layers["depth"][..., None]}
        for name, values in made.items():
            path = folder / view.split / f"raw-{name}" / f"{view.name}.npy.gz"
            path.parent.mkdir(parents=True, exist_ok=True)
            packed = io.BytesIO()
            np.save(packed, values.astype(np.float32))
            path.write_bytes(gzip.compress(packed.getvalue()))


def write_2dgs(folder: Path, own: Path, scene: Path) -> None:
    """Write render.py of 2D Gaussian Splatting."""
    for view, number, layers, capture in numbered(own, scene):
        place = folder / view.split / "ours_30000"
        save(place / "renders" / f"{number:05d}.png", codes(encode(layers["radiance"] * capture.exposure)))
        save(place / "vis" / f"normal_{number:05d}.png", codes(layers["normal"] * 0.5 + 0.5))
        save(place / "vis" / f"depth_{number:05d}.tiff", layers["depth"].astype(np.float32))


def write_gs_ir(folder: Path, own: Path, scene: Path) -> None:
    """Write render.py of GS-IR with --pbr --gamma."""
    for view, number, layers, capture in numbered(own, scene):
        place = folder / view.split / "ours_None"
        brdf = [layers["base_color"], _grey(layers["roughness"]), _grey(layers["metallic"])]
        save(place / "pbr" / f"{number:05d}_brdf.png", codes(np.concatenate(brdf, axis=1)))
        save(place / "pbr" / f"{number:05d}.png", codes(encode(layers["radiance"] * capture.exposure)))
        save(place / "normal" / f"{number:05d}_normal.png", codes((layers["normal"] + 1) / 2))
        save(place / "normal" / f"{number:05d}_from_depth.png", codes((layers["normal"] + 1) / 3))


def write_r3dg(folder: Path, own: Path, scene: Path) -> None:
    """Write eval_nvs.py of Relightable 3D Gaussian."""
    for view, number, layers, capture in numbered(own, scene):
        place = folder / view.split / "ours_40000"
        save(place / "renders" / f"{number:05d}.png", codes(encode(layers["radiance"] * capture.exposure)))
        save(place / "base_color" / f"{number:05d}.png", codes(encode(layers["base_color"])))
        save(place / "roughness" / f"{number:05d}.png", codes(_grey(layers["roughness"])))
        save(place / "normal" / f"{number:05d}.png", codes(layers["normal"] * 0.5 + 0.5))


def write_tensoir(folder: Path, own: Path, scene: Path) -> None:
    """Write imgs_test_all of TensoIR."""
    for view, number, layers, capture in numbered(own, scene):
        if view.split != "test":
            continue
        picture, name = codes(encode(layers["radiance"] * capture.exposure)), f"080000_{number:03d}"
        base, normal = codes(layers["base_color"]), codes(layers["normal"] * 0.5 + 0.5)
        rough, other = codes(_grey(layers["roughness"])), np.zeros_like(picture)
        save(folder / "nvs_with_brdf" / f"{name}.png", np.concatenate([picture, other], axis=1))
        save(folder / "brdf" / f"{name}.png", np.concatenate([base, rough, other], axis=1))
        save(folder / "brdf" / f"{name}_albedo.png", np.concatenate([other, other, other], axis=1))
        save(folder / "normal" / f"{name}.png", np.concatenate([normal, other, other, other], axis=1))
