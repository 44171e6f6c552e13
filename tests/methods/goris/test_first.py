# SPDX-License-Identifier: Apache-2.0
"""What photographs allow of reflections before the first step, on surfels whose light is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from glossy_sheets import EXTENT, FLOOR, SETTINGS, GlossyWorld, glossy_world, shots_of_world
from graycard import silent
from graycard.methods.goris._first import CANDIDATES, first_light, likeliest, sightings
from graycard.methods.goris._fit import FIRST_FRESNEL, as_photographs_allow, fit_light, with_light
from graycard.methods.goris._model import BRIGHTEST, DIFFUSE, FRESNEL, REGION
from graycard.methods.goris._objective import LightObjective
from graycard.methods.surfels import decode


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


def test_sightings_are_what_photographs_show_of_glossy_surfels(world: GlossyWorld):
    """Each is on the floor, in a pixel of its own colour, and reflects upwards."""
    shots = shots_of_world(world)
    found = sightings(world.parameters.all, shots, SETTINGS, EXTENT)
    assert len(found.surfel) > 500
    assert (world.part[found.surfel] == FLOOR).all()
    assert (found.direction[:, 2] > 0).mean() > 0.99
    np.testing.assert_allclose(np.linalg.norm(found.direction, axis=1), 1, atol=1e-4)
    assert ((found.grazing >= 0) & (found.grazing < 0.5)).all()
    assert ((found.passed < 0.5) == (found.radiance.sum(axis=1) > 0.02)).mean() > 0.9


@pytest.mark.parametrize("f0", [0.04, 0.15, 0.5, 0.8])
def test_a_floor_reflects_about_as_much_as_it_did(world: GlossyWorld, f0: float):
    """Photographs of surfels with a known F0 tell it to a candidate or two."""
    logit = float(torch.logit(torch.tensor(f0)))
    known = replace(
        world,
        parameters=replace_surfels(world, {FRESNEL: torch.full_like(world.parameters.all[FRESNEL], logit)}),
    )
    shots = shots_of_world(known)
    unknown = {**known.parameters.all, FRESNEL: torch.zeros_like(known.parameters.all[FRESNEL])}
    found = first_light(unknown, shots, SETTINGS, EXTENT)
    assert found is not None
    assert found.f0 in CANDIDATES
    assert -1 <= CANDIDATES.index(found.f0) - CANDIDATES.index(f0) <= 2
    assert float(found.surroundings.min()) > 0
    true = decode(BRIGHTEST * known.parameters.all[DIFFUSE].sigmoid())[found.surfels]
    assert float((found.diffuse - true).abs().mean()) < 0.7 * float(true.mean())
    start = as_photographs_allow(known.parameters, found)
    glossy = torch.from_numpy(world.part == FLOOR)
    torch.testing.assert_close(
        start.surfels[FRESNEL][glossy].sigmoid(), torch.full((int(glossy.sum()), 3), found.f0)
    )
    torch.testing.assert_close(start.surfels[FRESNEL][~glossy], known.parameters.surfels[FRESNEL][~glossy])


def test_a_metal_is_told_from_a_weak_mirror_of_bright_surroundings():
    """By how little worse strong reflections fit; among each, the strongest of the best."""
    weak = np.linspace(1.0, 1.09, len(CANDIDATES))
    assert likeliest([0.2 * error for error in weak]) == CANDIDATES[-1]
    steep = np.linspace(1.0, 2.0, len(CANDIDATES))
    assert likeliest([0.2 * error for error in steep]) == CANDIDATES[0]
    steep[1] = 1.03
    assert likeliest([0.2 * error for error in steep]) == CANDIDATES[1]


def replace_surfels(world: GlossyWorld, parts: dict[str, torch.Tensor]):
    return replace(world.parameters, surfels={**world.parameters.surfels, **parts})


def test_where_no_glossy_surfel_is_seen_nothing_is_said(world: GlossyWorld):
    shots = [replace(shot, glossy=torch.zeros_like(shot.glossy)) for shot in shots_of_world(world)]
    assert first_light(world.parameters.all, shots, SETTINGS, EXTENT) is None
    assert as_photographs_allow(world.parameters, None) is world.parameters


def test_where_mirrored_rays_meet_nothing_nothing_is_said(world: GlossyWorld):
    """A floor under the sky alone: what it reflects is a function of direction, whatever its F0."""
    floor = world.parameters.take(torch.from_numpy(world.part == FLOOR))
    alone = GlossyWorld(floor, world.part[world.part == FLOOR], world.cameras)
    assert first_light(floor.all, shots_of_world(alone), SETTINGS, EXTENT) is None


def test_what_was_found_moves_less_than_what_was_guessed(world: GlossyWorld):
    """Adam's first steps are as long as the learning rate."""
    shots, settings = shots_of_world(world), replace(SETTINGS, iterations=12, radiance_share=0.5)
    start = with_light(world.parameters, shots, settings, 0)
    glossy, found = start.surfels[REGION][:, 0] < 0, first_light(start.all, shots, settings, EXTENT)
    assert found is not None

    def moved(first: bool, begun: float) -> float:
        own = fit_light(world.parameters, shots, replace(settings, first_light=first), 0, silent).surfels
        return float((own[FRESNEL][glossy] - torch.logit(torch.tensor(begun))).abs().mean())

    assert 0 < moved(True, found.f0) < 0.5 * moved(False, FIRST_FRESNEL)


def test_a_fit_of_light_gets_nearer_to_photographs(world: GlossyWorld):
    """From coloured surfels: lower than its start, and the same again to the bit."""
    shots = shots_of_world(world)
    ends = [fit_light(world.parameters, shots, SETTINGS, 0, silent) for _ in range(2)]
    for name, values in ends[0].all.items():
        assert torch.equal(values, ends[1].all[name]), name
    objective = LightObjective(shots, SETTINGS, EXTENT, 0)
    start = fit_light(world.parameters, shots, replace(SETTINGS, iterations=1, radiance_share=0.9), 0, silent)

    def loss(values: dict[str, torch.Tensor]) -> float:
        return sum(float(objective(values, step).loss.detach()) for step in range(4))

    assert loss(ends[0].all) < 0.8 * loss(start.all)
