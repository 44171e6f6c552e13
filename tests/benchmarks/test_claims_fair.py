# SPDX-License-Identifier: Apache-2.0
"""Files of claims that the judged authors can accept: no stand-in decides, own questions stand apart."""

import math
from collections.abc import Iterator

import pytest

from graycard.benchmarks import load_suite
from graycard.benchmarks._suites import opened
from graycard.benchmarks.claims import Check, Claim, Paper, claims_names, load_claims
from graycard.benchmarks.claims._rules import levels_for
from graycard.eval.statistics import LEVEL, least_scenes
from graycard.synth import SceneSpec, resolved_knobs

STAND_INS = (".flip", ".footprint", ".mirror", ".flip_hdr")
"""Ends of metrics that no paper prints: FLIP is told for LPIPS, PSNR of a region for LPIPS of a box."""
OWN = {"sunfaded": {"S13", "S14"}, "goris": {"R14", "R15", "R17", "R20"}, "goris-robust": {"R18", "R19"}}
LEAST = 6
"""Scenes with which an exact signed-rank test can be certain at 5 %."""


def deciding(paper: Paper) -> Iterator[tuple[Claim, Check]]:
    for claim in paper.claims:
        yield from ((claim, check) for check in claim.checks if check.decides)


def is_a_guard(paper: Paper, claim: Claim, check: Check) -> bool:
    """Tell if a check asks only to beat what costs nothing, without which being alike would mean nothing."""
    return check.rule == "better" and check.rows[-1] == (claim.trivial or paper.trivial)


@pytest.mark.parametrize("name", claims_names())
def test_no_stand_in_for_a_papers_metric_decides(name: str) -> None:
    paper = load_claims(name)
    for claim, check in deciding(paper):
        if claim.asked_by == "paper" and not is_a_guard(paper, claim, check):
            named = (check.quantity.metric, check.quantity.less)
            assert not any(m.endswith(STAND_INS) for m in named), f"{claim.id} {check.id}"
            assert not any(m.startswith("count.") for m in named), f"{claim.id} {check.id}"


@pytest.mark.parametrize("name", claims_names())
def test_no_stand_in_for_a_papers_network_decides(name: str) -> None:
    """Algorithms that inpaint without weights are no LaMa."""
    paper = load_claims(name)
    overrides = {m.row: m.priors.overrides for m in load_suite(paper.suite).methods}
    classical = {
        row for row, kinds in overrides.items() if any(k.source == "classical" for k in kinds.values())
    }
    for claim, check in deciding(paper):
        if claim.asked_by == "paper":
            assert not classical & {*check.rows, *check.minus}, f"{claim.id} {check.id}"


@pytest.mark.parametrize("name", claims_names())
def test_questions_of_graycards_own_are_told_apart(name: str) -> None:
    claims = load_claims(name).claims
    assert {claim.id for claim in claims if claim.asked_by == "graycard"} == OWN.get(name, set())
    for claim in claims:
        assert claim.source.startswith("graycard's own") == (claim.asked_by == "graycard"), claim.id


@pytest.mark.parametrize("name", claims_names())
def test_what_is_not_testable_here_decides_nothing(name: str) -> None:
    for claim, check in deciding(load_claims(name)):
        assert not claim.unavailable, f"{claim.id} {check.id}"


@pytest.mark.parametrize("name", claims_names())
def test_every_paper_says_what_it_worked_with(name: str) -> None:
    budget = load_claims(name).budget
    assert {"steps", "pixels", "views", "primitives", "priors"} <= budget.keys()
    assert all(budget.values())


@pytest.mark.parametrize("name", claims_names())
def test_a_row_that_a_loss_besides_photographs_holds_contains_no_trivial_one(name: str) -> None:
    """Doing nothing, and what a prior alone says, explain photographs better than a fit is allowed to."""
    pairs = load_claims(name).nested
    assert not {"do-nothing", "gsid-prior-only"} & {pair.inner for pair in pairs}


def test_a_fit_without_a_prior_contains_that_without_ambient_light() -> None:
    pairs = {(pair.inner, pair.outer) for pair in load_claims("sunfaded").nested}
    assert ("sunfaded-no-ambient", "sunfaded-no-prior") in pairs


def is_meant(check: Check, scene: SceneSpec) -> bool:
    wanted, knobs = check.scenes, resolved_knobs(scene)
    return (not wanted.families or scene.family in wanted.families) and all(
        low <= knobs[knob] <= high for knob, (low, high) in wanted.knobs.items()
    )


@pytest.mark.parametrize("name", claims_names())
def test_the_suite_has_scenes_enough_to_decide_each_claim(name: str) -> None:
    paper = load_claims(name)
    scenes = load_suite(paper.suite).scenes
    for claim, check in deciding(paper):
        assert sum(is_meant(check, s) for s in scenes) >= LEAST, f"{claim.id} {check.id}"


@pytest.mark.parametrize("name", claims_names())
def test_sealed_scenes_are_enough_to_refute_each_claim(name: str) -> None:
    """A claim of several checks is refuted by one at a stricter level, which asks for more scenes."""
    paper = load_claims(name)
    scenes = opened(load_suite(paper.suite)).scenes
    for claim, check in deciding(paper):
        least = least_scenes(levels_for(claim.statements, LEVEL))
        assert sum(is_meant(check, s) for s in scenes) >= least, f"{claim.id} {check.id}"


@pytest.mark.parametrize("name", ["gsid"])
def test_claims_about_objects_and_about_rooms_are_judged_there(name: str) -> None:
    for claim, check in deciding(load_claims(name)):
        families = ("objects",) if claim.id in ("G1", "G2", "G3") else ("studio", "gallery")
        assert check.scenes.families == families, f"{claim.id} {check.id}"


@pytest.mark.parametrize("name", claims_names())
def test_to_be_better_than_a_rival_on_a_par_is_no_contradiction(name: str) -> None:
    """But for what rows of one method, or of one painter, are meant to have alike."""
    alike = {"R3", "R10", "S7", "S10", "G8", "R15"}
    for claim, check in deciding(load_claims(name)):
        if check.rule == "within" and claim.id not in alike:
            assert check.accepted is not None
            assert math.inf in map(abs, check.accepted), f"{claim.id} {check.id}"


def test_beta_and_the_prior_of_the_albedo_are_judged_where_they_act() -> None:
    """Steps divided as in the paper; for S7 normals that are the slopes of the prior's depth."""
    rows = {m.row: m for m in load_suite("claims-dark").methods}
    for claim, check in deciding(load_claims("sunfaded")):
        for row in (*check.rows, *check.minus) if claim.id in ("S3", "S7") else ():
            assert rows[row].settings["schedule"] == "paper"
            assert rows[row].priors.overrides["normal"].algorithm == "slopes-of-depth"


def test_normals_of_the_prior_are_the_slopes_of_its_depth_in_all_rows_of_sunfaded() -> None:
    """The paper takes both from one network."""
    told = [
        m for m in load_suite("claims-dark").methods if m.name == "sunfaded" and m.priors.source != "none"
    ]
    assert len(told) > 20
    assert {m.priors.overrides["normal"].algorithm for m in told} == {"slopes-of-depth"}


def test_rows_that_a_claim_compares_differ_in_what_it_is_about_alone() -> None:
    rows = {m.row: dict(m.settings) for m in load_suite("claims-dark").methods}
    staged = {row: settings for row, settings in rows.items() if row.startswith("sunfaded-staged")}
    assert len(staged) == 8
    for settings in staged.values():
        assert settings.keys() - {"iterations", "surfels", "schedule"} <= {"beta", "geometry_prior"}
    rows = {m.row: dict(m.settings) for m in load_suite("claims-multilight").methods}
    changed = {"lamps": 0, "visibility": "none"}
    assert rows["gsid-paper-env"] == rows["gsid-paper"] | changed
