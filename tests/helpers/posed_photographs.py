# SPDX-License-Identifier: Apache-2.0
"""A room of numpy's, photographed through any lens, with the models that COLMAP's own code writes of it."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from graycard import look_at, srgb_encode

LENSES: dict[str, list[float]] = {
    "SIMPLE_PINHOLE": [90, 60, 40],
    "PINHOLE": [90, 92, 61, 39],
    "SIMPLE_RADIAL": [90, 60, 40, -0.12],
    "RADIAL": [90, 60, 40, -0.15, 0.05],
    "OPENCV": [90, 92, 61, 39, -0.2, 0.1, 0.002, -0.004],
    "OPENCV_FISHEYE": [60, 61, 60, 40, 0.03, -0.01, 0.002, 0.001],
    "FULL_OPENCV": [90, 92, 61, 39, -0.2, 0.1, 0.002, -0.004, 0.02, 0.05, -0.03, 0.01],
    "FOV": [80, 81, 60, 40, 0.6],
    "SIMPLE_RADIAL_FISHEYE": [60, 60, 40, 0.05],
    "RADIAL_FISHEYE": [60, 60, 40, 0.05, -0.02],
    "THIN_PRISM_FISHEYE": [60, 61, 60, 40, 0.03, -0.01, 0.001, -0.002, 0.002, 0.001, 0.001, -0.001],
    "SIMPLE_DIVISION": [90, 60, 40, -0.1],
    "FISHEYE": [60, 61, 60, 40],
}
"""Parameters of camera models, as COLMAP orders them, for photographs of :data:`SIZE`."""
SIZE = 120, 80
Points = np.ndarray


def poses(count: int) -> list[np.ndarray]:
    """Camera to world of some views of the origin, each ``(4, 4)``, OpenCV axes."""
    places = [np.array([0.4 * i - 0.2 * count, -3.0, 0.8 + 0.1 * i]) for i in range(count)]
    return [look_at(place, np.array([0.0, 0.0, 0.1 * i])) for i, place in enumerate(places)]


def light(directions: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Linear light of a striped plane y = 0 along directions in camera axes: ``(..., 2)`` to ``(..., 3)``."""
    rays = np.concatenate([directions, np.ones((*directions.shape[:-1], 1))], axis=-1) @ pose[:3, :3].T
    places = pose[:3, 3] - rays * (pose[1, 3] / rays[..., 1:2])
    x, z = places[..., 0], places[..., 2]
    waves = [0.5 + 0.4 * np.sin(2 * x + 1.5 * z), 0.4 + 0.3 * np.sin(3 * z), 0.3 + 0.2 * np.cos(2.5 * x)]
    return np.stack(waves, axis=-1)


def photograph(camera: Any, pose: np.ndarray) -> np.ndarray:
    """Return the view of a camera of pycolmap, ``(H, W, 3)``, 8-bit sRGB; COLMAP's code gives the rays."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    pixels = np.column_stack([x.ravel(), y.ravel()])
    directions = np.asarray(camera.cam_from_img(pixels)).reshape(camera.height, camera.width, 2)
    return np.rint(255 * srgb_encode(light(directions, pose))).astype(np.uint8)


def reconstruct(
    lenses: Sequence[tuple[str, list[float]]],
    size: tuple[int, int] = SIZE,
    name: str = "walk one/IMG {:02d}.JPG",
) -> Any:
    """A reconstruction of pycolmap: a camera, an image and a pose for each lens, and points on the plane."""
    import pycolmap

    found, where = pycolmap.Reconstruction(), poses(len(lenses))
    rng = np.random.default_rng(5)
    places = np.column_stack([rng.uniform(-0.8, 0.8, 12), np.zeros(12), rng.uniform(-0.4, 0.6, 12)])
    tracks: list[list[tuple[int, int]]] = [[] for _ in places]
    for number, ((model, numbers), pose) in enumerate(zip(lenses, where, strict=True), 1):
        camera = pycolmap.Camera(model=model, width=size[0], height=size[1], params=numbers, camera_id=number)
        found.add_camera_with_trivial_rig(camera)
        inverse = np.linalg.inv(pose)
        local = places @ inverse[:3, :3].T + inverse[:3, 3]
        pixels = np.asarray(camera.img_from_cam(local))
        image = pycolmap.Image(name=name.format(number), image_id=number, camera_id=number, keypoints=pixels)
        found.add_image_with_trivial_frame(image, pycolmap.Rigid3d(inverse[:3]))
        for point, track in enumerate(tracks):
            track.append((number, point))
    for point, (place, track) in enumerate(zip(places, tracks, strict=True)):
        elements = pycolmap.Track()
        for image, keypoint in track:
            elements.add_element(image, keypoint)
        found.add_point3D(place, elements, np.array([10 * point, 100, 200], np.uint8))
    return found


def write_folder(
    folder: Path, found: Any, photographs: str = "images", model: str = "sparse/0", binary: bool = True
) -> Path:
    """Write a reconstruction as COLMAP does, with its photographs."""
    (folder / model).mkdir(parents=True)
    (found.write_binary if binary else found.write_text)(folder / model)
    for image in found.images.values():
        pose = np.linalg.inv(np.vstack([image.cam_from_world().matrix(), [0, 0, 0, 1]]))
        path = folder / photographs / image.name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(photograph(image.camera, pose)).save(path, quality=98)
    return folder


def rewrite(path: Path, change: Callable[[bytes], bytes]) -> None:
    """Change the bytes of a file."""
    path.write_bytes(change(path.read_bytes()))
