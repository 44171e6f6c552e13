# SPDX-License-Identifier: Apache-2.0
"""Views under changed lights, and with another object in them. Import it only after ``use_renderer``."""

import zlib
from collections.abc import Mapping, Sequence

import numpy as np

from graycard.synth._scene import Scene
from graycard.synth._spec import SUB_BUFFERS, RenderSettings
from graycard.synth.edits._light_edits import Edit
from graycard.synth.layers._light_shares import light_shares
from graycard.synth.layers._separation import estimate, light_names
from graycard.synth.layers._views import (
    light_images,
    picture_images,
    render_view,
    sub_buffer_seeds,
    surface_layers,
)
from graycard.synth.renderer._mitsuba import load_scene


def view_with_edits(
    scene: Scene, number: int, seed: int, settings: RenderSettings, edits: Sequence[Edit]
) -> tuple[dict[str, np.ndarray], dict[str, dict[str, np.ndarray]]]:
    """Return a view, and the same view under lights that are off or recoloured, from one set of light paths.

    Args:
        scene: What is there.
        number: Index of the view in ``scene.views``.
        seed: Of the scene.
        settings: Samples and depth of the light paths.
        edits: Those whose light is the old one times factors.

    Returns:
        The layers of :func:`graycard.synth.layers._views.render_view`; and for each edit by name those of
        :func:`graycard.synth.layers._separation.estimate` for ``radiance``.
    """
    camera = scene.views[number].camera
    loaded, seeds = load_scene(scene, camera), sub_buffer_seeds(seed, number)
    images = light_images(loaded, camera, seeds, settings)
    shares = light_shares(loaded, camera, seeds, settings, images)
    lights = light_names(loaded, scene)
    relit = {
        edit.record.name: estimate("radiance", _weighted(shares, lights, edit.factors or {}))
        for edit in edits
    }
    return render_view(scene, number, seed, settings, images), relit


def _weighted(shares: np.ndarray, lights: list[str], factors: Mapping[str, Sequence[float]]) -> np.ndarray:
    weights = np.array([factors.get(light, (1.0, 1.0, 1.0)) for light in lights])
    return (shares * weights[:, None, None, :]).sum(axis=1)


def relit_view(edit: Edit, number: int, seed: int, settings: RenderSettings) -> dict[str, np.ndarray]:
    """Return a view of an edit's own scene, from light paths of its own.

    Returns:
        Layers of :func:`graycard.synth.layers._separation.estimate` for ``radiance``, each ``(H, W, 3)``.
    """
    camera = edit.scene.views[number].camera
    loaded, seeds = load_scene(edit.scene, camera), seeds_of(edit.record.name, seed, number)
    return estimate("radiance", picture_images(loaded, camera, seeds, settings))


def composed_view(scene: Scene, number: int, seed: int, settings: RenderSettings) -> dict[str, np.ndarray]:
    """Return a view of a scene with another object in it, from light paths of its own.

    Returns:
        Layers of :func:`graycard.synth.layers._separation.estimate` for ``radiance``, each ``(H, W, 3)``, and
        ``object_id`` at the pixel centres, ``(H, W)``.
    """
    camera = scene.views[number].camera
    loaded, seeds = load_scene(scene, camera), seeds_of("composition", seed, number)
    found = estimate("radiance", picture_images(loaded, camera, seeds, settings))
    return found | {"object_id": surface_layers(loaded, scene, camera)["object_id"]}


def seeds_of(subject: str, seed: int, view: int) -> list[int]:
    """32-bit seeds of a view's independent images that no other subject has."""
    entropy = [seed, view, zlib.crc32(subject.encode())]
    return np.random.SeedSequence(entropy).generate_state(SUB_BUFFERS).tolist()
