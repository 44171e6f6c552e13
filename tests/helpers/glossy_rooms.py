# SPDX-License-Identifier: Apache-2.0
"""The world of ``glossy_sheets`` as a capture, and priors that know it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from glossy_sheets import EXTENT, OBJECT, SETTINGS, GlossyWorld, shots_of_world
from graycard import Capture, Points, View, methods, open_capture
from graycard.dataset import write_index
from graycard.io import Manifest, silent, write_layers, write_manifest, write_rgb
from graycard.methods.goris import GlossyScene
from graycard.methods.goris._fit import FittedLight
from graycard.methods.goris._remove import Removed, without_object
from graycard.methods.goris._scene import LAYERS
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.goris._training_views import TrainingView
from graycard.methods.splat import CENTRES, SH_DC
from graycard.methods.surfels import COEFFICIENTS, srgb_decode_tensor
from graycard.points import write_points

_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Painter:
    """Answers with the world without its object, exactly."""

    world: GlossyWorld

    def answer(self, question: methods.Question) -> np.ndarray:
        left = self.world.parameters.take(torch.from_numpy(self.world.part != OBJECT))
        layers = GlossyScene(left, SETTINGS, 1.0, EXTENT).render(question.view.camera, sorted(LAYERS))
        return layers[question.of].astype(np.float64)


def removed_from(
    world: GlossyWorld,
    room: Capture,
    priors: methods.Priors,
    settings: GorisSettings,
    *,
    shots: Sequence[TrainingView] | None = None,
    light: FittedLight | None = None,
) -> Removed:
    """Take the object out of the true surfels, or of others."""
    shots = shots_of_world(world) if shots is None else shots
    light = FittedLight(world.parameters) if light is None else light
    return without_object(room, light, shots, priors, settings=settings, seed=0, progress=silent)


def write_room(world: GlossyWorld, folder: Path) -> Capture:
    """Photographs of the world, with masks of its object and sparse points on all that is in it."""
    views = tuple(View(f"train_{n:03d}", "train", camera) for n, camera in enumerate(world.cameras))
    for view, shot in zip(views, shots_of_world(world), strict=True):
        encoded = shot.photograph.encoded
        write_rgb(folder / f"photographs/{view.name}.exr", srgb_decode_tensor(encoded).clamp(min=0).numpy())
        ids = 3 * (shot.target.numpy() > 0.5).astype(np.uint32)
        write_layers(folder / f"masks/target/{view.name}.exr", {"object_id": ids})
    write_index(folder, Capture("tabletop", "room", views, 1.0, light_on_camera=False, target=3))
    places = world.parameters.surfels[CENTRES].double().numpy()
    seen = []
    for number, camera in enumerate(world.cameras):
        pixels, depth = camera.project(places)
        inside = (depth > 0) & (pixels > 0).all(axis=1) & (pixels < (camera.width, camera.height)).all(axis=1)
        (which,) = inside.nonzero()
        seen.append((which, np.full(len(which), number), pixels[which]))
    which, views, pixels = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    points = Points(places, (255 * surfel_colours(world)).astype(np.uint8), which, views, pixels)
    write_points(folder / "points.ply", points)
    write_manifest(folder, Manifest("graycard-capture", 1, "tabletop", "room", {"name": "tests"}, {}, {}))
    return open_capture(folder, check=False)


def surfel_colours(world: GlossyWorld) -> np.ndarray:
    """Encoded, shape ``(N, 3)``."""
    return (world.parameters.surfels[COEFFICIENTS][:, 0] * SH_DC + 0.5).clamp(0, 1).numpy()


@dataclass(frozen=True)
class Told:
    """Answers with what the world's own pictures say of glossy surfaces or of normals."""

    shots: Mapping[str, TrainingView]

    def answer(self, question: methods.Question) -> np.ndarray:
        shot = self.shots[question.view.name]
        if question.kind == "mask":
            return shot.glossy.numpy() > 0.5
        assert shot.normal is not None
        return np.where(shot.normal.square().sum(dim=-1, keepdim=True) > 0.5, shot.normal, _UP).astype(float)


def knowing(world: GlossyWorld, room: Capture) -> methods.Priors:
    """Priors that tell what is glossy, its normals, and what was behind the object."""
    known = Told(dict(zip((view.name for view in room.train), shots_of_world(world), strict=True)))
    return methods.Priors(models={"inpainting": Painter(world), "mask": known, "normal": known})
