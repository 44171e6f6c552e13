# SPDX-License-Identifier: Apache-2.0
"""Lamps are pruned, merged, split and put elsewhere, and only where the loss over all views falls."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from graycard.methods.gsid import GsidSettings, _aggregation, _objective
from graycard.methods.gsid._aggregation import (
    APART,
    STRENGTHS,
    Lack,
    _merged,
    _put,
    _split,
    _Trial,
    aggregated,
    without_dim_lamps,
)
from graycard.methods.gsid._candidates import FirstLights
from graycard.methods.gsid._fit import chunk_ends
from graycard.methods.gsid._lights import (
    AMPLITUDES,
    AXES,
    DARK,
    POSITIONS,
    SHARPNESS,
    first_lights,
    lamps_from,
)
from graycard.methods.gsid._lights import LAMPS as LAMP_NAMES
from graycard.methods.gsid._stage import LightStage, at_half_size, at_tile_size, objective_in
from graycard.methods.splat import FitState, Parameters, initial_state
from lit_sheets import EXTENT, LAMPS, World

SETTINGS = GsidSettings(visibility="traced", iterations=90, lamps=3, sky_size=4, bounces=False)
TRUE = np.array([light.position for light in LAMPS])
SENT = np.array([light.intensity for light in LAMPS])
FALSE = np.array([0.0, 0.9, 0.8])


def stage_of(world: World, settings: GsidSettings = SETTINGS) -> LightStage:
    return LightStage(world.surfels, world.shots, settings, EXTENT, 0)


def state_of(
    world: World, positions: np.ndarray, sent: np.ndarray, settings: GsidSettings = SETTINGS
) -> FitState:
    """Lamps that are alike all round, of a lobe; others are out."""
    strengths = torch.zeros(len(positions), 2, 3)
    strengths[:, 0] = torch.from_numpy(sent)
    places, sky = torch.from_numpy(positions).float(), torch.full((6, 3), 0.05)
    lights = first_lights(FirstLights(places, strengths, torch.zeros(3), sky), settings)
    lights[SHARPNESS][:, 0] = -9
    dark = torch.ones(settings.lamps, dtype=torch.bool)
    dark[: len(positions)] = False
    lights[AMPLITUDES][dark], lights[AMPLITUDES][:, 1] = DARK, DARK
    surface = {name: values.clone() for name, values in world.surface.items()}
    return initial_state(Parameters(surface, lights), 0)


def trial_of(world: World, state: FitState, settings: GsidSettings = SETTINGS) -> _Trial:
    stage = stage_of(world, settings)
    return _Trial(stage, at_half_size(stage, state.parameters), state.parameters)


def loss_of(world: World, state: FitState) -> float:
    return trial_of(world, state).loss


def test_true_lamps_stay(world: World):
    state = state_of(world, TRUE, SENT)
    before = {name: values.clone() for name, values in state.parameters.shared.items()}
    after = aggregated(state, stage_of(world))
    for name, values in before.items():
        assert torch.equal(after.parameters.shared[name], values), name


def test_a_lamp_that_is_not_there_is_put_out(world: World):
    false = state_of(world, np.concatenate([TRUE, FALSE[None]]), np.concatenate([SENT, [[0.3, 0.3, 0.3]]]))
    false.moments[POSITIONS].first[:] = 1
    before = loss_of(world, false)
    after = aggregated(false, stage_of(world))
    assert loss_of(world, after) < before
    flux = lamps_from(after.parameters.shared).flux().sum(dim=-1)
    assert flux[2] < 0.02 * flux.sum()
    assert bool((after.moments[POSITIONS].first[:2] == 1).all())
    assert bool((after.moments[POSITIONS].first[2] == 0).all())


def test_a_lamp_that_is_out_goes_where_light_is_missing(world: World):
    """Without the first lamp: another one shines then, nearer to its place than to the one that is there."""
    state = state_of(world, TRUE[1:], SENT[1:])
    before = loss_of(world, state)
    after = aggregated(state, stage_of(world))
    assert loss_of(world, after) < 0.9 * before
    places = after.parameters.shared[POSITIONS].numpy()
    assert np.linalg.norm(places[1:, :2] - TRUE[0, :2], axis=1).min() < 0.8


def test_no_lamp_is_put_beside_another(world: World, monkeypatch: pytest.MonkeyPatch):
    """A second lamp mends no lack of light that a first one at that place did not."""
    trial = trial_of(world, state_of(world, TRUE[1:], SENT[1:]))
    for place, tried in ((TRUE[1] + 0.1, 0), (TRUE[0], len(STRENGTHS))):
        lack = Lack(torch.from_numpy(place).float(), torch.ones(3))
        monkeypatch.setattr(_aggregation, "largest_lack", lambda *_, lack=lack: lack)
        assert len(list(_put(trial))) == tried


def test_two_lamps_become_one_that_sends_what_both_sent(world: World):
    near = np.array([[0.3, 0.1, 0.0], [-0.1, 0.0, 0.1]]) * 0.5
    state = state_of(
        world, np.stack([TRUE[0], *(TRUE[1] + near)]), np.stack([SENT[0], 0.25 * SENT[1], 0.75 * SENT[1]])
    )
    trial = trial_of(world, state)
    (lights,) = _merged(trial)
    lamps = lamps_from(lights)
    flux, before = lamps.flux(), lamps_from(trial.lights).flux()
    torch.testing.assert_close(flux.sum(dim=0), before.sum(dim=0), rtol=1e-3, atol=1e-5)
    out = int(flux.sum(dim=-1).argmin())
    assert out in (1, 2)
    middle = torch.from_numpy(TRUE[1] + 0.25 * near[0] + 0.75 * near[1]).float()
    torch.testing.assert_close(lamps.positions[3 - out], middle, rtol=1e-3, atol=1e-3)
    assert torch.equal(lamps.positions[0], trial.lights[POSITIONS][0])


def test_halves_of_a_lamp_are_beside_its_place(world: World):
    trial = trial_of(world, state_of(world, TRUE, SENT))
    brightest = int(trial.shining[0])
    proposals = list(_split(trial))
    assert len(proposals) == 3
    for axis, lights in enumerate(proposals):
        halves = lights[POSITIONS][[brightest, 2]]
        torch.testing.assert_close(halves.mean(dim=0), trial.lights[POSITIONS][brightest])
        expected = 2 * APART * EXTENT * torch.eye(3)[axis]
        torch.testing.assert_close(halves[0] - halves[1], expected, atol=1e-5, rtol=0)
        sent = lamps_from(lights).flux()
        torch.testing.assert_close(
            sent.sum(dim=0), lamps_from(trial.lights).flux().sum(dim=0), rtol=1e-3, atol=0
        )


def test_what_explains_less_is_not_kept(world: World):
    trial = trial_of(world, state_of(world, TRUE, SENT))
    worse = {name: values.clone() for name, values in trial.lights.items()}
    worse[POSITIONS] = worse[POSITIONS] + 0.5
    assert trial.best(iter([worse])) is trial
    better = trial_of(world, replace(state_of(world, TRUE + 0.5, SENT)))
    assert better.best(iter([dict(trial.lights)])).loss == pytest.approx(trial.loss)


def test_without_lamps_nothing_is_tried(world: World):
    settings = replace(SETTINGS, lamps=0)
    state = state_of(world, TRUE[:0], SENT[:0], settings)
    assert aggregated(state, stage_of(world, settings)) is state


@pytest.mark.parametrize(("tile", "size"), [(24, (32, 36)), (16, (16, 18)), (11, (8, 9))])
def test_views_larger_than_a_tile_are_looked_at_smaller(world: World, tile: int, size: tuple[int, int]):
    """Lamps change for the same cost whatever the size of pictures; what is no larger stays as it is."""
    stage = stage_of(world, replace(SETTINGS, tile=tile))
    state = state_of(world, TRUE, SENT)
    smaller = at_tile_size(stage, state.parameters)
    assert {shot.shown.shape[:2] for shot in smaller.shots} == {size}
    assert (smaller is stage) is (size == (32, 36))
    mean = smaller.shots[0].linear.mean(dim=(0, 1))
    torch.testing.assert_close(mean, stage.shots[0].linear.mean(dim=(0, 1)))


def test_views_are_halved_at_once_as_one_time_after_another(world: World):
    stage, parameters = stage_of(world, replace(SETTINGS, tile=11)), state_of(world, TRUE, SENT).parameters
    once = at_half_size(stage, parameters, 2)
    twice = at_half_size(at_half_size(stage, parameters), parameters)
    assert once.settings == twice.settings
    assert at_half_size(stage, parameters, 0) is stage
    for one, other in zip(once.shots, twice.shots, strict=True):
        for name in ("linear", "shown"):
            assert torch.equal(getattr(one, name), getattr(other, name)), name
        assert torch.equal(one.ground.points, other.ground.points)
        assert one.guess.base_color is not None
        assert other.guess.base_color is not None
        assert torch.equal(one.guess.base_color, other.guess.base_color)


@pytest.mark.parametrize("rate", [0.0, 0.1])
def test_surfaces_are_drawn_once_for_all_trials(world: World, rate: float, monkeypatch: pytest.MonkeyPatch):
    """With the losses that they have where they are drawn anew."""
    drawn: list[str] = []
    for name in ("seen_anew", "pixels_of"):
        draw = getattr(_objective, name)

        def noted(*given: Any, name: str = name, draw: Callable[..., Any] = draw) -> Any:
            drawn.append(name)
            return draw(*given)

        monkeypatch.setattr(_objective, name, noted)
    settings = replace(SETTINGS, geometry_rate=rate)
    trial = trial_of(world, state_of(world, TRUE[1:], SENT[1:], settings), settings)
    trials = [
        trial,
        *(replace(trial, parameters=Parameters(trial.parameters.surfels, dict(p))) for p in _put(trial)),
    ]
    losses = [(one.half_loss, one.loss) for one in trials]
    assert len(trials) == 1 + len(STRENGTHS)
    assert drawn == ["seen_anew" if rate else "pixels_of"] * 2 * len(world.shots)
    for one, (half, whole) in zip(trials, losses, strict=True):
        values = one.parameters.all
        assert objective_in(one.half, one.parameters).over_all(values) == half
        assert objective_in(one.stage, one.parameters).over_all(values) == whole


def test_dim_lamps_are_left_out(world: World):
    """With what Adam remembers of them; others stay as they are."""
    places, sent = np.concatenate([TRUE, FALSE[None]]), np.concatenate([SENT, [[0.01, 0.01, 0.01]]])
    state = state_of(world, places[[0, 2, 1]], sent[[0, 2, 1]])
    state.moments[POSITIONS].first[:] = torch.arange(3.0)[:, None]
    after = without_dim_lamps(state, stage_of(world))
    assert [len(after.parameters.shared[name]) for name in LAMP_NAMES] == [2] * 4
    for name in LAMP_NAMES:
        assert torch.equal(after.parameters.shared[name], state.parameters.shared[name][[0, 2]])
    assert after.moments[POSITIONS].first[:, 0].tolist() == [0, 2]
    assert loss_of(world, after) == pytest.approx(loss_of(world, state), rel=0.05)


def test_lamps_stay_that_are_seen_beside_one_that_shines_elsewhere(world: World):
    """A beam to where no camera looks sends fifty times as much as both true lamps, and gives nothing."""
    state = state_of(world, np.concatenate([TRUE, FALSE[None]]), np.concatenate([SENT, [[5e4] * 3]]))
    lights = state.parameters.shared
    lights[AXES][2], lights[SHARPNESS][2] = torch.tensor([0.0, 0.0, 1.0]), 4.0
    flux = lamps_from(lights).flux().sum(dim=-1)
    assert float(flux[:2].max()) < 0.02 * float(flux.sum())
    after = without_dim_lamps(state, stage_of(world)).parameters.shared
    assert torch.equal(after[POSITIONS], lights[POSITIONS][:2])


@pytest.mark.parametrize(("steps", "share"), [(825, 0.1), (66, 0.1), (4, 0.1), (50, 0.5), (7, 1.0)])
def test_chunks_are_alike_to_a_step(steps: int, share: float):
    """The last chunk too: lamps that are left out before it have steps that make up for them."""
    sizes = np.diff([0, *chunk_ends(steps, share)])
    assert sizes.sum() == steps
    assert sizes.max() - sizes.min() <= 1
    assert len(sizes) == min(steps, round(1 / share))
