# SPDX-License-Identifier: Apache-2.0
"""``graycard compare`` on a run made by hand."""

import json
import math
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from graycard.cli import main
from graycard.io import from_builtins, read_json, write_json
from graycard.records import (
    COMPARISON,
    Comparison,
    Job,
    JobResult,
    MethodRecord,
    MetricRecord,
    RunRecord,
    Score,
    ScoreSheet,
    read_comparison,
    read_run,
)

METRICS = (
    MetricRecord("psnr", "PSNR", "novel view", "dB", True, math.inf, "", True, 0.3),
    MetricRecord("ssim", "SSIM", "novel view", "1", True, 1.0, "", False, 0.01),
)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Eight scenes, two methods of which the first is 5 dB better, and a reference."""
    random = np.random.default_rng(1000)
    results = []
    for scene in range(8):
        for method, gain in (("mine", 5.0), ("theirs", 0.0), ("truth", math.inf)):
            value = 20 + scene / 4 + gain + random.normal(0, 0.2)
            score = Score("psnr", "graycard-1", "scored", value, "dB", True, math.inf, noise_ceiling=25.3)
            sheet = ScoreSheet("dark", f"s{scene}", method, "", "", (score,))
            job = Job("dark", f"s{scene}", method, 0, {})
            results.append(JobResult(job, "", "", "done", sheet=sheet))
    methods = (
        MethodRecord("mine", "", ()),
        MethodRecord("theirs", "", ()),
        MethodRecord("truth", "", ("radiance",)),
    )
    record = RunRecord("demo", 1, (), methods, METRICS, tuple(results), {}, "", 0.0)
    write_json(tmp_path / "run.json", record)
    return tmp_path


def test_it_says_who_is_better_and_how_sure_that_is(run: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["compare", str(run), "--pairs", "--json", str(run / "c.json")]) == 0
    said = capsys.readouterr()
    lines = said.out.splitlines()
    assert "dark: PSNR (psnr), dB, higher is better" in lines
    first, second, truth = (next(x for x in lines if name in x) for name in (" mine ", " theirs ", " truth "))
    assert first.split()[1:4] != second.split()[1:4]
    assert "8/8" in first
    assert "is handed truth" in truth
    pair = next(x for x in lines if "mine - theirs" in x)
    assert "better" in pair
    assert "0.007812" in pair
    assert lines[-1].startswith("compare: 1 pair, 1 decided, 0 tied, 0 with fewer than the 6 scenes")
    assert "truth has leaked: dark/s7 mine, seed 0, psnr" in said.err
    assert read_comparison(run) == from_builtins(Comparison, read_json(run / "c.json"))


def test_a_row_that_is_handed_truth_has_no_verdict(run: Path, capsys: pytest.CaptureFixture[str]):
    """Corrected over all its pairs it could be tied with what it is far better than."""
    assert main(["compare", str(run), "--pairs"]) == 0
    lines = capsys.readouterr().out.splitlines()
    pairs = [x for x in lines if " - truth" in x]
    assert len(pairs) == 2
    assert all(x.rstrip().endswith("is handed truth") for x in pairs)
    assert not any("tie" in x.split() for x in lines)
    assert lines[-1].endswith("; 2 more with a row that is handed truth, without a verdict")


def test_the_best_mean_stands_first_and_rows_without_one_last(run: Path, capsys: pytest.CaptureFixture[str]):
    record = read_run(run)
    absent = [r for r in record.results if r.job.method == "theirs"]
    late = [replace(r, job=replace(r.job, method="absent"), sheet=None) for r in absent]
    methods = (MethodRecord("absent", "", ()), *record.methods[::-1])
    for higher, order in ((True, ["truth", "mine", "theirs"]), (False, ["theirs", "mine", "truth"])):
        metrics = (replace(METRICS[0], higher_is_better=higher), METRICS[1])
        made = replace(record, methods=methods, metrics=metrics, results=(*late, *record.results))
        write_json(run / "run.json", made)
        assert main(["compare", str(run)]) == 0
        lines = capsys.readouterr().out.splitlines()
        found = [name for x in lines for name in ("absent", "mine", "theirs", "truth") if f" {name} " in x]
        assert found == [*order, "absent"]


def test_what_no_competitor_provides_is_skipped_and_counted(run: Path, capsys: pytest.CaptureFixture[str]):
    record = read_run(run)
    lamp = replace(METRICS[0], id="lamp", title="Lamp")
    results = []
    for result in record.results:
        assert result.sheet is not None
        (score,) = result.sheet.scores
        status = "scored" if result.job.method == "truth" else "not provided"
        more = replace(score, metric="lamp", status=status, value=score.value if status == "scored" else None)
        results.append(replace(result, sheet=replace(result.sheet, scores=(score, more))))
    write_json(run / "run.json", replace(record, metrics=(*METRICS, lamp), results=tuple(results)))
    assert main(["compare", str(run)]) == 0
    shown = capsys.readouterr().out
    assert "Lamp" not in shown
    said = "skipped: 1 table in which no method that competes has a value: --metrics lamp"
    assert said in shown.splitlines()
    assert main(["compare", str(run), "--metrics", "lamp"]) == 0
    shown = capsys.readouterr().out
    assert "dark: Lamp (lamp)" in shown
    assert "skipped" not in shown


def test_a_metric_that_the_run_has_not(run: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["compare", str(run), "--metrics", "pnsr"]) == 2
    assert (
        "expected a metric of this run that exists, got 'pnsr' (did you mean 'psnr'?)"
        in capsys.readouterr().err
    )
    assert main(["compare", str(run), "--metrics", "ssim"]) == 0
    assert "PSNR" not in capsys.readouterr().out


def test_a_chosen_row_is_compared_with_each_other_one(run: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["compare", str(run), "--against", "theirs", "--json", str(run / "c.json")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "against theirs:" in lines
    mine = next(x for x in lines if "mine - theirs" in x)
    assert mine.split()[-1] == "better"
    asked = from_builtins(Comparison, read_json(run / "c.json"))
    assert asked.against == "theirs"
    assert [(p.first, p.second) for p in asked.metrics[0].against] == [
        ("mine", "theirs"),
        ("truth", "theirs"),
    ]
    assert "Verdicts against 'theirs'" in asked.rule
    written = read_comparison(run)
    assert written is not None
    assert "Verdicts against" not in written.rule
    assert (written.against, written.metrics[0].against) == ("", ())
    assert written.metrics[0].pairs == asked.metrics[0].pairs


def test_the_last_line_counts_what_was_asked(run: Path, capsys: pytest.CaptureFixture[str]):
    """Not all pairs of the run: those with the chosen row, by the metrics that are shown."""
    record = read_run(run)
    results = [r for r in record.results if r.sheet]
    more = [replace(r, job=replace(r.job, method="third")) for r in results if r.job.method == "theirs"]
    lamp = replace(METRICS[0], id="lamp", title="Lamp")
    for i, result in enumerate(results):
        assert result.sheet is not None
        (score,) = result.sheet.scores
        if result.job.method == "truth":
            scores = score, replace(score, metric="lamp")
            results[i] = replace(result, sheet=replace(result.sheet, scores=scores))
    methods = (*record.methods, MethodRecord("third", "", ()))
    made = replace(record, methods=methods, metrics=(*METRICS, lamp), results=(*results, *more))
    write_json(run / "run.json", made)
    for options, told in (
        ([], ["compare: 3 pairs, 2 decided, 1 tied", "; 3 more with a row that is handed truth"]),
        (["--against", "mine"], ["compare against mine: 2 pairs, 2 decided, 0 tied", "; 1 more with a row"]),
        (["--against", "mine", "--pairs"], ["compare: 3 pairs, 2 decided, 1 tied", "; 3 more with a row"]),
        (
            ["--metrics", "psnr", "--against", "theirs"],
            ["compare against theirs: 2 pairs, 1 decided, 1 tied"],
        ),
        (["--metrics", "ssim"], ["compare: 0 pairs, 0 decided, 0 tied"]),
    ):
        assert main(["compare", str(run), *options]) == 0
        last = capsys.readouterr().out.splitlines()[-1]
        assert last.startswith(told[0])
        assert all(part in last for part in told)


def test_a_row_that_the_run_has_not(run: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["compare", str(run), "--against", "their"]) == 2
    said = capsys.readouterr()
    assert "expected a row of this run that exists, got 'their' (did you mean 'theirs'?)" in said.err
    assert said.out == ""
    assert not (run / COMPARISON).exists()


def test_the_published_dark_run_says_that_gray_is_worse(capsys: pytest.CaptureFixture[str]):
    """By 14 dB on all eight scenes, among 25 rows: the first finding that a reader looks for."""
    published = Path(__file__).parents[2] / "reports" / "published" / "dark"
    asked = ["--metrics", "novel_view.psnr", "--pairs", "--against", "sunfaded"]
    assert main(["compare", str(published), *asked]) == 0
    lines = [x.split() for x in capsys.readouterr().out.splitlines()]
    assert [x[-1] for x in lines if x[:3] in (["gray", "-", "sunfaded"], ["sunfaded", "-", "gray"])] in (
        ["worse", "worse"], ["worse", "better"],
    )  # fmt: skip
    assert not (published / COMPARISON).exists()


def test_a_comparison_that_is_written_is_not_made_again(run: Path):
    """Intervals of pairs take nearly all of the time, and are not printed."""
    assert main(["compare", str(run)]) == 0
    whole = read_comparison(run)
    assert whole is not None
    (pair, *more), table = whole.metrics[0].pairs, whole.metrics[0]
    marked = replace(table, pairs=(replace(pair, interval=(0.0, 0.0)), *more))
    write_json(run / COMPARISON, replace(whole, metrics=(marked,)))
    assert main(["compare", str(run), "--against", "theirs"]) == 0
    kept = read_comparison(run)
    assert kept is not None
    assert kept.metrics[0].pairs[0].interval == (0.0, 0.0)
    assert main(["compare", str(run), "--pairs"]) == 0


@pytest.mark.parametrize("fault", ["verdict", "rule", "version", "damage"])
def test_a_comparison_that_says_something_else_is_written_anew(run: Path, fault: str):
    assert main(["compare", str(run)]) == 0
    path = run / COMPARISON
    right, text = read_json(path), path.read_text()
    if fault == "verdict":
        right["metrics"][0]["pairs"][0]["verdict"] = "tie"
    elif fault == "rule":
        right["rule"] = "Whoever is first is best."
    elif fault == "version":
        right["format_version"] -= 1
    path.write_text("{" if fault == "damage" else json.dumps(right))
    assert main(["compare", str(run)]) == 0
    assert path.read_text() == text


def test_the_published_dark_run_is_compared_in_three_seconds_of_cpu():
    """A process of its own, with its imports."""
    published = Path(__file__).parents[2] / "reports" / "published" / "dark"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    asked = [sys.executable, "-m", "graycard", "compare", str(published), "--against", "sunfaded"]
    said = subprocess.run(asked, check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 3
    gray = next(x for x in said.splitlines() if x.startswith("gray - sunfaded"))
    assert gray.split()[-1] == "worse"


def test_a_gap_that_is_no_tie_but_needs_more_scenes_is_counted(run: Path, capsys: pytest.CaptureFixture[str]):
    """Six scenes and a hundred rows: ten standard errors come up by chance."""
    record = read_run(run)
    scenes = [f"s{i}" for i in range(6)]
    random = np.random.default_rng(4)
    noise = random.normal(size=6)
    noise = (noise - noise.mean()) / noise.std(ddof=1)
    rows = {f"m{i:02}": np.full(6, 20.0) + random.normal(size=6) for i in range(30)}
    rows["m01"] = rows["m00"] + noise + 11 / math.sqrt(6)
    results = [
        JobResult(
            Job("dark", scene, name, 0, {}), "", "", "done",
            sheet=ScoreSheet("dark", scene, name, "", "", (
                Score("psnr", "graycard-1", "scored", float(value), "dB", True, math.inf),
            )),
        )
        for name, values in rows.items() for scene, value in zip(scenes, values, strict=True)
    ]  # fmt: skip
    methods = tuple(MethodRecord(name, "", ()) for name in rows)
    write_json(run / "run.json", replace(record, methods=methods, results=tuple(results)))
    assert main(["compare", str(run), "--pairs"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert next(x for x in lines if x.startswith("m00 - m01")).endswith("too few scenes")
    assert "0 with fewer than the 6 scenes that a p below 0.05 needs, 6 with too few for so many" in lines[-1]


def test_too_few_scenes_are_said(run: Path, capsys: pytest.CaptureFixture[str]):
    record = read_run(run)
    few = [r for r in record.results if r.job.scene in ("s0", "s1") and r.job.method != "truth"]
    write_json(run / "run.json", RunRecord("demo", 1, (), record.methods, METRICS, tuple(few), {}, "", 0.0))
    assert main(["compare", str(run)]) == 0
    assert "1 with fewer than the 6 scenes that a p below 0.05 needs" in capsys.readouterr().out


def test_a_run_that_cannot_be_written_to_is_compared_all_the_same(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    (run / COMPARISON).mkdir()  # root could write to a folder without permission
    out = tmp_path / "elsewhere" / "c.json"
    assert main(["compare", str(run), "--json", str(out)]) == 0
    shown = capsys.readouterr()
    assert "mine" in shown.out
    assert "warning: comparison.json of the run is not up to date, and stays as it is: expected" in shown.err
    assert "--json FILE writes the comparison elsewhere" in shown.err
    assert from_builtins(Comparison, read_json(out)).metrics


def test_the_report_of_a_run_that_cannot_be_written_to(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    (run / "report").write_text("in the way")
    assert main(["report", str(run)]) == 2
    said = capsys.readouterr().err
    assert "expected an output folder that can be written to" in said
    assert "--out FILE writes the report elsewhere" in said
    out = tmp_path / "elsewhere" / "report.html"
    assert main(["report", str(run), "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"report: {out}\n"
    assert out.read_text().startswith("<!DOCTYPE html>")
