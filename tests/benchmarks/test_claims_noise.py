# SPDX-License-Identifier: Apache-2.0
"""The noise of fits that were repeated on tuning scenes, beside what their files say."""

import json
import math
import shutil
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from claims_by_hand import SPREAD, check_of, judged
from graycard.benchmarks import claims
from graycard.benchmarks.claims import Check, Quantity, _noise
from graycard.records import CheckResult, Job, JobResult, MethodRecord, RunRecord, Score, ScoreSheet
from refits_by_hand import deviation, share_above
from runs_by_hand import scene_of

METRIC = "novel_view.psnr"
NOISE = Path(claims.__file__).parent / "noise"


def measured(metric: str = METRIC, run: str = "dark") -> dict[str, dict[str, list[float]]]:
    """The measured scores by row and scene, in the order of seeds, straight from the file."""
    found: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    results = json.loads((NOISE / run / "run.json").read_text(encoding="utf-8"))["results"]
    for result in sorted(results, key=lambda result: result["job"]["seed"]):
        (value,) = (s["value"] for s in result["sheet"]["scores"] if s["metric"] == metric)
        found[result["job"]["method"]][result["job"]["scene"]].append(value)
    return found


def spread_of_row(row: str) -> float:
    return deviation(np.array(list(measured()[row].values())))


def fits_of(
    rows: Sequence[tuple[str, str]],
    effects: np.ndarray,
    name: str = METRIC,
    track: str = "dark",
    steps: int = 4000,
) -> RunRecord:
    """Rows, each by its method, with one seed a scene; the first leads the others by the effects."""
    (metric,) = (m for m in ge.all_metrics() if m.id == name)
    results = []
    for place, (row, _) in enumerate(rows):
        for i, effect in enumerate(effects):
            value = 20.0 + i + (float(effect) if place == 0 else 0.0)
            facts = metric.unit, metric.higher_is_better, metric.optimum
            score = Score(name, "graycard-1", "scored", value, *facts)
            sheet = ScoreSheet(track, f"s{i}", row, "", "", (score,))
            job = Job(track, f"s{i}", row, 0, {"iterations": steps})
            results.append(JobResult(job, "", "", "done", sheet=sheet))
    methods = tuple(MethodRecord(row, "", (), entry) for row, entry in rows)
    scenes = tuple(replace(scene_of(i), track=track) for i in range(len(effects)))
    when = "2026-11-25T00:00:00"
    return RunRecord("hand", 1, scenes, methods, (metric,), tuple(results), {}, when, 1.0)


def of_rows(*rows: str) -> Check:
    return check_of(rows=rows, quantity=Quantity(METRIC))


def noise_of(rows: Sequence[tuple[str, str]], effects: np.ndarray) -> CheckResult:
    return judged(fits_of(rows, effects), of_rows(*(row for row, _ in rows))).checks[0]


def test_rows_that_were_measured_have_the_noise_of_their_difference() -> None:
    """By seed, scene by scene: fits of two rows with one seed may err alike."""
    found = noise_of([("sunfaded", "sunfaded"), ("darkgs", "darkgs")], 1 + 20 * SPREAD)
    table = measured()
    gaps = [np.array(table["sunfaded"][s]) - np.array(table["darkgs"][s]) for s in table["darkgs"]]
    assert found.seed_sd == pytest.approx(deviation(np.array(gaps)))
    assert found.noise_from == "sunfaded, darkgs in noise-dark"


def test_rows_of_a_measured_method_are_as_noisy_as_its_noisiest_row() -> None:
    found = noise_of([("mine", "sunfaded"), ("theirs", "darkgs")], 1 + 20 * SPREAD)
    largest = max("sunfaded", "sunfaded-no-prior", key=spread_of_row)
    expected = math.hypot(spread_of_row(largest), spread_of_row("darkgs"))
    assert found.seed_sd == pytest.approx(expected)
    assert found.noise_from == f"{largest}, darkgs in noise-dark, standing in for these rows"
    assert found.scene_sd == pytest.approx(math.sqrt(np.var(20 * SPREAD, ddof=1) - expected**2))


def test_rows_of_a_method_that_nobody_measured_are_as_noisy_as_any() -> None:
    found = noise_of([("mine", "new")], 1 + 20 * SPREAD)
    noisiest = max(measured(), key=spread_of_row)
    assert found.seed_sd == pytest.approx(spread_of_row(noisiest))
    assert found.noise_from == f"{noisiest} in noise-dark, standing in for these rows"


def test_noise_of_others_is_no_more_than_all_that_scenes_spread() -> None:
    """Scenes that agree within less than one fit's noise show that fits of these rows err alike."""
    effects = 1 + SPREAD / 10
    found = noise_of([("mine", "sunfaded"), ("theirs", "darkgs")], effects)
    assert math.hypot(spread_of_row("sunfaded"), spread_of_row("darkgs")) > effects.std(ddof=1)
    assert found.seed_sd == pytest.approx(effects.std(ddof=1))
    assert found.scene_sd == pytest.approx(0, abs=1e-9)
    assert found.noise_from.startswith("all of the spread between scenes, which is below that of ")


HIGHLIGHT = "albedo.leakage.highlight"


def of_lights(row: str, method: str, metric: str) -> CheckResult:
    """Return the check of one row of several lights against a level."""
    fits = fits_of([(row, method)], 20 * SPREAD, metric, "multilight", 1500)
    check = check_of(rows=(row,), quantity=Quantity(metric), against=0.1)
    return judged(fits, check, track="multilight").checks[0]


@pytest.mark.parametrize(("metric", "run"), [(METRIC, "multilight"), (HIGHLIGHT, "multilight-highlights")])
def test_the_first_run_of_a_track_that_has_a_score_tells_its_noise(metric: str, run: str) -> None:
    """Scenes of ``noise-multilight`` have no highlights that are scored."""
    found, table = of_lights("gsid", "gsid", metric), measured(metric, run)["gsid"]
    assert found.seed_sd == pytest.approx(deviation(np.array(list(table.values()))))
    assert found.noise_from == f"gsid in noise-{run}"


def test_rows_stand_in_for_others_in_the_first_run_alone() -> None:
    """The second has one method, whose fits tell nothing of another's."""
    assert of_lights("mine", "new", METRIC).noise_from.endswith(
        "in noise-multilight, standing in for these rows"
    )
    assert of_lights("mine", "new", HIGHLIGHT).noise_from == ""


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of its own in which runs are looked for."""
    _noise._measured.cache_clear()
    monkeypatch.setattr(_noise, "FOLDER", tmp_path)
    yield tmp_path
    _noise._measured.cache_clear()


def test_what_is_no_run_is_passed_over(kept: Path) -> None:
    rows = [("sunfaded", "sunfaded"), ("darkgs", "darkgs")]
    assert noise_of(rows, 1 + 20 * SPREAD).noise_from == ""
    _noise._measured.cache_clear()
    shutil.copytree(NOISE / "dark", kept / "dark")
    (kept / "dark-later").mkdir()
    (kept / "dark-notes").write_text("no run")
    assert noise_of(rows, 1 + 20 * SPREAD).noise_from == "sunfaded, darkgs in noise-dark"


@pytest.mark.parametrize("wide", [0.5, 1.0, 20.0])
def test_noise_measured_elsewhere_is_never_above_all_that_scenes_spread(wide: float) -> None:
    """Measured on fits of the same rows, its variance is drawn, up to the whole spread of these scenes."""
    rows = [("sunfaded", "sunfaded"), ("darkgs", "darkgs")]
    table = measured()
    gaps = np.array([np.array(table["sunfaded"][s]) - np.array(table["darkgs"][s]) for s in table["darkgs"]])
    noise, freedom = deviation(gaps), gaps.size - len(gaps)
    effects = wide * noise * (0.55 + SPREAD)
    found = judged(fits_of(rows, effects), of_rows("sunfaded", "darkgs"))
    assert found.checks[0].seed_sd == pytest.approx(noise)
    most = effects.var(ddof=1)
    expected = share_above(effects, noise, freedom, had=1, seeds=1, most=most)
    assert found.stability == pytest.approx(expected, abs=0.04)
