# SPDX-License-Identifier: Apache-2.0
"""Parameters that move in each stage."""

import pytest

from graycard.methods.splat import CENTRES, LOG_SCALES, LOGITS, ROTATIONS
from graycard.methods.sunfaded import SunFadedSettings
from graycard.methods.sunfaded._light import NETWORK, POSITION
from graycard.methods.sunfaded._model import ALBEDO, AMBIENT
from graycard.methods.sunfaded._schedule import ENDS, FitStage, density_rules, learning_rates, stage_at
from graycard.methods.sunfaded._settings import Schedule

SURFELS = {CENTRES, LOG_SCALES, ROTATIONS, LOGITS, ALBEDO}
LAMP = {POSITION, *NETWORK}


def moving(share: float, **settings: object) -> set[str]:
    rates = learning_rates(2.0, SunFadedSettings(**settings))  # pyright: ignore[reportArgumentType]
    return {name for name, rate in rates.items() if rate.at(share) > 0}


@pytest.mark.parametrize(
    ("share", "stage", "names"),
    [
        (0.1, FitStage.UNLIT, SURFELS | {AMBIENT}),
        (0.3, FitStage.LAMP, LAMP),
        (0.6, FitStage.JOINT, SURFELS | LAMP | {AMBIENT}),
        (0.8, FitStage.OPACITY, {LOGITS}),
        (0.9, FitStage.REFINED, SURFELS | {AMBIENT}),
    ],
)
def test_the_paper_moves_what_it_says(share: float, stage: FitStage, names: set[str]):
    assert stage_at(share, "paper") is stage
    assert moving(share, schedule="paper") == names


@pytest.mark.parametrize("schedule", list(ENDS))
def test_stages_follow_each_other_to_the_end(schedule: Schedule):
    ends = ENDS[schedule]
    assert sorted(ends) == list(ends)
    assert ends[-1] == 1
    assert [stage_at(end - 1e-6, schedule) for end in ends] == list(FitStage)


def test_the_released_code_moves_the_ambient_light_with_the_lamp():
    assert moving(0.3, schedule="release_40k") == LAMP | {AMBIENT}
    assert moving(0.6, schedule="release_40k") == SURFELS | LAMP | {AMBIENT}


def test_the_released_code_moves_everything_at_every_other_step_in_the_end():
    steps = 2000
    rates = learning_rates(2.0, SunFadedSettings(iterations=steps, schedule="release_40k"))
    for name in SURFELS | LAMP | {AMBIENT}:
        moved = [rates[name].at(step / steps) > 0 for step in range(1750, steps)]
        assert moved == [True, False] * 125


def test_without_ambient_light_the_first_stage_has_the_lamp():
    assert moving(0.005, ambient=False) == SURFELS | LAMP
    assert AMBIENT not in moving(0.6, ambient=False)


@pytest.mark.parametrize("schedule", ["short", "paper"])
@pytest.mark.parametrize("name", [*sorted(LAMP), AMBIENT])
def test_lights_come_to_rest(schedule: Schedule, name: str):
    """Lights alone move to the end: a lamp that still jumps takes surfels and albedo along."""
    settings = SunFadedSettings(schedule=schedule)
    rates, ends = learning_rates(2.0, settings), ENDS[schedule]
    last = ends[FitStage.REFINED if name == AMBIENT else FitStage.JOINT] - 1e-6
    first = ends[FitStage.UNLIT] if name in LAMP else 0.0
    assert rates[name].at(last) < 0.5 * rates[name].at(first)
    assert rates[ALBEDO].at(ends[FitStage.JOINT] - 1e-6) == rates[ALBEDO].at(0.0)


@pytest.mark.parametrize("name", [*sorted(LAMP), AMBIENT])
def test_the_released_code_never_slows_its_lights_down(name: str):
    rate = learning_rates(2.0, SunFadedSettings(schedule="release_40k"))[name]
    assert rate.at(0.3) == rate.at(0.6) > 0


def test_surfels_are_taken_away_while_opacities_are_fitted_and_not_after():
    rules = density_rules(SunFadedSettings(iterations=2000, surfels=70, schedule="paper"))
    assert rules.limit == 70
    assert any(rules.densifies(step, 2000) for step in range(1500, 1750))
    assert not any(rules.densifies(step, 2000) for step in range(1750, 2001))
    assert not any(rules.resets(step, 2000) for step in range(2000))


@pytest.mark.parametrize("schedule", list(ENDS))
@pytest.mark.parametrize("steps", [60, 80, 100, 300, 500, 1000, 2000])
def test_surfels_stand_still_while_the_lamp_is_found(schedule: Schedule, steps: int):
    """Not one comes or goes, whatever the number of steps: views are drawn once then."""
    rules = density_rules(SunFadedSettings(iterations=steps, schedule=schedule))
    for done in range(1, steps):
        if (
            stage_at(done / steps, schedule) is FitStage.LAMP
            and stage_at((done - 1) / steps, schedule) is FitStage.LAMP
        ):
            assert not rules.densifies(done, steps)
    assert any(rules.densifies(done, steps) for done in range(1, steps))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"iterations": 0}, "1 or more iterations"),
        ({"tile": 0.0}, "tile and blur"),
        ({"blur": 2.0}, "tile and blur"),
        ({"fill": 1.5}, "fill"),
        ({"beta": -1.0}, "beta and weights of 0 or more"),
    ],
)
def test_settings_out_of_range_are_refused(settings: dict[str, float], message: str):
    with pytest.raises(ValueError, match=message):
        SunFadedSettings(**settings)  # pyright: ignore[reportArgumentType]
