# SPDX-License-Identifier: Apache-2.0
"""What photographs allow of reflections before the first step, on surfels whose light is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from glossy_sheets import EXTENT, FLOOR, SETTINGS, GlossyWorld, glossy_world, shots_of_world
from graycard.io import silent
from graycard.methods.goris import _initial_light
from graycard.methods.goris._fit import (
    FIRST_FRESNEL,
    FOUND_FRESNEL_RATE,
    FRESNEL_RATE,
    as_photographs_allow,
    fit_light,
    light_rates,
    with_light,
)
from graycard.methods.goris._initial_light import (
    CANDIDATES,
    SLACK,
    Observations,
    found_f0,
    initial_light,
    likeliest,
    observations,
)
from graycard.methods.goris._model import BRIGHTEST, DIFFUSE, FRESNEL, REGION
from graycard.methods.goris._objective import LightObjective
from graycard.methods.surfels import srgb_decode_tensor


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


def test_sightings_are_what_photographs_show_of_glossy_surfels(world: GlossyWorld):
    """Each is on the floor, in a pixel of its own colour, and reflects upwards."""
    shots = shots_of_world(world)
    found = observations(world.parameters.all, shots, SETTINGS, EXTENT)
    assert len(found.surfel) > 500
    assert (world.part[found.surfel] == FLOOR).all()
    assert (found.direction[:, 2] > 0).mean() > 0.99
    np.testing.assert_allclose(np.linalg.norm(found.direction, axis=1), 1, atol=1e-4)
    assert ((found.grazing >= 0) & (found.grazing < 0.5)).all()
    assert ((found.passed < 0.5) == (found.radiance.sum(axis=1) > 0.02)).mean() > 0.9


def reflecting(world: GlossyWorld, f0: float) -> GlossyWorld:
    """The same with a floor of an F0."""
    logits = torch.full_like(world.parameters.all[FRESNEL], float(torch.logit(torch.tensor(f0))))
    return replace(world, parameters=replace_surfels(world, {FRESNEL: logits}))


@pytest.mark.parametrize("f0", [0.04, 0.15, 0.3, 0.5, 0.8])
def test_a_floor_reflects_about_as_much_as_it_did(world: GlossyWorld, f0: float):
    """Photographs of surfels with a known F0 tell it to a candidate, and what is no metal from a metal.

    What is scattered is told to less than that: in the views on a floor of F0 0.5 six times as much is
    mirrored, most of it even."""
    known = reflecting(world, f0)
    unknown = {**known.parameters.all, FRESNEL: torch.zeros_like(known.parameters.all[FRESNEL])}
    found = initial_light(unknown, shots_of_world(known), SETTINGS, EXTENT)
    assert found is not None
    place = CANDIDATES.index(f0)
    assert CANDIDATES[max(place - 1, 0)] <= found.f0 <= CANDIDATES[place + 1]
    assert float(found.surroundings.min()) > 0
    true = srgb_decode_tensor(BRIGHTEST * known.parameters.all[DIFFUSE].sigmoid())[found.surfels]
    assert float((found.diffuse - true).abs().mean()) < 0.85 * float(true.mean())
    start = as_photographs_allow(known.parameters, found)
    glossy = torch.from_numpy(world.part == FLOOR)
    torch.testing.assert_close(
        start.surfels[FRESNEL][glossy].sigmoid(), torch.full((int(glossy.sum()), 3), found.f0)
    )
    torch.testing.assert_close(start.surfels[FRESNEL][~glossy], known.parameters.surfels[FRESNEL][~glossy])


def noisy(found: Observations, noise: float, seed: int) -> Observations:
    """With a standard deviation of a share of the mean."""
    drawn = np.random.default_rng(seed).normal(size=found.colour.shape)
    return replace(found, colour=found.colour + noise * found.colour.mean() * drawn)


@pytest.mark.parametrize("seed", [1000, 1001])
@pytest.mark.parametrize(("f0", "noise"), [(0.04, 0.3), (0.04, 1.0), (0.15, 0.3), (0.04, 3.0)])
def test_noise_makes_no_metal_of_what_is_none(world: GlossyWorld, f0: float, noise: float, seed: int):
    """Errors of all candidates draw level; where noise is nearly all, nothing is said."""
    known = reflecting(world, f0)
    found = observations(known.parameters.all, shots_of_world(known), SETTINGS, EXTENT)
    told = found_f0(noisy(found, noise, seed))
    assert told is None if noise >= 1 else told is not None and told < 0.3


def test_a_metal_is_one_in_noise_too(world: GlossyWorld):
    known = reflecting(world, 0.8)
    found = observations(known.parameters.all, shots_of_world(known), SETTINGS, EXTENT)
    told = found_f0(noisy(found, 0.3, 1000))
    assert told is not None
    assert told > 0.6


def test_half_open_rays_do_not_tell_how_much_is_reflected(
    world: GlossyWorld, monkeypatch: pytest.MonkeyPatch
):
    """At edges, where what was traced is most often wrong, here ten times as bright as it is."""
    known = reflecting(world, 0.5)
    true = observations(known.parameters.all, shots_of_world(known), SETTINGS, EXTENT)
    half = np.abs(true.passed - 0.5) < 0.45
    assert 0.005 < half.mean() < 0.3
    wrong = replace(true, radiance=np.where(half[:, None], 10 * true.radiance + 0.5, true.radiance))
    assert found_f0(wrong) == found_f0(true.take(~half))
    assert abs((found_f0(wrong) or 0) - 0.5) < 0.15
    monkeypatch.setattr(_initial_light, "_CLEAR", 0.5)
    assert abs((found_f0(wrong) or 0) - 0.5) > 0.15


def test_few_sightings_tell_nothing(world: GlossyWorld):
    """Surroundings of 216 texels explain a hundred of them whatever F0 is; one alone has no difference."""
    found = observations(world.parameters.all, shots_of_world(world), SETTINGS, EXTENT)
    assert found_f0(found) is not None
    few = found.take(np.isin(found.surfel, np.unique(found.surfel)[:30]))
    assert 30 < len(few.surfel) < 216
    assert found_f0(few) is None
    _, first = np.unique(found.surfel, return_index=True)
    assert found_f0(found.take(first)) is None


def test_a_metal_is_told_from_a_weak_mirror_of_bright_surroundings():
    """By how little worse strong reflections fit, and by how much of all differences they explain."""
    candidates = np.asarray(CANDIDATES)
    metal, other = (
        float(np.exp(np.log(candidates[of]).mean())) for of in (candidates >= 0.4, candidates < 0.4)
    )
    level = 0.2 * np.where(candidates >= 0.4, 1.06, np.linspace(1, 1.03, len(candidates)))
    assert likeliest(level.tolist(), 1.0) == pytest.approx(metal)
    assert likeliest(level.tolist(), 0.23) == pytest.approx(other)
    assert likeliest(level.tolist(), 0.201) is None
    assert likeliest(level.tolist(), 0.1) is None
    steep = 0.2 * np.linspace(1.0, 2.0, len(CANDIDATES))
    assert likeliest(steep.tolist(), 1.0) == pytest.approx(CANDIDATES[0])
    steep[1] = 0.2 * (SLACK - 0.01)
    assert likeliest(steep.tolist(), 1.0) == pytest.approx(np.sqrt(CANDIDATES[0] * CANDIDATES[1]))


def replace_surfels(world: GlossyWorld, parts: dict[str, torch.Tensor]):
    return replace(world.parameters, surfels={**world.parameters.surfels, **parts})


def test_where_no_glossy_surfel_is_seen_nothing_is_said(world: GlossyWorld):
    shots = [replace(shot, glossy=torch.zeros_like(shot.glossy)) for shot in shots_of_world(world)]
    assert initial_light(world.parameters.all, shots, SETTINGS, EXTENT) is None
    assert as_photographs_allow(world.parameters, None) is world.parameters


def test_where_mirrored_rays_meet_nothing_nothing_is_said(world: GlossyWorld):
    """A floor under the sky alone: what it reflects is a function of direction, whatever its F0."""
    floor = world.parameters.take(torch.from_numpy(world.part == FLOOR))
    alone = GlossyWorld(floor, world.part[world.part == FLOOR], world.cameras)
    assert initial_light(floor.all, shots_of_world(alone), SETTINGS, EXTENT) is None


def test_what_was_found_moves_less_than_what_was_guessed(world: GlossyWorld):
    """Adam's first steps are as long as the learning rate."""
    rates = [light_rates(EXTENT, SETTINGS, found)[FRESNEL] for found in (True, False)]
    assert rates == [FOUND_FRESNEL_RATE, FRESNEL_RATE]
    shots, settings = shots_of_world(world), replace(SETTINGS, iterations=12, radiance_share=0.5)
    start = with_light(world.parameters, shots, settings, 0)
    glossy, found = start.surfels[REGION][:, 0] < 0, initial_light(start.all, shots, settings, EXTENT)
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
    start = fit_light(world.parameters, shots, replace(SETTINGS, iterations=2, radiance_share=0.5), 0, silent)

    def loss(values: dict[str, torch.Tensor]) -> float:
        return sum(float(objective(values, step).loss.detach()) for step in range(4))

    assert loss(ends[0].all) < 0.8 * loss(start.all)
