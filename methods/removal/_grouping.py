# SPDX-License-Identifier: Apache-2.0
"""``grouping``: identities of surfels are learnt, and the background behind the object grows from its rim."""

import numpy as np
import torch
from scipy.spatial import KDTree

from graycard.io import Room
from graycard.methods.removal._behind import drawn_colours, views_behind
from graycard.methods.removal._filled import Target, filled_views, own_targets
from graycard.methods.removal._identity import (
    IdentityObjective,
    identity_rates,
    object_probabilities,
    with_identities,
    without_identities,
)
from graycard.methods.removal._scene import RemovalScene
from graycard.methods.removal._settings import GroupingSettings
from graycard.methods.removal._stages import (
    ASKS,
    checked_for_removal,
    decomposition,
    second_stage,
    shown,
)
from graycard.methods.removal._target import check_some, with_hull
from graycard.methods.splat import (
    CENTRES,
    ROTATIONS,
    Parameters,
    joined_surfels,
    surfels_of,
)
from graycard.methods.surfels import (
    FitTask,
    SceneMethod,
    SurfelObjective,
    density_rules,
    fit_checkpoint,
    learning_rates,
    photographs,
    sparse_start,
)


class GroupingMethod(SceneMethod[GroupingSettings, RemovalScene]):
    """Surfels learn identities, and every view is inpainted for itself (Gaussian Grouping, Ye et al. 2024).

    Unlike :class:`RemovalMethod` it has no points behind the object: new surfels begin as the mean of those
    that are left next to it, and are densified.
    """

    name = "grouping"
    summary = "2D Gaussian surfels with learnt identities; every view inpainted (Gaussian Grouping)"
    asks = ASKS
    settings_type = GroupingSettings
    scene_type = RemovalScene

    def _fitted(self, task: FitTask[GroupingSettings]) -> RemovalScene:
        """Fit surfels and identities, remove the object's, and fit the rest to inpainted views."""
        capture, settings = task.capture, task.settings
        masks = checked_for_removal(task, self.name, settings)
        fitted = identified(task, masks, self.name)
        theirs, before = named_surfels(fitted, settings), without_identities(fitted)
        left, gone = before.take(~theirs), before.surfels[CENTRES][theirs]
        behind = views_behind(capture, drawn_colours(left.all), masks, settings.grow)
        targets = own_targets(behind, filled_views(behind, task.priors))
        weights = (pixel_weights(target, settings.inside_share) for target in targets)
        views = shown(targets, weights, settings)
        start = with_means(left, gone, settings.neighbours)
        after = second_stage(task, start, views, density_rules(settings.surfels))
        return decomposition(self.name, capture, before, after)


def identified(task: FitTask[GroupingSettings], masks: list[np.ndarray], method: str) -> Parameters:
    """Fit surfels of the whole scene, the object included, and their identities.

    Raises:
        MethodError: There are too few sparse points, or the loss or a gradient is not finite.
    """
    capture, settings, seed = task.capture, task.settings, task.seed
    views, room = photographs(capture, settings), Room()
    classes = [room.keep(torch.from_numpy(mask).long()) for mask in masks]
    looked_at = [(v.camera, part) for v, c in zip(views, classes, strict=True) for part in (v.encoded, c)]
    rates = learning_rates(task.extent, settings) | identity_rates(settings)
    checkpoint = fit_checkpoint(method, settings, seed, looked_at)
    config = task.config(settings.iterations, rates, density_rules(settings.surfels), checkpoint)
    objective = IdentityObjective(SurfelObjective(views, settings, seed), classes, settings)
    return task.train(
        with_identities(sparse_start(capture, settings, seed), settings, seed), config, objective
    )


def named_surfels(fitted: Parameters, settings: GroupingSettings) -> torch.Tensor:
    """Return which surfels are the object's, shape ``(N,)``, bool: those that say so, and those in their
    hull.

    Raises:
        MethodError: None is the object's, or all are.
    """
    least = settings.least_probability
    theirs = with_hull(surfels_of(fitted.surfels), object_probabilities(fitted.all) > least)
    check_some(theirs, f"that are the object's with a probability above {least:g}", "least_probability")
    return theirs


def with_means(left: Parameters, gone: torch.Tensor, neighbours: int) -> Parameters:
    """Return what is left, with a new surfel for each that is gone: the mean of the nearest to it in all
    parameters.

    Args:
        left: N surfels.
        gone: Shape ``(M, 3)``: where the others were, metres.
        neighbours: How many are averaged, or N if there are fewer.
    """
    ranks = np.arange(1, min(neighbours, len(left)) + 1)
    tree = KDTree(left.surfels[CENTRES].numpy())
    # SciPy takes ranks too, and keeps their axis even if there is one: its type is guessed from the default
    _, nearest = tree.query(gone.numpy(), k=ranks)  # pyright: ignore[reportArgumentType]
    those = {name: values[torch.from_numpy(nearest)] for name, values in left.surfels.items()}
    those[ROTATIONS] = _alike(those[ROTATIONS])
    return joined_surfels(left, {name: values.mean(dim=1) for name, values in those.items()})


def pixel_weights(target: Target, inside_share: float) -> np.ndarray:
    """Return how much the pixels of a view count, shape ``(H, W)``; 1 in the mean where there is a hole.

    A share goes to the box around the hole, the rest to what is not in doubt; each is a mean over its pixels,
    so that small holes count as much as large ones. Where nobody knows what is there, nothing counts.
    """
    outside = ~target.behind.doubt
    box = _box(target.known) & (outside | target.known)
    weight = (1 - inside_share) * outside / outside.mean()
    return weight + inside_share * box / box.mean() if box.any() else weight


def _alike(quaternions: torch.Tensor) -> torch.Tensor:
    """Return the same rotations, shape ``(M, K, 4)``, of signs by which a mean of them is one too."""
    unit = torch.nn.functional.normalize(quaternions, dim=-1)
    return torch.where((unit * unit[:, :1]).sum(dim=-1, keepdim=True) < 0, -unit, unit)


def _box(mask: np.ndarray) -> np.ndarray:
    """Return the smallest box of rows and columns that holds a mask, shape ``(H, W)``, bool."""
    found = np.zeros_like(mask)
    rows, columns = np.nonzero(mask)
    if len(rows):
        found[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] = True
    return found
