# SPDX-License-Identifier: Apache-2.0
"""Radiance-only removal, the baselines of GOR-IS; and nothing removed at all."""

from dataclasses import replace

import numpy as np
import torch

from graycard import srgb_encode
from graycard.methods.removal._behind import drawn_colours, views_behind
from graycard.methods.removal._filled import BackgroundPoints, Target, targets_of
from graycard.methods.removal._hull import hull_holes
from graycard.methods.removal._references import choice_of
from graycard.methods.removal._scene import RemovalScene
from graycard.methods.removal._settings import OneReferenceSettings, PerViewSettings, RemovalSettings
from graycard.methods.removal._stages import (
    ASKS,
    FIRST,
    checked,
    checked_for_removal,
    decomposition,
    first_settings,
    first_stage,
    second_stage,
    shown,
)
from graycard.methods.removal._target import target_surfels
from graycard.methods.splat import (
    CENTRES,
    Parameters,
    Surfels,
    joined_surfels,
    surfels_of,
    surfels_on_surface,
)
from graycard.methods.surfels import FitTask, SceneMethod, SurfelSettings, with_colours

NEW_OPACITY = 0.5
"""Opacity of surfels that are put where the object was."""
LARGEST = 2.0
"""The largest size of a new surfel, as its view sees it, over the median of all new ones.

A point alone, as at the border of a hole, would get a disc as large as its distance from all others: one of
1.4 m veiled a floor."""
_FEWEST = 2
"""Points of which surfels are made."""


class RemovalMethod(SceneMethod[RemovalSettings, RemovalScene]):
    """Radiance-only surfels; those of the object are removed, and what was behind it is inpainted."""

    name = "removal"
    summary = "2D Gaussian surfels without the object; three inpainted views tell what was behind it"
    asks = ASKS
    staged = True
    settings_type: type[RemovalSettings] = RemovalSettings
    scene_type = RemovalScene

    def _fitted(self, task: FitTask[RemovalSettings]) -> RemovalScene:
        """Fit surfels to the photographs, remove the object's, and fit the rest to inpainted views."""
        capture, settings = task.capture, task.settings
        masks = checked_for_removal(task, FIRST, first_settings(settings))
        before = first_stage(task)
        cameras = [view.camera for view in capture.train]
        theirs = target_surfels(surfels_of(before.surfels), cameras, masks, settings.least_inside)
        left = before.take(~theirs)
        behind = views_behind(capture, drawn_colours(left.all), masks, settings.grow)
        if settings.holes == "hull":
            places = before.surfels[CENTRES][theirs].numpy()
            behind = hull_holes(behind, masks, settings.grow, places)
        targets, wall = targets_of(behind, task.priors, settings.references, choice_of(settings))
        start = with_wall(left, int(theirs.sum()), wall, settings, task.seed)
        weights = (pixel_weights(target, settings.hole_weight) for target in targets)
        views = shown(targets, weights, settings)
        return decomposition(self.name, capture, before, second_stage(task, start, views))


class PerViewMethod(RemovalMethod):
    """Every view is inpainted for itself (as SPIn-NeRF: Mirzaei et al. 2023)."""

    name = "removal-per-view"
    summary = "2D Gaussian surfels without the object, every view inpainted for itself (SPIn-NeRF)"
    settings_type = PerViewSettings


class OneReferenceMethod(RemovalMethod):
    """One view is inpainted and tells the others (as InFusion and GScream)."""

    name = "removal-one-reference"
    summary = "2D Gaussian surfels without the object; one inpainted view tells the rest (InFusion)"
    settings_type = OneReferenceSettings


class KeepMethod(SceneMethod[SurfelSettings, RemovalScene]):
    """Nothing is removed: what any removal has to beat."""

    name = "do-nothing"
    summary = "2D Gaussian surfels from which nothing is removed"
    staged = True
    settings_type = SurfelSettings
    scene_type = RemovalScene

    def _fitted(self, task: FitTask[SurfelSettings]) -> RemovalScene:
        checked(task, FIRST, first_settings(task.settings))
        parameters = first_stage(task)
        return decomposition(self.name, task.capture, parameters, parameters)


def with_wall(
    left: Parameters, taken: int, wall: BackgroundPoints, settings: RemovalSettings, seed: int
) -> Parameters:
    """Return what is left, with new surfels on the wall behind the object."""
    discs = wall_surfels(len(left), taken, wall, np.asarray(srgb_encode(wall.colours)), settings, seed)
    return left if discs is None else joined_surfels(left, with_colours(discs, settings).surfels)


def wall_surfels(
    left: int, taken: int, wall: BackgroundPoints, features: np.ndarray, settings: RemovalSettings, seed: int
) -> Surfels | None:
    """Return new surfels on the wall behind the object, as many as there may still be; None where that is
    none.

    Those of the object have made room, also where sparse points alone are more than the limit. None is much
    larger than others in the view that shows it, see :data:`LARGEST`.

    Args:
        left: How many surfels are left.
        taken: How many the object had.
        wall: M points.
        features: Shape ``(M, C)``: of the surfels.
        settings: With the limit.
        seed: Of which points become surfels.
    """
    room = max(settings.surfels - left, taken)
    if min(room, len(wall.points)) < _FEWEST:
        return None
    told = np.column_stack([features, wall.distances])
    discs = surfels_on_surface(
        wall.points, wall.normals, told, room, seed, opacity=NEW_OPACITY, sizes=wall.distances
    )
    features_of, distance = discs.features[:, :-1], discs.features[:, -1:]
    most = LARGEST * distance * (discs.scales / distance).median()
    return replace(discs, scales=torch.minimum(discs.scales, most), features=features_of)


def pixel_weights(target: Target, hole_weight: float) -> np.ndarray:
    """Weights of the pixels of a view in the loss, shape ``(H, W)``: 0 where nothing is known."""
    return np.where(target.known, hole_weight, np.where(target.behind.doubt, 0.0, 1.0))
