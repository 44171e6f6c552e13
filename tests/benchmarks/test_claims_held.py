# SPDX-License-Identifier: Apache-2.0
"""Verdicts that the rule gives and that are held back: fits cut short, other budgets, refits."""

from collections.abc import Sequence

import numpy as np
import pytest

from claims_by_hand import (
    SPREAD,
    against,
    also_scored,
    check_of,
    estimate_of,
    fitted,
    judged,
    led_by,
    run_with,
    seeded,
    values,
)
from graycard.benchmarks.claims import Scenes
from graycard.benchmarks.claims._claim import Nested
from graycard.records import ClaimResult, RowFit, RunRecord
from runs_by_hand import run_of, scene_of

NESTED = (Nested("theirs", "mine"),)
"""``mine`` contains ``theirs``."""
FLAT = [20.0] * 8


def trained(run: RunRecord, lead: Sequence[float | None]) -> RunRecord:
    """The run in which ``mine`` explains training views better than ``theirs`` by so much on each scene."""
    table = {"theirs": FLAT, "mine": [None if value is None else 20 + value for value in lead]}
    return also_scored(run, "training_view.psnr", table)


def held(found: ClaimResult) -> tuple[str, str | None, str]:
    return found.verdict, found.before, found.needs


STANDS = ("reproduced", None, "")
SHORT = ("undecided", "reproduced", "fits that are run to the end")


@pytest.mark.parametrize(
    ("lead", "expected"),
    [
        ([1.0] * 8, STANDS),
        ([-0.099] * 8, STANDS),
        ([-0.101] * 8, SHORT),
        ([-2.0] * 8, SHORT),
        ([-2.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1, 0.1], STANDS),  # by the mean it is -0.2, by the centre 0.05
        ([-0.4, -0.3, -0.2, -0.2, -0.2, 0.1, 0.1, 0.1], SHORT),
    ],
)
def test_a_model_that_explains_its_photographs_worse_than_one_it_contains(
    lead: list[float], expected: tuple[str, str | None, str]
) -> None:
    centre = estimate_of(lead)
    assert (centre < -0.1) == (expected == SHORT)
    found = judged(trained(against(5.0), lead), check_of(), nested=NESTED)
    assert held(found) == expected
    assert found.checks[0].verdict == "reproduced", "the check says what it says"
    worse = sum(value < 0 for value in lead)
    said = (
        f"mine has not converged: it contains theirs and explains its own photographs {-centre:.2g} dB "
        f"worse, on {worse} of 8 scenes"
    )
    assert found.suspended == (said if expected == SHORT else "")


def test_only_the_row_that_contains_another_is_suspended() -> None:
    run = trained(against(5.0), [-1.0] * 8)
    assert held(judged(run, check_of(rows=("mine", "gray")), nested=NESTED)) == SHORT
    assert held(judged(run, check_of(rows=("bound", "theirs")), nested=NESTED)) == STANDS
    told = check_of(rows=("mine", "gray"), id="told", decides=False)
    assert held(judged(run, check_of(rows=("bound", "theirs")), told, nested=NESTED)) == STANDS
    assert held(judged(run, check_of())) == STANDS, "nothing is said of what contains what"
    assert held(judged(against(5.0), check_of(), nested=NESTED)) == STANDS, "nobody scored training views"


def test_it_is_asked_on_the_scenes_of_the_claim_alone() -> None:
    scenes = [scene_of(i, "corridor" if i < 8 else "shelf") for i in range(16)]
    table = {"mine": {"psnr": [5.0] * 16}, "theirs": {"psnr": [0.0] * 16}}
    corridors, all_of_them = check_of(scenes=Scenes(("corridor",))), check_of()
    run = run_of(table, scenes)
    elsewhere = {"mine": [21.0] * 8 + [10.0] * 8, "theirs": [20.0] * 16}
    found = also_scored(run, "training_view.psnr", elsewhere)
    assert held(judged(found, corridors, nested=NESTED)) == STANDS
    assert held(judged(found, all_of_them, nested=NESTED)) == SHORT
    here = also_scored(run, "training_view.psnr", elsewhere | {"mine": [19.0] * 8 + [30.0] * 8})
    assert held(judged(here, corridors, nested=NESTED)) == SHORT
    assert held(judged(here, all_of_them, nested=NESTED)) == STANDS


def test_a_scene_without_a_score_of_training_views_is_left_out() -> None:
    run = trained(against(5.0), [None, None, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0])
    assert judged(run, check_of(), nested=NESTED).suspended.endswith("on 6 of 6 scenes")


@pytest.mark.parametrize(
    ("lead", "asked_by", "verdict", "before"),
    [
        (-5.0, "paper", "undecided", "contradicted"),
        (5.0, "graycard", "open", "holds"),
        (-5.0, "graycard", "open", "does not hold"),
        (0.0, "paper", "undecided", None),
        (0.0, "graycard", "open", None),
    ],
)
def test_whatever_was_said_is_held_back(lead: float, asked_by: str, verdict: str, before: str | None) -> None:
    run = trained(against(lead), [-1.0] * 8)
    found = judged(run, check_of(), nested=NESTED, asked_by=asked_by)
    assert held(found) == (verdict, before, "fits that are run to the end")


def test_what_cannot_be_tested_is_not_suspended() -> None:
    run = trained(against(5.0), [-1.0] * 8)
    for found in (
        judged(run, check_of(rows=("mine", "nobody")), nested=NESTED),
        judged(run, check_of(), nested=NESTED, unavailable="It needs a robot."),
    ):
        assert (*held(found), found.suspended) == ("not testable here", None, "", "")


MORE_STEPS = "fits of so many steps that more do not turn the verdict"


@pytest.mark.parametrize(
    ("half", "twice", "suspended"),
    [
        (5.0, 6.0, ""),
        (-5.0, 5.0, "with 0.5 times the steps it turns to contradicted"),
        (5.0, 0.0, "with 2 times the steps it turns to undecided"),
        (0.0, -5.0, "with 0.5 times the steps it turns to undecided"),
        (None, 5.0, ""),
    ],
)
def test_a_verdict_that_turns_with_the_steps(half: float | None, twice: float, suspended: str) -> None:
    gone = run_with(theirs=values(0))
    budgets = {2.0: against(twice), 0.5: gone if half is None else against(half)}
    found = judged(against(5.0), check_of(), budgets=budgets)
    assert found.suspended == suspended
    assert held(found) == (("undecided", "reproduced", MORE_STEPS) if suspended else STANDS)
    effects = {"0.5": half, "2": twice}
    assert found.checks[0].at_budgets == pytest.approx({k: v for k, v in effects.items() if v is not None})
    assert found.checks[0].estimate == pytest.approx(5.0)


def test_sizes_that_turn_with_the_steps_turn_the_verdict() -> None:
    check = check_of(paper=5.4)
    found = judged(against(5.0), check, budgets={2.0: against(1.0)})
    assert found.suspended == "with 2 times the steps it turns to smaller than claimed"


def test_an_open_verdict_does_not_turn() -> None:
    found = judged(against(0.0), check_of(), budgets={2.0: against(5.0)})
    assert (*held(found), found.suspended) == ("undecided", None, "", "")


def test_steps_of_a_question_of_ours() -> None:
    found = judged(against(5.0), check_of(), budgets={0.5: against(-5.0)}, asked_by="graycard")
    assert held(found) == ("open", "holds", MORE_STEPS)
    assert "does not hold" in found.suspended
    assert "contradicted" not in found.suspended, "nobody claimed it"


EFFECTS = 1.0 + 2 * SPREAD
"""Effects of 0.2 to 1.8: certain by the rule, as the interval is 0.4 to 1.6."""


def noisy(noise: float, effects: np.ndarray = EFFECTS) -> RunRecord:
    """Two seeds a scene whose effects are so far from their mean, up and down."""
    signs = np.array([1, -1] * (len(effects) // 2))
    return seeded(np.stack([effects + noise * signs, effects - noise * signs], axis=1))


def test_a_verdict_that_refits_would_not_give_again() -> None:
    sure, shaky = judged(noisy(0.05), check_of()), judged(noisy(2.0), check_of())
    assert held(sure) == STANDS
    assert sure.stability is not None
    assert sure.stability > 0.99
    assert shaky.stability is not None
    assert shaky.stability < 0.9
    assert (shaky.verdict, shaky.before) == ("undecided", "reproduced")
    share = f"{shaky.stability:.0%}"
    assert shaky.suspended == f"only {share} of simulated refits of these scenes give this verdict"
    assert shaky.needs == "more scenes: no number of seeds is enough"
    between = judged(noisy(0.6), check_of())
    assert between.needs.startswith("about ")
    assert between.needs.endswith(" seeds a scene")
    asked = judged(noisy(2.0), check_of(), asked_by="graycard")
    assert (asked.verdict, asked.before) == ("open", "holds")


def test_no_number_of_seeds_helps_where_noise_alone_reaches_the_band() -> None:
    """0.4 to 1.6 meets 1.5 to 9 dB: what scenes differ in without the noise lies below."""
    found = judged(noisy(0.9), check_of(accepted=(1.5, 9.0)))
    assert (found.verdict, found.before) == ("undecided", "reproduced")
    assert found.needs == "more scenes: no number of seeds is enough"


def test_an_unstable_undecided_verdict_is_not_held_back() -> None:
    found = judged(noisy(2.0, EFFECTS - 1), check_of())
    assert (*held(found), found.suspended) == ("undecided", None, "", "")


def test_all_reasons_are_told_in_order() -> None:
    """Fits that are cut short, then steps, then chance; each with what would remove it."""
    shaky, half = noisy(2.0), {0.5: against(-5.0)}
    short = (
        "mine has not converged: it contains theirs and explains its own photographs 1 dB worse, on 8 of 8 "
        "scenes"
    )
    turned, run_on = "with 0.5 times the steps it turns to contradicted", "fits that are run to the end"
    chance = judged(shaky, check_of())
    assert chance.suspended.startswith("only ")
    steps = judged(shaky, check_of(), budgets=half)
    assert steps.suspended == f"{turned}; {chance.suspended}"
    assert held(steps) == ("undecided", "reproduced", f"{MORE_STEPS}; {chance.needs}")
    everything = judged(trained(shaky, [-1.0] * 8), check_of(), nested=NESTED, budgets=half)
    assert everything.suspended == f"{short}; {turned}; {chance.suspended}"
    assert held(everything) == ("undecided", "reproduced", f"{run_on}; {MORE_STEPS}; {chance.needs}")


UNKNOWN = "nobody measured how far fits of these rows differ"


def test_a_verdict_on_fits_whose_noise_nobody_measured_is_held_back() -> None:
    run = fitted(led_by(list(EFFECTS)))
    found = judged(run, check_of())
    assert (held(found), found.stability) == (("undecided", "reproduced", "several seeds a scene"), None)
    assert found.suspended == UNKNOWN
    asked = judged(run, check_of(), asked_by="graycard")
    assert held(asked) == ("open", "holds", "several seeds a scene")
    both = judged(run, check_of(), budgets={2.0: against(-5.0)})
    assert both.suspended == f"with 2 times the steps it turns to contradicted; {UNKNOWN}"
    assert both.needs == f"{MORE_STEPS}; several seeds a scene"


def test_noise_that_nobody_measured_holds_no_open_verdict_back() -> None:
    found = judged(fitted(led_by(list(EFFECTS - 1))), check_of())
    assert (*held(found), found.suspended, found.stability) == ("undecided", None, "", "", None)


def test_a_row_is_not_contained_in_itself() -> None:
    with pytest.raises(ValueError, match="expected two rows in nested, got 'mine' twice"):
        Nested("mine", "mine")


def test_the_means_stand_beside_the_verdict() -> None:
    run = also_scored(trained(fitted(against(5.0), 700), [0.5] * 8), "novel_view.psnr", {"mine": [18.0] * 8})
    found = judged(run, check_of(), budget={"steps": "40,000"}).budget
    assert found.paper == {"steps": "40,000"}
    assert found.here == {"priors": "none", "other budgets": "not run"}
    assert found.fits == (RowFit("mine", 700, 20.5, 18.0),)
