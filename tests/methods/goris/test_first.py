# SPDX-License-Identifier: Apache-2.0
"""What photographs allow of reflections before the first step, on surfels whose light is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from glossy_sheets import EXTENT, FLOOR, SETTINGS, GlossyWorld, glossy_world, shots_of_world
from graycard import silent
from graycard.methods.goris._first import CANDIDATES, first_light, sightings
from graycard.methods.goris._fit import as_photographs_allow, fit_light
from graycard.methods.goris._model import BRIGHTEST, DIFFUSE, FRESNEL
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
