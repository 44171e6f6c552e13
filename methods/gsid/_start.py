# SPDX-License-Identifier: Apache-2.0
"""Start of the second stage: lights that are found, and vectors that know their shadows."""

from collections.abc import Mapping

import numpy as np
import torch

from graycard import MethodError
from graycard.methods.gsid._candidates import SAMPLES, ByWay, FirstLights, Samples, Search, enough_cover
from graycard.methods.gsid._lights import first_lights, lamps_from
from graycard.methods.gsid._model import (
    OPEN,
    SHADOW,
    SOFTEN,
    lit_normals,
    matte_of,
    pixels_of,
)
from graycard.methods.gsid._objective import DeferredView
from graycard.methods.gsid._stage import LightStage, at_tile_size, objective_in
from graycard.methods.gsid._visibility import first_vectors
from graycard.methods.shading import Material, arriving
from graycard.methods.splat import Parameters


@torch.no_grad()
def first_parameters(stage: LightStage, surface: Mapping[str, torch.Tensor]) -> Parameters:
    """Return the parameters before the first step of the second stage.

    Lights are found with shadows of rays. Where vectors tell what is in the way, they begin as near to those
    shadows as they come, and strengths are solved once more with what they tell: a lamp behind a wall may be
    as strong as it likes to a ray, and would shine through the wall to a vector that does not know of it.
    All lamps are tried, the brighter half of them, and so on, down to none: those begin with which the loss
    over all views is least. So more lamps begin no worse than fewer. Large views are made smaller for it.

    Args:
        stage: What is looked at.
        surface: Parameters of the surfels, with materials.

    Raises:
        MethodError: Surfels cover nothing.
    """
    search = search_in(stage, surface)
    places = search.places()
    counts = sorted({len(places) >> halvings for halvings in range(len(places).bit_length() + 1)})
    tried = [_with_lamps(stage, surface, search, places[:count]) for count in counts]
    smaller = at_tile_size(stage, tried[0])
    losses = [objective_in(smaller, parameters).over_all(parameters.all) for parameters in tried]
    return tried[int(np.argmin(losses))]


def _with_lamps(
    stage: LightStage, surface: Mapping[str, torch.Tensor], search: Search, places: torch.Tensor
) -> Parameters:
    """Parameters with lamps at places ``(k, 3)``."""
    found, surface = search.lights_at(places, traced=True), dict(surface)
    if stage.settings.visibility.startswith("vector") and len(places):
        surface[SHADOW] = _vectors(stage, surface, found)
        found = search_in(stage, surface).lights_at(places, traced=False)
    return Parameters(surface, first_lights(found, stage.settings))


def _vectors(stage: LightStage, surface: Mapping[str, torch.Tensor], found: FirstLights) -> torch.Tensor:
    """Vectors of the surfels, shape ``(N, 3)``, that know the shadows of lamps."""
    count, normals = len(found.positions), lit_normals(surface)
    lamps = lamps_from(first_lights(found, stage.settings))[:count]
    arrival = arriving(lamps, stage.surfels.centres, SOFTEN * stage.extent)
    cosine = (arrival.toward * normals[:, None]).sum(dim=-1).relu()
    given = arrival.facing.mean(dim=-1) * cosine
    reached = stage.reached(found.positions)
    return first_vectors(stage.settings.visibility, normals, arrival.toward, given, reached)


@torch.no_grad()
def search_in(stage: LightStage, surface: Mapping[str, torch.Tensor]) -> Search:
    """Prepare to look for the lights that explain the photographs, on surfels with materials.

    Raises:
        MethodError: Surfels cover nothing.
    """
    samples, by_way = samples_in(stage, surface), None
    if stage.bounces is not None:
        nodes = torch.from_numpy(stage.bounces.nodes)
        shares = stage.bounces.seen_from.shares(samples.points, samples.normal)
        by_way = ByWay(stage.bounces, shares, matte_of(surface)[nodes], surface[OPEN][nodes])
    return Search(samples, stage.surfels, stage.settings, stage.extent, by_way)


@torch.no_grad()
def samples_in(stage: LightStage, surface: Mapping[str, torch.Tensor]) -> Samples:
    """Return some pixels of all training views, with the materials that surfels have."""
    covered = [int(enough_cover(shot.ground.drawn.alpha).sum()) for shot in stage.shots]
    if not any(covered):
        raise MethodError(
            f"expected surfels that cover some pixels, got {len(stage.surfels)} that cover none by half. "
            "Give the fit more iterations or surfels"
        )
    count = min(SAMPLES, sum(covered))
    chosen = np.random.default_rng(stage.seed).choice(sum(covered), count, replace=False)
    order = np.argsort(chosen)
    ranked, ends = chosen[order], np.cumsum(covered)
    parts: list[tuple[torch.Tensor, ...]] = []
    for shot, end, size in zip(stage.shots, ends, covered, strict=True):
        first = end - size
        own = ranked[slice(*np.searchsorted(ranked, (first, end)))] - first
        parts.append(_layers_at(shot, surface, torch.from_numpy(own)))
    place = torch.from_numpy(np.argsort(order))  # back in the order in which they were chosen
    points, normal, eye, opened, shadow, shown, *material = (
        torch.cat(layer)[place] for layer in zip(*parts, strict=True)
    )
    eyes = torch.tensor(np.array([shot.ground.camera.position for shot in stage.shots])).float()
    return Samples(points, normal, eye, Material(*material), opened, shadow, shown, eyes)


def _layers_at(
    shot: DeferredView, surface: Mapping[str, torch.Tensor], numbers: torch.Tensor
) -> tuple[torch.Tensor, ...]:
    """Return what is known of some of the well covered pixels of a view, by their numbers among these."""
    ground, pixels = shot.ground, pixels_of(surface, shot.ground)
    material = pixels.material
    well = enough_cover(ground.drawn.alpha).flatten().nonzero()[:, 0][numbers]
    layers = (
        ground.points, ground.normal, ground.eye, ground.open, pixels.shadow, shot.linear,
        material.base_color, material.roughness, material.metallic,
    )  # fmt: skip
    return tuple(layer.flatten(0, 1)[well] for layer in layers)
