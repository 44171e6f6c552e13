# SPDX-License-Identifier: Apache-2.0
"""What photographs allow of reflections before the first step, on surfels whose light is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from glossy_sheets import EXTENT, FLOOR, SETTINGS, GlossyWorld, glossy_world, shots_of_world
from graycard.io import silent
from graycard.methods.goris import _fit, _initial_light
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
    LEAST_METAL,
    SLACK,
    InitialLight,
    Observations,
    found_f0s,
    initial_lights,
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


@pytest.mark.parametrize("f0", [0.04, 0.15, 0.5, 0.8])
def test_a_floor_reflects_about_as_much_as_it_did(world: GlossyWorld, f0: float):
    """Photographs of surfels with a known F0 tell it to a candidate, once it is known whether it is a metal.

    What is scattered is told to less than that: in the views on a floor of F0 0.5 six times as much is
    mirrored, most of it even."""
    known = reflecting(world, f0)
    unknown = {**known.parameters.all, FRESNEL: torch.zeros_like(known.parameters.all[FRESNEL])}
    lights = initial_lights(unknown, shots_of_world(known), SETTINGS, EXTENT)
    found = {light.f0 >= LEAST_METAL: light for light in lights}[f0 >= LEAST_METAL]
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


@pytest.mark.parametrize("f0", [0.15, 0.5])
def test_a_short_fit_tells_metals_from_what_is_none(world: GlossyWorld, f0: float):
    """It goes on from the start that is nearer to the photographs."""
    known = reflecting(world, f0)
    settings = replace(SETTINGS, iterations=400)
    fitted = fit_light(known.parameters, shots_of_world(known), settings, 0, silent).surfels
    glossy = torch.from_numpy(world.part == FLOOR)
    assert (float(fitted[FRESNEL][glossy].sigmoid().median()) >= LEAST_METAL) == (f0 >= LEAST_METAL)


@pytest.mark.parametrize("order", [1, -1])
def test_the_start_that_is_nearer_to_the_photographs_is_kept(
    world: GlossyWorld, monkeypatch: pytest.MonkeyPatch, order: int
):
    """Whichever comes first: a light ten times as bright is none of the photographs'."""
    shots, settings = shots_of_world(world), replace(SETTINGS, iterations=20)
    start = with_light(world.parameters, shots, settings, 0)
    right = initial_lights(start.all, shots, settings, EXTENT)[0]
    wrong = replace(right, f0=0.9, surroundings=10 * right.surroundings)

    def ended(found: list[InitialLight]) -> torch.Tensor:
        monkeypatch.setattr(_fit, "initial_lights", lambda *_: found)
        return fit_light(world.parameters, shots, settings, 0, silent).surfels[FRESNEL]

    assert torch.equal(ended([right, wrong][::order]), ended([right]))


def noisy(found: Observations, noise: float, seed: int) -> Observations:
    """With a standard deviation of a share of the mean."""
    drawn = np.random.default_rng(seed).normal(size=found.colour.shape)
    return replace(found, colour=found.colour + noise * found.colour.mean() * drawn)


@pytest.mark.parametrize("seed", [1000, 1001])
@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_where_noise_is_nearly_all_nothing_is_said(world: GlossyWorld, noise: float, seed: int):
    known = reflecting(world, 0.04)
    found = observations(known.parameters.all, shots_of_world(known), SETTINGS, EXTENT)
    assert found_f0s(noisy(found, 0.1, seed))
    assert found_f0s(noisy(found, noise, seed)) == []


def test_half_open_rays_do_not_tell_how_much_is_reflected(
    world: GlossyWorld, monkeypatch: pytest.MonkeyPatch
):
    """At edges, where what was traced is most often wrong, here ten times as bright as it is."""
    known = reflecting(world, 0.5)
    true = observations(known.parameters.all, shots_of_world(known), SETTINGS, EXTENT)
    half = np.abs(true.passed - 0.5) < 0.45
    assert 0.005 < half.mean() < 0.3
    wrong = replace(true, radiance=np.where(half[:, None], 10 * true.radiance + 0.5, true.radiance))
    assert found_f0s(wrong) == found_f0s(true.take(~half))
    assert abs(found_f0s(wrong)[1] - 0.5) < 0.15
    monkeypatch.setattr(_initial_light, "_CLEAR", 0.5)
    assert abs(found_f0s(wrong)[-1] - 0.5) > 0.15


def test_few_sightings_tell_nothing(world: GlossyWorld):
    """Surroundings of 216 texels explain a hundred of them whatever F0 is; one alone has no difference."""
    found = observations(world.parameters.all, shots_of_world(world), SETTINGS, EXTENT)
    assert found_f0s(found)
    few = found.take(np.isin(found.surfel, np.unique(found.surfel)[:30]))
    assert 30 < len(few.surfel) < 216
    assert found_f0s(few) == []
    _, first = np.unique(found.surfel, return_index=True)
    assert found_f0s(found.take(first)) == []


def test_the_best_of_each_kind_is_told_where_it_explains_something():
    """Of candidates that photographs do not decide between, the geometric mean."""
    candidates = np.asarray(CANDIDATES)
    other, metal = (
        float(np.exp(np.log(candidates[of]).mean())) for of in (candidates < 0.4, candidates >= 0.4)
    )
    level = 0.2 * np.where(candidates >= 0.4, 1.06, np.linspace(1, 1.03, len(candidates)))
    assert likeliest(level.tolist(), 1.0) == pytest.approx([other, metal])
    assert likeliest(level.tolist(), 0.21) == pytest.approx([other]), "metals explain less than nothing"
    assert likeliest(level.tolist(), 0.201) == []
    assert likeliest(level.tolist(), 0.1) == []
    steep = 0.2 * np.linspace(1.0, 2.0, len(CANDIDATES))
    assert likeliest(steep.tolist(), 1.0) == pytest.approx([CANDIDATES[0], LEAST_METAL])
    steep[1] = 0.2 * (SLACK - 0.01)
    assert likeliest(steep.tolist(), 1.0)[0] == pytest.approx(np.sqrt(CANDIDATES[0] * CANDIDATES[1]))


def replace_surfels(world: GlossyWorld, parts: dict[str, torch.Tensor]):
    return replace(world.parameters, surfels={**world.parameters.surfels, **parts})


def test_where_no_glossy_surfel_is_seen_nothing_is_said(world: GlossyWorld):
    shots = [replace(shot, glossy=torch.zeros_like(shot.glossy)) for shot in shots_of_world(world)]
    assert initial_lights(world.parameters.all, shots, SETTINGS, EXTENT) == []
    assert as_photographs_allow(world.parameters, None) is world.parameters


def test_where_mirrored_rays_meet_nothing_nothing_is_said(world: GlossyWorld):
    """A floor under the sky alone: what it reflects is a function of direction, whatever its F0."""
    floor = world.parameters.take(torch.from_numpy(world.part == FLOOR))
    alone = GlossyWorld(floor, world.part[world.part == FLOOR], world.cameras)
    assert initial_lights(floor.all, shots_of_world(alone), SETTINGS, EXTENT) == []


def test_what_was_found_moves_less_than_what_was_guessed(world: GlossyWorld, monkeypatch: pytest.MonkeyPatch):
    """Adam's first steps are as long as the learning rate."""
    rates = [light_rates(EXTENT, SETTINGS, found)[FRESNEL] for found in (True, False)]
    assert rates == [FOUND_FRESNEL_RATE, FRESNEL_RATE]
    shots, settings = shots_of_world(world), replace(SETTINGS, iterations=12, radiance_share=0.5)
    start = with_light(world.parameters, shots, settings, 0)
    glossy, found = start.surfels[REGION][:, 0] < 0, initial_lights(start.all, shots, settings, EXTENT)[0]
    monkeypatch.setattr(_fit, "initial_lights", lambda *_: [found])

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
