# SPDX-License-Identifier: Apache-2.0
"""The layout of NeRFactor and TensoIR: a folder a view, with its camera, its photograph and its true layers.

``<split>_<number>/metadata.json`` (``cam_angle_x``, ``cam_transform_mat``, ``imw``, ``imh``), ``rgba.png`` or
``rgba_<light>.png``, ``albedo.png`` (linear, 8 bits) and ``normal.png`` (world, as (n + 1) / 2).
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from graycard._capture import Capture, View
from graycard._errors import DatasetError
from graycard._truth import Truth
from graycard.colour import srgb_encode
from graycard.exchange._blender import angle_of
from graycard.exchange._cameras import PosedPhotograph, make_shot
from graycard.exchange._doctor import ImportRow, some
from graycard.exchange._lens import make_intrinsics
from graycard.exchange._nerfstudio import FLIP
from graycard.exchange._photographs import write_png
from graycard.exchange.pictures import Background, Pixels, find_photographs, read_photograph, read_pixels
from graycard.io import read_json, write_json

METADATA = "metadata.json"
_FOLDER = re.compile(r"(train|val|test)_\d+")
_LAYERS = {"albedo.png": "base_color", "normal.png": "normal"}
"""Files whose meaning a truth folder can hold, by graycard's names."""


@dataclass(frozen=True, slots=True)
class TensoirFolder:
    """The shots of a folder."""

    shots: tuple[PosedPhotograph, ...]
    rows: tuple[ImportRow, ...]


def view_folders(folder: Path) -> list[Path]:
    """Return the folders of views, sorted; none where a folder is not of this layout."""
    if not folder.is_dir():
        return []
    found = (p for p in folder.iterdir() if _FOLDER.fullmatch(p.name) and (p / METADATA).is_file())
    return sorted(found)


def read_tensoir(folder: Path, light: str | None) -> TensoirFolder:
    """Read cameras, and find photographs and true layers, which are not yet looked at.

    Args:
        folder: It has folders of views.
        light: Under which light; None for ``rgba.png``, else the first by name.

    Raises:
        DatasetError: A file is malformed, or there is no photograph under the light.
    """
    places = view_folders(folder)
    lights = sorted({p.stem for place in places for p in place.glob("rgba*.png")})
    wanted = light if light is not None else next(iter(lights), "rgba")
    if wanted not in lights and f"rgba_{wanted}" in lights:
        wanted = f"rgba_{wanted}"
    if lights and wanted not in lights:
        raise DatasetError(
            f"expected photographs {wanted}.png in {folder}, got {', '.join(lights)}. Mend --model"
        )
    shots, left = [], Counter[str]()
    for place in places:
        shots.append(_shot(place, f"{wanted}.png"))
        known = {METADATA, f"{wanted}.png", *_LAYERS}
        left.update(p.name for p in place.iterdir() if p.name not in known and p.name[0] != ".")
    rows = [ImportRow("lights", len(lights), f"in the folder; taken is {wanted}: --model chooses")]
    if left:
        said = f"files of views left out, as no truth holds what they mean: {some(sorted(left))}"
        rows.append(ImportRow("layers", sum(left.values()), said))
    return TensoirFolder(tuple(shots), tuple(rows if len(lights) > 1 else rows[1:]))


def read_truth_layers(shot: PosedPhotograph, background: Background) -> dict[str, np.ndarray]:
    """Return the true layers of a view at the size of its files: light, colours, normals and what is seen.

    Args:
        shot: It has layers.
        background: What is behind transparent pixels.

    Raises:
        DatasetError: A file is missing, broken, or of another size than its camera.
    """
    names = ["", *shot.layers]
    found = find_photographs([(path, shot.size) for path in (shot.image, *shot.layers.values())], "stored")
    seen = _seen(read_pixels(found[0].path), shot.size)
    layers = {"radiance": read_photograph(found[0], background).light, "object_id": seen.astype(np.uint32)}
    for name, picture in zip(names[1:], found[1:], strict=True):
        pixels = read_pixels(picture.path)
        levels = np.asarray(pixels.values, np.float32) / np.float32(pixels.top)
        levels = levels if levels.ndim == 3 else np.repeat(levels[..., None], 3, axis=-1)
        layers[name] = np.where(seen[..., None], _meaning(name, levels), 0).astype(np.float32)
    return layers


def has_true_layers(shot: PosedPhotograph) -> bool:
    """Tell whether a view has the true layers that scores need: colours, and normals where it is held out."""
    return {"base_color", *(["normal"] if shot.held_out else [])} <= shot.layers.keys()


def _seen(pixels: Pixels, size: tuple[int, int]) -> np.ndarray:
    """Return where a picture is rather opaque than not, shape ``(H, W)``, bool."""
    if pixels.alpha is None:
        return np.ones(size[::-1], bool)
    return pixels.alpha > 0.5 * pixels.top


def write_tensoir(capture: Capture, truth: Truth | None, folder: Path) -> None:
    """Write a scene with its truth as TensoIR reads it: photographs of held-out views too, as there is truth.

    Args:
        capture: Cameras and photographs.
        truth: Of the same scene; without it training photographs are all that is written.
        folder: Where to.

    Raises:
        DatasetError: Cameras are no plain ones, or a file is missing or broken.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    angle_of([view.camera for view in capture.views])
    numbers = {view.name: i for views in (capture.train, capture.test) for i, view in enumerate(views)}
    for view in capture.views if truth else capture.train:
        place = folder / f"{view.split}_{numbers[view.name]:03d}"
        layers = truth.layers(view) if truth else {"radiance": capture.photograph(view)}
        _write_view(place, view, layers, capture)


def _write_view(place: Path, view: View, layers: Mapping[str, np.ndarray], capture: Capture) -> None:
    light = capture.photograph(view) if view.split == "train" else layers["radiance"]
    seen = layers["object_id"] > 0 if "object_id" in layers else np.ones(light.shape[:2], bool)
    write_png(place / "rgba.png", _rgba(srgb_encode(light * capture.exposure), seen))
    if "base_color" in layers:
        write_png(place / "albedo.png", _rgba(layers["base_color"], seen))
    if "normal" in layers:
        write_png(place / "normal.png", _rgba((layers["normal"] + 1) / 2, seen))
    camera = view.camera
    matrix = camera.camera_to_world @ FLIP
    metadata = {
        "cam_angle_x": angle_of([camera]),
        "cam_transform_mat": ",".join(repr(float(x)) for x in matrix.ravel()),
        "envmap": "",
        "envmap_inten": 0,
        "imh": camera.height,
        "imw": camera.width,
        "scene": capture.scene,
        "spp": 0,
        "view": view.name,
    }
    write_json(place / METADATA, metadata)


def _rgba(values: np.ndarray, seen: np.ndarray) -> np.ndarray:
    levels = np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8)
    return np.dstack([levels, np.where(seen, 255, 0).astype(np.uint8)])


def _shot(place: Path, photograph: str) -> PosedPhotograph:
    path = place / METADATA
    entry = read_json(path, DatasetError)
    if not isinstance(entry, dict):
        raise DatasetError(f"expected an object in {path}, got {type(entry).__name__}")
    angle, w, h = (_number(entry, key, path) for key in ("cam_angle_x", "imw", "imh"))
    size = int(w), int(h)
    focal = 0.5 * w / np.tan(0.5 * angle) if 0 < angle < np.pi else 0.0
    intrinsics = make_intrinsics("PINHOLE", size, (focal, focal, w / 2, h / 2), str(path))
    shot = make_shot(place / photograph, place.name, intrinsics, _pose(entry, path), str(path))
    layers = {name: place / file for file, name in _LAYERS.items() if (place / file).is_file()}
    return replace(shot, held_out=not place.name.startswith("train"), cutout=True, layers=layers)


def _number(entry: Mapping[str, Any], key: str, path: Path) -> float:
    value = entry.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DatasetError(f"expected {key} as a number in {path}, got {value!r}. Add it")
    return float(value)


def _pose(entry: Mapping[str, Any], path: Path) -> np.ndarray:
    given = entry.get("cam_transform_mat")
    try:
        numbers: Sequence[float] = [float(x) for x in given.split(",")] if isinstance(given, str) else []
    except ValueError:
        numbers = []
    if len(numbers) != 16:
        raise DatasetError(f"expected cam_transform_mat as 16 numbers with commas in {path}, got {given!r}")
    return np.array(numbers).reshape(4, 4) @ FLIP


def _meaning(layer: str, levels: np.ndarray) -> np.ndarray:
    """Return a layer from the levels of its picture, 0 to 1."""
    if layer != "normal":
        return levels
    vectors = 2 * levels - 1
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-6)
