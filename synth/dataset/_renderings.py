# SPDX-License-Identifier: Apache-2.0
"""Parts of a rendering: which files there are, and which of them come from one pass.

Everything else in a scene folder follows from these files. Mitsuba is imported when something is rendered.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from graycard import OutputError
from graycard.edits import composed_file
from graycard.io import write_layers
from graycard.synth._scene import Scene
from graycard.synth._spec import RenderSettings
from graycard.synth.dataset._store import discard, is_whole_view, move, view_file
from graycard.synth.edits._composition import Composed, composition
from graycard.synth.edits._light_edits import Edit, light_edits
from graycard.synth.renderer._variant import SCALAR

Layers = Mapping[str, np.ndarray]


@dataclass(frozen=True, slots=True)
class Rendering:
    """Files that one pass of the renderer makes; they are a pure function of the scene's spec."""

    doing: str
    """Message that is told while it is made."""
    files: tuple[str, ...]
    """Relative to the truth folder."""
    make: Callable[[], Sequence[Layers]]
    """The layers of each of the files."""
    dense: bool = False
    """True where few bytes count for more than that old programs read the files."""


@dataclass(frozen=True, slots=True)
class Content:
    """Pictures of a scene folder: a scene, changes of its lights, and perhaps an object put into it."""

    scene: Scene
    edits: Sequence[Edit] = ()
    composed: Composed | None = None


def content_of(scene: Scene, seed: int, settings: RenderSettings) -> Content:
    """Return a scene with all the changes that the settings ask for."""
    edits = light_edits(scene, seed) if settings.relighting else ()
    return Content(scene, edits, composition(scene, seed, settings) if settings.composition else None)


def renderings(content: Content, seed: int, settings: RenderSettings, variant: str) -> list[Rendering]:
    """All that is rendered of a scene: the views first, then those under lights elsewhere.

    Args:
        content: What is to be shown.
        seed: Of the scene.
        settings: Samples and depth of the light paths.
        variant: Of the renderer; without parts of the radiance all edits are rendered.
    """
    scene = content.scene
    sums = [edit for edit in content.edits if edit.factors is not None and variant != SCALAR]
    others = [edit for edit in content.edits if edit not in sums]
    views = [_of_view(scene, number, seed, settings, sums) for number in range(len(scene.views))]
    composed = [] if content.composed is None else _of_composition(content.composed.scene, seed, settings)
    found = [*views, *_of_edits(scene, others, seed, settings), *composed]
    return [replace(rendering, dense=settings.training_layers == "needed") for rendering in found]


def missing(wanted: Sequence[Rendering], truth: Path) -> list[tuple[int, Rendering]]:
    """Return what is to be rendered still, with its number; a file that cannot be read is removed."""
    whole = {name: is_whole_view(truth / name) for rendering in wanted for name in rendering.files}
    return [(number, r) for number, r in enumerate(wanted) if not all(whole[name] for name in r.files)]


def write_missing(rendering: Rendering, truth: Path) -> None:
    """Render, and write the files that are not there.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    absent = [not (truth / name).exists() for name in rendering.files]
    for name, layers, is_absent in zip(rendering.files, rendering.make(), absent, strict=True):
        if is_absent:
            write_layers(truth / name, layers, dense=rendering.dense)


def write_aside(rendering: Rendering, truth: Path, aside: Path, is_wanted: Callable[[], bool]) -> None:
    """Render into a folder of this process, and move the files in place that are not there then.

    Args:
        rendering: What is rendered.
        truth: Folder that the files go to.
        aside: Folder of this process; it goes.
        is_wanted: Tells whether the scene is still the one that the files belong to; else they are dropped.

    Raises:
        OutputError: A folder cannot be written to, or the disk is full.
    """
    try:
        for name, layers in zip(rendering.files, rendering.make(), strict=True):
            write_layers(aside / name, layers, dense=rendering.dense)
            if is_wanted() and not (truth / name).exists():
                move(aside / name, truth / name)
    except OutputError:
        if is_wanted():
            raise  # else another process has ended the scene, and the folder is gone
    finally:
        with suppress(OutputError):  # another process has ended the scene, and removes the folder as well
            discard(aside)


def _of_view(
    scene: Scene, number: int, seed: int, settings: RenderSettings, edits: Sequence[Edit]
) -> Rendering:
    view = scene.views[number]
    edits = edits if view.split == "test" else ()
    files = view_file(view.name), *(edit.record.view_file(view.name) for edit in edits)
    needed = view.split == "train" and settings.training_layers == "needed"
    settings = settings.for_split(view.split)

    def make() -> Sequence[Layers]:
        from graycard.synth.edits import _relighting
        from graycard.synth.layers import _views  # Mitsuba: not before its variant is chosen

        if needed:
            return [_views.render_training_view(scene, number, seed, settings)]
        if not edits:
            return [_views.render_view(scene, number, seed, settings)]
        layers, relit = _relighting.view_with_edits(scene, number, seed, settings, edits)
        return [layers, *(relit[edit.record.name] for edit in edits)]

    return Rendering(view.name, files, make)


def _of_edits(
    scene: Scene, edits: Sequence[Edit], seed: int, settings: RenderSettings
) -> Iterator[Rendering]:
    for edit in edits:
        for number, view in enumerate(scene.views):
            if view.split == "test":
                file = edit.record.view_file(view.name)
                make = partial(_relit, edit, number, seed, settings)
                yield Rendering(f"{view.name} {edit.record.name}", (file,), make)


def _of_composition(scene: Scene, seed: int, settings: RenderSettings) -> Iterator[Rendering]:
    for number, view in enumerate(scene.views):
        if view.split == "test":
            make = partial(_composed, scene, number, seed, settings)
            yield Rendering(f"{view.name} composition", (composed_file(view.name),), make)


def _relit(edit: Edit, number: int, seed: int, settings: RenderSettings) -> Sequence[Layers]:
    from graycard.synth.edits._relighting import relit_view  # Mitsuba: not before its variant is chosen

    return [relit_view(edit, number, seed, settings)]


def _composed(scene: Scene, number: int, seed: int, settings: RenderSettings) -> Sequence[Layers]:
    from graycard.synth.edits._relighting import composed_view  # Mitsuba: not before its variant is chosen

    return [composed_view(scene, number, seed, settings)]
