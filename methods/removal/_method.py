# SPDX-License-Identifier: Apache-2.0
"""Removal in colours alone, as GOR-IS is compared with; and nothing removed at all."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from graycard import Capture, Progress, srgb_encode
from graycard.methods._contract import Ask, Priors
from graycard.methods.removal._behind import drawn_colours, views_behind
from graycard.methods.removal._filled import Target, Wall, targets_of
from graycard.methods.removal._scene import RemovalScene, load_scene
from graycard.methods.removal._settings import OneReferenceSettings, PerViewSettings, RemovalSettings
from graycard.methods.removal._target import target_masks, target_surfels
from graycard.methods.splat import (
    CENTRES,
    Parameters,
    Plan,
    Rate,
    initial_state,
    joined_surfels,
    scene_extent,
    surfels_of,
    surfels_on_surface,
    train,
)
from graycard.methods.surfels import (
    Objective,
    Photograph,
    SurfelScene,
    SurfelSettings,
    check_checkpoint,
    check_photographs,
    check_places,
    density_rules,
    encode,
    fit_surfels,
    learning_rates,
    sky_basis,
    sparse_start,
    with_colours,
)

NEW_OPACITY = 0.5
"""Of surfels that are put where the object was."""
_FEWEST = 2
"""Points of which surfels are made."""


class RemovalMethod:
    """Coloured surfels; those of the object are taken out, and what was behind it is painted."""

    name = "removal"
    summary = "2D Gaussian surfels without the object; three views painted by a prior tell what was behind it"
    needs = ()
    asks = (Ask("inpainting", ("radiance",)),)
    settings_type: type[RemovalSettings] = RemovalSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: RemovalSettings, seed: int, progress: Progress
    ) -> RemovalScene:
        """Fit surfels to the photographs, take the object's out, and fit what is left to what it is to show.

        Raises:
            MethodError: The capture names no object or its masks are not sound, there are too few sparse
                points, photographs are black or not finite, the prior's answer is not sound, or the fit has
                no way on.
        """
        masks = checked(capture, settings, seed, self.name, settings.grow)
        before = _first(capture, settings, seed, progress, self.name)
        cameras = [view.camera for view in capture.train]
        theirs = target_surfels(surfels_of(before.surfels), cameras, masks, settings.least_inside)
        left = before.take(~theirs)
        behind = views_behind(capture, drawn_colours(left.all), masks, settings.grow)
        targets, wall = targets_of(behind, priors, settings.references)
        start = with_wall(left, int(theirs.sum()), wall, settings, seed)
        after = _second(start, targets, settings, seed, progress)
        scenes = (SurfelScene(self.name, parameters, capture.exposure) for parameters in (before, after))
        assert capture.target is not None, "it was checked"
        return RemovalScene(*scenes, capture.target)

    def load(self, folder: Path) -> RemovalScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder, self.name)


class PerViewMethod(RemovalMethod):
    """Every view is painted for itself (as SPIn-NeRF: Mirzaei et al. 2023)."""

    name = "removal-per-view"
    summary = "2D Gaussian surfels without the object, every view painted by a prior for itself (SPIn-NeRF)"
    settings_type = PerViewSettings


class OneReferenceMethod(RemovalMethod):
    """One view is painted and tells the others (as InFusion and GScream)."""

    name = "removal-one-reference"
    summary = "2D Gaussian surfels without the object; one view painted by a prior tells the rest (InFusion)"
    settings_type = OneReferenceSettings


class KeepMethod:
    """Nothing is removed: what any removal has to beat."""

    name = "do-nothing"
    summary = "2D Gaussian surfels from which nothing is removed"
    needs = ()
    settings_type = SurfelSettings

    def fit(
        self, capture: Capture, priors: Priors, settings: SurfelSettings, seed: int, progress: Progress
    ) -> RemovalScene:
        """Fit surfels to the photographs.

        Raises:
            MethodError: As of :meth:`RemovalMethod.fit`.
        """
        checked(capture, settings, seed, self.name)
        parameters = _first(capture, settings, seed, progress, self.name)
        scene = SurfelScene(self.name, parameters, capture.exposure)
        assert capture.target is not None, "it was checked"
        return RemovalScene(scene, scene, capture.target)

    def load(self, folder: Path) -> RemovalScene:
        """A saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return load_scene(folder, self.name)


def checked(
    capture: Capture, settings: SurfelSettings, seed: int, method: str, grow: float = 0.0
) -> list[np.ndarray]:
    """The masks of the object, to be widened by ``grow``, of a capture that can be fitted.

    Raises:
        MethodError: It cannot, or its masks are not sound.
    """
    masks = target_masks(capture, grow)
    check_places(capture)
    check_photographs(capture)
    check_checkpoint(method, settings, seed)
    return masks


def with_wall(left: Parameters, taken: int, wall: Wall, settings: RemovalSettings, seed: int) -> Parameters:
    """What is left, with new surfels on the wall behind the object, as many as there may still be.

    Those of the object have made room, also where sparse points alone are more than the limit.
    """
    room = max(settings.surfels - len(left), taken)
    if min(room, len(wall.points)) < _FEWEST:
        return left
    discs = surfels_on_surface(
        wall.points,
        wall.normals,
        np.asarray(srgb_encode(wall.colours)),
        room,
        seed,
        opacity=NEW_OPACITY,
        sizes=wall.distances,
    )
    return joined_surfels(left, with_colours(discs, settings).surfels)


def _first(
    capture: Capture, settings: SurfelSettings, seed: int, progress: Progress, method: str
) -> Parameters:
    """Surfels of everything, the object included."""
    start = sparse_start(capture, settings, seed)
    rules = density_rules(settings.surfels)
    return fit_surfels(method, capture, settings, seed, progress, start=start, rules=rules)


def _second(
    start: Parameters, targets: Sequence[Target], settings: RemovalSettings, seed: int, progress: Progress
) -> Parameters:
    """Fit what is left to what views are to show; the object's photographs are not believed any more."""
    views = [_shown(target, settings) for target in targets]
    extent = scene_extent([view.camera for view in views])
    steps, done = settings.second_steps, settings.iterations
    rates = learning_rates(extent, settings)
    rates[CENTRES] = Rate(rates[CENTRES].end or rates[CENTRES].start)
    # as the last steps of a longer fit: all harmonics and weights count from the first step on
    objective = Objective(views, replace(settings, iterations=done + steps), seed)
    plan = Plan(steps, rates, extent)
    return train(
        initial_state(start, seed), plan, lambda values, step: objective(values, done + step), progress
    ).parameters


def _shown(target: Target, settings: RemovalSettings) -> Photograph:
    behind = target.behind
    weight = np.where(target.known, settings.hole_weight, np.where(behind.doubt, 0.0, 1.0))
    picture = encode(torch.from_numpy(target.picture.astype(np.float32)))
    sky = sky_basis(behind.view.camera, settings.sky_degree)
    return Photograph(behind.view.camera, picture, sky, torch.from_numpy(weight.astype(np.float32)))
