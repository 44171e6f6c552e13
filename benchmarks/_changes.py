# SPDX-License-Identifier: Apache-2.0
"""Changes of a scene whose pictures are known: what a method is asked to show, and what an oracle is told."""

import shutil
from dataclasses import replace
from pathlib import Path

from graycard import Capture, DatasetError, EnvironmentLight, Light, Truth, open_truth
from graycard.io import inside, output_error
from graycard.methods import Changes, Composable, Composed, Decomposition, Relightable, Relit


def changes_for(decomposition: Decomposition, capture: Capture, scene: Path) -> Changes:
    """Return changes that a fitted method shows besides the scene as it is, as far as it can.

    Args:
        decomposition: What was fitted.
        capture: The copy that it was fitted to; images of environments are put beside it.
        scene: ``DATASET/<track>/<scene>``.

    Raises:
        DatasetError: The truth is damaged.
        OutputError: There is no room for the copies.
    """
    if not (scene / "truth").is_dir():
        return Changes()
    relighting = relighting_of(scene, _beside(capture)) if isinstance(decomposition, Relightable) else {}
    asked = isinstance(decomposition, Composable)
    truth = open_truth(scene / "truth", check=False)
    return Changes(relighting, truth.composition() if asked else None)


def true_relighting(truth: Truth, capture: Capture) -> tuple[Relit, ...]:
    """Return the held-out views under each change of the lights, for a method that needs them.

    Args:
        truth: Of the scene.
        capture: The copy that is fitted; images of environments are put beside it.

    Raises:
        DatasetError: The truth is damaged.
        OutputError: There is no room for the copies.
    """
    return tuple(
        Relit(lights, {view.name: truth.relit(edit, view)["radiance"] for view in capture.test})
        for edit, lights in _relighting(truth, _beside(capture)).items()
    )


def true_composition(truth: Truth, capture: Capture) -> Composed | None:
    """Return the held-out views with an object put in, for a method that needs them; None where none is.

    Raises:
        DatasetError: The truth is damaged.
    """
    composition = truth.composition()
    if composition is None:
        return None
    return Composed(composition, {v.name: truth.composed(v)["radiance"] for v in capture.test})


def relighting_of(scene: Path, folder: Path) -> dict[str, tuple[Light, ...]]:
    """Return the lights after each change of a scene's lights.

    Args:
        scene: ``DATASET/<track>/<scene>``.
        folder: Where images of environments are copied to, for the truth stays closed.

    Returns:
        By the name of the change; the image of an environment is the full path of its copy. Nothing for a
        scene without truth.

    Raises:
        DatasetError: The truth is damaged.
        OutputError: There is no room for the copies.
    """
    if not (scene / "truth").is_dir():
        return {}
    return _relighting(open_truth(scene / "truth", check=False), folder)


def _relighting(truth: Truth, folder: Path) -> dict[str, tuple[Light, ...]]:
    """Return the lights after each change, images of environments copied to a folder."""
    root = Path(truth.root or "")
    return {
        edit.name: tuple(
            _copied(light, inside(root, edit.folder, error=DatasetError), inside(folder, edit.name))
            for light in truth.relit_lights(edit.name)
        )
        for edit in truth.edits
    }


def _copied(light: Light, source: Path, folder: Path) -> Light:
    """Return the light with its image, if it has one, in a folder."""
    if not isinstance(light, EnvironmentLight):
        return light
    original = inside(source, light.image, error=DatasetError)
    copy = inside(folder, light.image).absolute()
    try:
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(original, copy)
    except OSError as cause:
        raise output_error(copy, cause) from cause
    return replace(light, image=str(copy))


def _beside(capture: Capture) -> Path:
    """Folder for copies of images of environments: it goes with the copy of the capture."""
    assert capture.root is not None, "a copied capture lies on disk"
    return capture.root.parent / "relighting"
