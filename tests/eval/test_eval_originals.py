# SPDX-License-Identifier: Apache-2.0
"""Published protocols against figures of their authors' code on made-up pictures.

``original_figures.json`` holds the figures and how each was obtained. A test that restates our reading of a
rule would pass with a misreading; these do not.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import graycard.eval as ge
from graycard.eval.protocols import (
    PUBLISHED,
    JudgedView,
    JudgedViews,
    LmseProtocol,
    LpipsProtocol,
    Outcome,
    PsnrProtocol,
    PublishedProtocol,
    Subject,
    score_views,
)

ORIGINALS = json.loads((Path(__file__).parent / "original_figures.json").read_text(encoding="utf-8"))
FIGURES: dict[str, dict[str, float]] = ORIGINALS["figures"]
TOLERANCES = {"dB": 1e-3, "°": 1e-4}
"""By unit; any other number within 1e-5. The originals compute in float32."""
MASK = np.zeros((32, 32), bool)
MASK[4:29, 5:30] = True
Pairs = list[tuple[np.ndarray, np.ndarray]]
Find = Callable[[str], PublishedProtocol]


def colours() -> Pairs:
    rng, pairs = np.random.default_rng(20261124), []
    for _ in range(3):
        true = rng.uniform(0.05, 0.95, (32, 32, 3)).astype(np.float32)
        off = np.clip(true * [1.3, 1, 0.7] + rng.normal(0, 0.05, true.shape), 0, None)
        pairs.append((off.astype(np.float32), true))
    return pairs


def surfaces() -> dict[Subject, Pairs]:
    rng = np.random.default_rng(20261125)
    found: dict[Subject, Pairs] = {"normal": [], "depth": [], "roughness": []}
    for _ in range(3):
        normal = unit(rng.normal(0, 1, (32, 32, 3)))
        found["normal"].append((unit(normal + rng.normal(0, 0.3, normal.shape)), normal))
        depth = rng.uniform(1, 3, (32, 32))
        found["depth"].append((0.8 * depth + rng.normal(0, 0.05, depth.shape), depth))
        rough = rng.uniform(0.1, 0.9, (32, 32))
        found["roughness"].append((np.clip(rough + rng.normal(0, 0.1, rough.shape), 0, 1), rough))
    return {
        name: [(p.astype(np.float32), t.astype(np.float32)) for p, t in pairs]
        for name, pairs in found.items()
    }


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def filled(image: np.ndarray, value: float) -> np.ndarray:
    inside = MASK[..., None] if image.ndim == 3 else MASK
    return np.where(inside, image, np.float32(value))


def changed(pair: tuple[np.ndarray, np.ndarray], case: str) -> tuple[np.ndarray, np.ndarray]:
    predicted, true = pair
    match case:
        case "gain 0.5":
            return predicted * np.float32(0.5), true
        case "white outside":
            return filled(predicted, 1), true
        case "black outside":
            return filled(predicted, 0), true
        case "bright":
            return 6 * predicted, 6 * true
    return pair


def views(subject: Subject, case: str) -> JudgedViews:
    drawn: dict[Subject, Pairs] = {s: colours() for s in ("base_color", "radiance", "relit")}
    pairs = [changed(pair, case) for pair in (drawn | surfaces())[subject]]
    judged = tuple(JudgedView(f"view_{i}", p, t, MASK) for i, (p, t) in enumerate(pairs))
    return JudgedViews(judged, judged[0])


def protocol(name: str) -> PublishedProtocol:
    (found,) = ge.find_protocols(name)
    assert isinstance(found, PublishedProtocol)
    return found


def pins() -> Iterator[Any]:
    for case, figures in FIGURES.items():
        for name in figures:
            yield pytest.param(name, case, id=f"{name}, {case}")


@pytest.fixture
def judge_of(request: pytest.FixtureRequest) -> Find:
    """Find a protocol by name; skip the test if it needs weights that are not there."""

    def found(name: str) -> PublishedProtocol:
        judge = protocol(name)
        if isinstance(judge, LpipsProtocol):
            request.getfixturevalue("real_weights")
        return judge

    return found


@pytest.mark.parametrize(("name", "case"), list(pins()))
def test_a_protocol_gives_what_its_authors_code_gave(name: str, case: str, judge_of: Find) -> None:
    judge = judge_of(name)
    tolerance = TOLERANCES.get(judge.record.unit, 1e-5)
    assert judge.score(views(judge.subject, case)).value == pytest.approx(FIGURES[case][name], abs=tolerance)


def test_each_pin_says_where_its_figure_comes_from() -> None:
    for name in {name for figures in FIGURES.values() for name in figures}:
        (origin,) = [o for prefix, o in ORIGINALS["originals"].items() if name.startswith(prefix)]
        assert all(origin[key] for key in ("repository", "files", "run"))
    assert FIGURES.keys() == ORIGINALS["cases"].keys()


@pytest.mark.parametrize("case", sorted(FIGURES.keys() - {"bright"}))
def test_every_published_protocol_is_pinned_but_where_no_program_could_be_run(case: str) -> None:
    names = {p.name for p in ge.all_protocols()} - {"graycard"}
    assert names - FIGURES[case].keys() == {
        "raw-linear",  # definitions without a program
        "global-lsq",
        "channel-lsq",
        "nvdiffrec",  # told in words, or read in part
        "nvdiffrecmc-relit",
    }


def pinned(name: str) -> PsnrProtocol:
    found = protocol(name)
    assert isinstance(found, PsnrProtocol)
    return found


def aligned(judge: PsnrProtocol, **fields: Any) -> PsnrProtocol:
    return replace(judge, alignment=replace(judge.alignment, **fields))


MISREAD = {
    "r3dg-syn4": aligned(pinned("r3dg-syn4"), space="linear", fitted_in="linear", true_as="float"),
    "nerfactor": aligned(pinned("nerfactor"), predicted_as="8 bits, gamma 2.2"),
    "gs-ir": aligned(pinned("gs-ir"), outside="black"),
}
"""Version 1 of these protocols, as it was misread."""


@pytest.mark.parametrize("name", MISREAD)
def test_the_figures_see_a_misreading(name: str) -> None:
    found = MISREAD[name].score(views("base_color", "fixed")).value
    assert abs(found - FIGURES["fixed"][name]) > 0.01


def with_nan(found: JudgedViews, where: tuple[int, int]) -> JudgedViews:
    first = found.test[0]
    predicted = first.predicted.copy()
    predicted[where] = np.nan
    return replace(found, test=(replace(first, predicted=predicted), *found.test[1:]))


@pytest.mark.parametrize("name", [p.name for p in PUBLISHED])
def test_a_value_that_is_not_finite_inside_the_mask_has_failed(name: str, judge_of: Find) -> None:
    judge = judge_of(name)
    score = score_views(judge, with_nan(views(judge.subject, "fixed"), (16, 16)))
    assert (score.status, score.value, score.expected, score.scored) == ("failed", None, 3, 0)
    assert "view_0: expected finite values inside the mask, got" in score.reason
    assert "Write this view again" in score.reason


@pytest.mark.parametrize("name", [p.name for p in PUBLISHED])
def test_a_value_outside_the_mask_may_be_anything(name: str, judge_of: Find) -> None:
    judge = judge_of(name)
    black = views(judge.subject, "black outside")
    score = score_views(judge, with_nan(black, (0, 0)))
    assert score == score_views(judge, black)


def test_without_weights_a_score_is_not_provided(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GRAYCARD_LPIPS", raising=False)
    monkeypatch.setenv("GRAYCARD_WEIGHTS", str(tmp_path))
    score = score_views(protocol("orb-albedo-lpips"), views("base_color", "fixed"))
    assert (score.status, score.value, score.expected) == ("not provided", None, 3)
    assert "graycard weights lpips" in score.reason


class Broken(LmseProtocol):
    """A protocol whose number is none."""

    def score(self, views: JudgedViews) -> Outcome:
        return Outcome(float("nan"), {view.name: 1.0 for view in views.test})


def test_a_nan_is_failed_never_scored() -> None:
    score = score_views(Broken(name="broken", summary="s", source="s"), views("base_color", "fixed"))
    assert (score.status, score.value, score.scored) == ("failed", None, 0)
    assert score.reason == "expected a number from broken, got nan. Look for values that are not finite"


def test_a_black_depth_is_taken_for_one_that_is_1_everywhere() -> None:
    found = views("depth", "fixed")
    black = replace(found, test=tuple(replace(v, predicted=0 * v.predicted) for v in found.test))
    flat = replace(found, test=tuple(replace(v, predicted=0 * v.predicted + 1) for v in found.test))
    assert protocol("orb-depth").score(black) == protocol("orb-depth").score(flat)


@pytest.mark.parametrize("name", ["tensoir-normal", "gs-ir-normal"])
def test_true_normals_have_no_angle_and_the_background_lowers_the_mean(name: str) -> None:
    exact = tuple(
        replace(v, predicted=filled(v.true, 0)) for v in views("normal", "fixed").test
    )  # length 0: nothing was drawn
    assert protocol(name).score(JudgedViews(exact)).value == pytest.approx(0, abs=0.01)
    turned = tuple(replace(v, predicted=filled(-v.true, 0)) for v in exact)
    assert protocol(name).score(JudgedViews(turned)).value == pytest.approx(180 * MASK.mean(), abs=0.5)
