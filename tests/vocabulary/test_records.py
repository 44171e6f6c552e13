# SPDX-License-Identifier: Apache-2.0
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from graycard import (
    PointLight,
    PredictionError,
    Predictions,
    RecordError,
    open_predictions,
    srgb_decode,
    srgb_encode,
)
from graycard.colour import srgb_slope
from graycard.io import from_builtins, to_builtins, write_json
from graycard.predictions import finish_predictions, predictions_hash, write_view
from graycard.records import (
    COMPARISON,
    AboveCeiling,
    Comparison,
    Cost,
    Job,
    JobResult,
    MethodRecord,
    MethodStanding,
    MetricComparison,
    PairDifference,
    RunRecord,
    Score,
    ScoreSheet,
    read_comparison,
    read_run,
    read_score_sheet,
)

SCORE = Score(
    "m", "graycard-0", "scored", math.inf, "dB", True, math.inf, {"test_000": math.inf}, 40.0, (1.0, 2.0, 3.0)
)
SHEET = ScoreSheet("dark", "s", "truth", "ab", "cd", (SCORE,))


def test_records_round_trip_with_infinities(tmp_path: Path):
    write_json(tmp_path / "a.json", SHEET)
    assert read_score_sheet(tmp_path / "a.json") == SHEET
    strict = json.loads((tmp_path / "a.json").read_text(), parse_constant=lambda name: pytest.fail(name))
    assert strict["scores"][0]["value"] == "inf"


def test_a_score_is_found_by_name():
    assert SHEET.score("m") is SCORE
    with pytest.raises(RecordError, match=r"expected a metric of this sheet, got 'n': \['m'\]"):
        SHEET.score("n")


def test_variants_are_rows_beside_their_method():
    rows = [("a", "a"), ("a-slow", "a"), ("b-slow", "b"), ("old", "")]
    methods = tuple(MethodRecord(name, "one", (), entry) for name, entry in rows)
    jobs = [Job("dark", "s", name, 0, {}) for name, _ in rows] + [Job("tabletop", "s", "a-slow", 0, {})]
    results = tuple(JobResult(job, "h", "f", "done") for job in jobs)
    run = RunRecord("s", 1, (), methods, (), results, {}, "2026-11-21T09:47:14+00:00", 1.0)
    assert run.variants_on("dark") == {"a-slow"}
    assert run.variants_on("tabletop") == frozenset(), "its method is not there as itself"


def test_a_misspelt_or_missing_key(tmp_path: Path):
    data = to_builtins(SHEET)
    write_json(tmp_path / "a.json", {**data, "trak": 1})
    with pytest.raises(RecordError, match="trak"):
        read_score_sheet(tmp_path / "a.json")
    del data["scene"]
    write_json(tmp_path / "a.json", data)
    with pytest.raises(RecordError, match='missing value for field "scene"'):
        read_score_sheet(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "text that breaks off or is none"),
        ("[]", "expected a ScoreSheet"),
        ('{"format_version": 7}', "version 7"),
    ],
)
def test_no_record_at_all(tmp_path: Path, text: str, message: str):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(RecordError, match=message):
        read_score_sheet(tmp_path / "a.json")


def test_another_format(tmp_path: Path):
    write_json(tmp_path / "a.json", replace(SHEET, format="something-else"))
    with pytest.raises(RecordError, match="expected graycard-scores in .*, got something-else"):
        read_score_sheet(tmp_path / "a.json")


def test_a_run_folder_without_a_run(tmp_path: Path):
    with pytest.raises(RecordError, match="expected a run folder with run.json .* `graycard bench`"):
        read_run(tmp_path)


def test_a_folder_of_runs_names_them(tmp_path: Path):
    for name in ("second", "first"):
        write_json(tmp_path / name / "run.json", {})
    (tmp_path / "third").mkdir()
    with pytest.raises(RecordError, match="got a folder of 2 runs. Name one of them: first, second$"):
        read_run(tmp_path)
    for number in range(8):
        write_json(tmp_path / f"more-{number}" / "run.json", {})
    with pytest.raises(RecordError, match="got a folder of 10 runs.* more-7, …$"):
        read_run(tmp_path)
    write_json(tmp_path / "third" / "alone" / "run.json", {})
    with pytest.raises(RecordError, match="got a folder of 1 run. Name one of them: alone$"):
        read_run(tmp_path / "third")


def test_types_are_checked():
    with pytest.raises(RecordError, match="expected a Cost"):
        from_builtins(Cost, {"wall_s": True, "peak_memory_mib": 1.0})
    with pytest.raises(RecordError, match="expected a number"):
        from_builtins(Cost, {"wall_s": "fast", "peak_memory_mib": 1.0})
    assert from_builtins(Cost, {"wall_s": 1, "peak_memory_mib": "nan"}).wall_s == 1.0


def test_numpy_and_paths_become_plain_json():
    assert to_builtins({"a": np.float32(0.5), "b": np.arange(2), "c": Path("x/y"), "d": (1, "two")}) == {
        "a": 0.5,
        "b": [0, 1],
        "c": "x/y",
        "d": [1, "two"],
    }


def test_predictions_round_trip_and_notice_changes(tmp_path: Path):
    write_view(tmp_path, "test_000", {"base_color": np.full((2, 3, 3), 0.5)})
    finish_predictions(tmp_path, Predictions("mine", "dark", "s"), (PointLight("a", (0, 0, 0), (1, 1, 1)),))
    found = open_predictions(tmp_path)
    assert (found.method, found.view_names()) == ("mine", ["test_000"])
    assert np.array_equal(found.layers("test_000")["base_color"], np.full((2, 3, 3), 0.5, np.float32))
    assert found.lights() == (PointLight("a", (0, 0, 0), (1, 1, 1)),)
    with pytest.raises(
        PredictionError, match="expected a prediction for view 'test_001' .* Present: test_000"
    ):
        found.layers("test_001")
    write_view(tmp_path, "test_000", {"base_color": np.full((2, 3, 3), 0.6)})
    with pytest.raises(PredictionError, match="it changed after predictions.json was written"):
        found.layers("test_000")


def test_predictions_are_hashed_once_and_a_change_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write_view(tmp_path, "test_000", {"base_color": np.full((2, 3, 3), 0.5)})
    finish_predictions(tmp_path, Predictions("mine", "dark", "s"))
    opened = open_predictions(tmp_path)
    found, digest = opened.hashed()
    assert digest == predictions_hash(tmp_path)
    assert found == opened
    with monkeypatch.context() as patch:
        patch.setattr("graycard.predictions.sha256", lambda path: pytest.fail(f"{path} is hashed again"))
        found.layers("test_000")
    write_view(tmp_path, "test_000", {"base_color": np.full((2, 3, 3), 0.6)})
    write_view(tmp_path, "another", {"base_color": np.full((2, 3, 3), 0.6)})
    changed, digest = found.hashed()
    assert digest == predictions_hash(tmp_path)
    with pytest.raises(PredictionError, match="it changed after predictions.json was written"):
        changed.layers("test_000")


@pytest.mark.parametrize("key", ["root", "hashes"])
def test_a_file_may_not_say_what_is_known_in_memory_only(tmp_path: Path, key: str):
    finish_predictions(tmp_path, Predictions("mine", "dark", "s"))
    index = json.loads((tmp_path / "predictions.json").read_text())
    (tmp_path / "predictions.json").write_text(json.dumps(index | {key: {} if key == "hashes" else "/"}))
    with pytest.raises(PredictionError, match=rf"got: can not match .*{key}"):
        open_predictions(tmp_path)


def test_predictions_need_an_index_of_their_format(tmp_path: Path):
    with pytest.raises(
        PredictionError, match=r"with predictions.json at .*, got nothing.*reference/formats.md"
    ):
        open_predictions(tmp_path / "no")
    write_json(
        tmp_path / "predictions.json", {"method": "m", "track": "dark", "scene": "s", "format_version": 9}
    )
    with pytest.raises(PredictionError, match="got version 9. Install a newer graycard"):
        open_predictions(tmp_path)
    write_json(tmp_path / "predictions.json", {"method": "m", "track": "dark"})
    with pytest.raises(PredictionError, match="scene"):
        open_predictions(tmp_path)
    with pytest.raises(PredictionError, match="some in memory"):
        Predictions("m", "dark", "s").lights()


def test_lights_are_optional_but_must_be_right(tmp_path: Path):
    finish_predictions(tmp_path, Predictions("m", "dark", "s"))
    assert open_predictions(tmp_path).lights() is None
    write_json(tmp_path / "lights.json", [{"type": "torch"}])
    with pytest.raises(PredictionError, match="expected a light type that exists, got 'torch'"):
        open_predictions(tmp_path).lights()


def test_srgb_against_the_standard():
    """IEC 61966-2-1: 18 % gray is 46.1 % on a display; both pieces of the curve meet."""
    assert srgb_encode(np.array([0.0, 0.18, 1.0, 2.0, -1.0])) == pytest.approx(
        [0, 0.46135, 1, 1, 0], abs=1e-5
    )
    assert srgb_encode(np.array([0.0031308]))[0] == pytest.approx(0.04045, abs=1e-6)
    many = np.linspace(0, 1, 100_001)  # more than are encoded at a time
    assert srgb_encode(many)[[0, 99_000]] == pytest.approx([0, float(srgb_encode(np.array(0.99)))])
    assert srgb_decode(srgb_encode(many)) == pytest.approx(many, abs=1e-12)
    strided = np.random.default_rng(0).random((60, 70, 6))[:, ::2, 1::2]
    assert np.array_equal(srgb_encode(strided), srgb_encode(strided.copy()))
    x = np.array([0.001, 0.02, 0.5, 0.9])
    slope = (srgb_encode(x + 1e-6) - srgb_encode(x - 1e-6)) / 2e-6
    assert srgb_slope(x) == pytest.approx(slope, rel=1e-4)
    assert not srgb_slope(np.array([-0.1, 1.5])).any()


PAIR = PairDifference("a", "b", 8, 1.5, (0.5, 2.5), 0.0078, 0.0078, 0.004, 0.004, "better")
STANDING = MethodStanding("a", True, 8, 8, 2, 25.0, (23.0, 27.0), 2.0, 0.3, 40.0, 1)
COMPARED = Comparison(
    "demo", 1, 0.95, 6, {"dB": 1.0}, "who wins", (MetricComparison("dark", "m", (STANDING,), (PAIR,)),),
    (AboveCeiling("dark", "s", "a", 0, "m", math.inf, 40.0, math.inf, "dB", ("radiance",)),),
)  # fmt: skip


def test_a_comparison_round_trips_and_is_found_by_name(tmp_path: Path):
    assert read_comparison(tmp_path) is None
    write_json(tmp_path / COMPARISON, COMPARED)
    assert read_comparison(tmp_path) == COMPARED
    assert COMPARED.find("dark", "m").pairs == (PAIR,)
    with pytest.raises(RecordError, match="expected a track and metric of this comparison, got 'dark', 'n'"):
        COMPARED.find("dark", "n")


def test_a_comparison_of_another_verdict_or_a_newer_format_is_refused(tmp_path: Path):
    data = to_builtins(COMPARED)
    write_json(tmp_path / COMPARISON, {**data, "format_version": 9})
    with pytest.raises(RecordError, match="got version 9"):
        read_comparison(tmp_path)
    write_json(tmp_path / COMPARISON, {**data, "format_version": 1})
    with pytest.raises(RecordError, match="got version 1 of an older graycard"):
        read_comparison(tmp_path)
    data["metrics"][0]["pairs"][0]["verdict"] = "glorious"
    write_json(tmp_path / COMPARISON, data)
    with pytest.raises(RecordError, match="verdict"):
        read_comparison(tmp_path)
