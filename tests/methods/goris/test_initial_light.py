# SPDX-License-Identifier: Apache-2.0
"""Bounds of photographs on reflections before the first step, on surfels whose light is known."""

from collections.abc import Sequence
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
    InitialLight,
    Observations,
    Reflectance,
    _light_of,
    _mirrored,
    found_reflectance,
    initial_light,
    metal_f0,
    mirrored_pixels,
    observations,
)
from graycard.methods.goris._model import BRIGHTEST, DIFFUSE, FRESNEL, REGION
from graycard.methods.goris._objective import LightObjective
from graycard.methods.shading import look_up
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


def reflecting(world: GlossyWorld, f0: float | Sequence[float], *, metal: bool = False) -> GlossyWorld:
    """The same with a floor of an F0, and as a metal without diffuse radiance."""
    logits = torch.logit(torch.tensor(f0)).expand_as(world.parameters.all[FRESNEL]).contiguous()
    diffuse = world.parameters.all[DIFFUSE].clone()
    if metal:
        diffuse[torch.from_numpy(world.part == FLOOR)] = -12.0
    return replace(world, parameters=replace_surfels(world, {FRESNEL: logits, DIFFUSE: diffuse}))


def light_of(known: GlossyWorld) -> InitialLight:
    """Return the light that is found without F0."""
    unknown = {**known.parameters.all, FRESNEL: torch.zeros_like(known.parameters.all[FRESNEL])}
    found = initial_light(unknown, shots_of_world(known), SETTINGS, EXTENT)
    assert found is not None
    return found


@pytest.mark.parametrize(("f0", "off"), [(0.04, 0.85), (0.15, 0.85), (0.3, 1.0)])
def test_a_floor_reflects_about_as_much_as_it_did(world: GlossyWorld, f0: float, off: float):
    """Photographs of surfels with a known F0 tell it to a candidate.

    What is scattered is told to less than that: in the views on a floor of F0 0.3 most light is mirrored."""
    known = reflecting(world, f0)
    found = light_of(known)
    assert not found.reflectance.metal
    place, told = CANDIDATES.index(f0), float(found.reflectance.f0[0])
    assert (found.reflectance.f0 == told).all()
    assert CANDIDATES[max(place - 1, 0)] <= told <= CANDIDATES[min(place + 1, len(CANDIDATES) - 1)]
    assert float(found.surroundings.min()) > 0
    true = srgb_decode_tensor(BRIGHTEST * known.parameters.all[DIFFUSE].sigmoid())[found.surfels]
    assert float((found.diffuse - true).abs().mean()) < off * float(true.mean())
    start = as_photographs_allow(known.parameters, found)
    glossy = torch.from_numpy(world.part == FLOOR)
    torch.testing.assert_close(
        start.surfels[FRESNEL][glossy].sigmoid(), torch.full((int(glossy.sum()), 3), told)
    )
    torch.testing.assert_close(start.surfels[FRESNEL][~glossy], known.parameters.surfels[FRESNEL][~glossy])


@pytest.mark.parametrize("f0", [(0.5, 0.5, 0.5), (0.9, 0.6, 0.4)])
def test_a_metal_is_told_by_what_it_does_not_scatter(world: GlossyWorld, f0: tuple[float, float, float]):
    """And its colour by what its mirror images are of."""
    found = light_of(reflecting(world, f0, metal=True))
    assert found.reflectance.metal
    np.testing.assert_allclose(found.reflectance.f0, f0, rtol=0.1)
    assert not found.diffuse.any()


def test_pixels_tell_a_metal_apart_from_edges_of_what_it_mirrors(world: GlossyWorld):
    """All of them are inside of the mirror images of boards, where what is seen follows what is traced."""
    known = reflecting(world, (0.9, 0.6, 0.4), metal=True)
    values, shots = known.parameters.all, shots_of_world(known)
    found = mirrored_pixels(values, shots, SETTINGS, EXTENT)
    assert len(found.surfel) > 200
    assert float(found.passed.max()) < 0.05
    light, seen, _ = _mirrored(found)
    spread = np.median(np.abs(seen / light - (0.9, 0.6, 0.4)), axis=0)
    assert (spread < 0.05).all()
    np.testing.assert_allclose(metal_f0(found, np.zeros(3)), (0.9, 0.6, 0.4), rtol=0.03)


def test_short_rays_tell_nothing(world: GlossyWorld, monkeypatch: pytest.MonkeyPatch):
    """Boards begin 0.07 above the floor; rays have to go a multiple of their offset of 0.03."""
    known = reflecting(world, (0.9, 0.6, 0.4), metal=True)
    values, shots = known.parameters.all, shots_of_world(known)
    counts = []
    for times in (3.0, 7.0, 12.0):
        monkeypatch.setattr(_initial_light, "_AWAY", times)
        counts.append(len(mirrored_pixels(values, shots, SETTINGS, EXTENT).surfel))
    assert counts[0] > counts[1] > counts[2] > 0


def test_no_pixel_tells_of_what_is_not_mirrored_in_its_neighbours(world: GlossyWorld):
    """Rays of stripes a pixel wide meet nothing: those between them, which do, are at edges."""
    known = reflecting(world, 0.7, metal=True)
    shots = shots_of_world(known)
    striped = [replace(shot, glossy=shot.glossy * (torch.arange(44) % 2)) for shot in shots]
    assert len(mirrored_pixels(known.parameters.all, striped, SETTINGS, EXTENT).surfel) == 0
    otherwise = np.array([0.5, 0.6, 0.7])
    few = mirrored_pixels(known.parameters.all, shots, SETTINGS, EXTENT).take(np.arange(49))
    assert (metal_f0(few, otherwise) == otherwise).all()


@pytest.mark.parametrize("metal", [True, False])
def test_a_metal_goes_on_to_scatter_nothing(world: GlossyWorld, metal: bool):
    known, floor = (
        reflecting(world, 0.6 if metal else 0.15, metal=metal),
        torch.from_numpy(world.part == FLOOR),
    )
    settings = replace(SETTINGS, iterations=12, radiance_share=0.5)
    fitted = fit_light(known.parameters, shots_of_world(known), settings, 0, silent).parameters
    scattered = (BRIGHTEST * fitted.surfels[DIFFUSE][floor].sigmoid()).median()
    assert (float(scattered) < 0.002) == metal


def noisy(found: Observations, noise: float, seed: int) -> Observations:
    """With a standard deviation of a share of the mean."""
    drawn = np.random.default_rng(seed).normal(size=found.colour.shape)
    return replace(found, colour=found.colour + noise * found.colour.mean() * drawn)


@pytest.mark.parametrize("seed", [1000, pytest.param(1001, marks=pytest.mark.slow)])
@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_where_noise_is_nearly_all_nothing_is_said(world: GlossyWorld, noise: float, seed: int):
    known = reflecting(world, 0.04)
    found = observations(known.parameters.all, shots_of_world(known), SETTINGS, EXTENT)
    assert found_reflectance(noisy(found, 0.1, seed)) is not None
    assert found_reflectance(noisy(found, noise, seed)) is None


def test_half_open_rays_do_not_tell_how_much_is_reflected(
    world: GlossyWorld, monkeypatch: pytest.MonkeyPatch
):
    """At edges, where what was traced is most often wrong, here ten times as bright as it is."""
    known = reflecting(world, 0.3)
    true = observations(known.parameters.all, shots_of_world(known), SETTINGS, EXTENT)
    half = np.abs(true.passed - 0.5) < 0.45
    assert 0.005 < half.mean() < 0.3
    wrong = replace(true, radiance=np.where(half[:, None], 10 * true.radiance + 0.5, true.radiance))
    told, alone = found_reflectance(wrong), found_reflectance(true.take(~half))
    assert told is not None
    assert alone is not None
    assert np.array_equal(told.f0, alone.f0)
    assert abs(told.f0[0] - 0.3) < 0.11
    monkeypatch.setattr(_initial_light, "_CLEAR", 0.5)
    worse = found_reflectance(wrong)
    assert worse is None or abs(worse.f0[0] - 0.3) > 0.11


def test_few_sightings_tell_nothing(world: GlossyWorld):
    """Surroundings of 216 texels explain a hundred of them whatever F0 is; one alone has no difference."""
    found = observations(world.parameters.all, shots_of_world(world), SETTINGS, EXTENT)
    assert found_reflectance(found) is not None
    few = found.take(np.isin(found.surfel, np.unique(found.surfel)[:30]))
    assert 30 < len(few.surfel) < 216
    assert found_reflectance(few) is None
    _, first = np.unique(found.surfel, return_index=True)
    assert found_reflectance(found.take(first)) is None


def under_a_window(size: int, sightings: int = 40) -> Observations:
    """Points that mirror the upper half of a sky alone, black but for a window of 1 to 3 texels."""
    directions = np.random.default_rng(1000).normal(size=(200 * sightings, 3))
    directions[:, 2] = np.abs(directions[:, 2])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    sky = torch.full((6, size, size, 3), 0.1)
    sky[4, 2:4, 3:6] = 2.0
    seen = look_up(sky, torch.from_numpy(directions).float()).numpy().astype(np.float64)
    surfel, nothing = np.arange(len(directions)) % 200, np.zeros(len(directions))
    return Observations(surfel, 0.2 + 0.5 * seen, np.zeros_like(directions), nothing + 1, directions, nothing)


def test_the_environment_has_the_details_that_photographs_have(monkeypatch: pytest.MonkeyPatch):
    """A window smaller than a texel of the first fit. An even sky looks as what all points scatter alike."""
    found, told = under_a_window(16), Reflectance(np.full(3, 0.5), metal=False)
    light = _light_of(found, told, 16)
    upper = light.surroundings[4]
    assert float(upper[2:4, 3:6].min()) > 1.0
    assert float(upper[8:, 8:].mean()) < 0.3
    assert float(light.diffuse.std()) < 0.01
    monkeypatch.setattr(_initial_light, "_ROUNDS", 0)
    assert float(_light_of(found, told, 16).surroundings[4].max()) < 0.8 * float(upper.max())


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


def test_what_was_found_moves_less_than_what_was_guessed(world: GlossyWorld, monkeypatch: pytest.MonkeyPatch):
    """Adam's first steps are as long as the learning rate."""
    rates = [light_rates(EXTENT, SETTINGS, found)[FRESNEL] for found in (True, False)]
    assert rates == [FOUND_FRESNEL_RATE, FRESNEL_RATE]
    wood = reflecting(world, 0.15)
    shots, settings = shots_of_world(wood), replace(SETTINGS, iterations=12, radiance_share=0.5)
    start = with_light(wood.parameters, shots, settings, 0)
    glossy, found = start.surfels[REGION][:, 0] < 0, initial_light(start.all, shots, settings, EXTENT)
    assert found is not None
    monkeypatch.setattr(_fit, "initial_light", lambda *_: found)

    def moved(first: bool, begun: float) -> float:
        own = fit_light(
            wood.parameters, shots, replace(settings, first_light=first), 0, silent
        ).parameters.surfels
        return float((own[FRESNEL][glossy] - torch.logit(torch.tensor(begun))).abs().mean())

    assert 0 < moved(True, float(found.reflectance.f0[0])) < 0.5 * moved(False, FIRST_FRESNEL)


def test_a_fit_of_light_gets_nearer_to_photographs(world: GlossyWorld):
    """From coloured surfels: lower than its start, and the same again to the bit."""
    shots = shots_of_world(world)
    ends = [fit_light(world.parameters, shots, SETTINGS, 0, silent).parameters for _ in range(2)]
    for name, values in ends[0].all.items():
        assert torch.equal(values, ends[1].all[name]), name
    objective = LightObjective(shots, SETTINGS, EXTENT, 0)
    start = fit_light(
        world.parameters, shots, replace(SETTINGS, iterations=2, radiance_share=0.5), 0, silent
    ).parameters

    def loss(values: dict[str, torch.Tensor]) -> float:
        return sum(float(objective(values, step).loss.detach()) for step in range(4))

    assert loss(ends[0].all) < 0.85 * loss(start.all)
