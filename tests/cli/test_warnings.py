# SPDX-License-Identifier: Apache-2.0
"""The terminal tells every hint and warning of a score, beside the score."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from graycard import Predictions, View, open_truth
from graycard.cli import main
from graycard.cli._warnings import FOLDER, run_lines, warned
from graycard.predictions import finish_predictions, write_view
from graycard.records import HOLDS_NOISE, MethodRecord, RunRecord, ScoreSheet, read_score_sheet
from odd_files import rewrite
from planted_mistakes import MISTAKES, Layers, Mistake
from runs_by_hand import METRICS, result_of, run_of, score_of

Capture = pytest.CaptureFixture[str]
Change = Callable[[Layers, View, float], Mapping[str, np.ndarray]]
HANDED_IN = ("radiance", "base_color", "normal", "depth")


def honest(layers: Layers, view: View, exposure: float) -> Layers:
    """Return nothing but errors: a picture that is exact would hold the noise of the truth."""
    return {"radiance": layers["radiance"] * 1.02}


def write(scene: Path, folder: Path, *changes: Change) -> Path:
    """Write the truth as predictions, with changes, and return the folder."""
    truth = open_truth(scene / "truth", check=False)
    for view in truth.views:
        layers = {name: values for name, values in truth.layers(view).items() if name in HANDED_IN}
        layers |= honest(layers, view, truth.exposure)
        for change in changes:
            layers |= change(layers, view, truth.exposure)
        write_view(folder, view.name, layers)
    finish_predictions(folder, Predictions("mine", truth.track, truth.scene), truth.lights())
    return folder


@pytest.fixture
def scene(tiny_scenes: dict[str, Path]) -> Path:
    return tiny_scenes["dark"]


def warnings_of(shown: str) -> dict[int, tuple[str, str]]:
    """Return text and scores of each warning that a terminal shows, by its number."""
    found = re.findall(r"^warning (\d+): (.*)\n  of (.*)$", shown, re.MULTILINE)
    return {int(number): (text, scores) for number, text, scores in found}


def row_of(shown: str, metric: str) -> str:
    (row,) = re.findall(rf"^{re.escape(metric)} .*$", shown.partition("the same ")[0], re.MULTILINE)
    return row.strip()


@pytest.mark.parametrize("mistake", MISTAKES, ids=str)
def test_a_planted_mistake_is_named_beside_its_score(
    scene: Path, tmp_path: Path, capsys: Capture, mistake: Mistake
):
    folder = write(scene, tmp_path / "p", mistake.make)
    assert main(["score", str(folder), str(scene), "--json", str(tmp_path / "s.json")]) == 0
    shown = capsys.readouterr().out
    (number,) = (n for n, (text, _) in warnings_of(shown).items() if text.startswith(mistake.says))
    assert warnings_of(shown)[number][1] == mistake.beside
    assert re.search(rf"\s{number}$", row_of(shown, mistake.beside)), (
        "its number stands in the row of the score"
    )
    in_file = {w for s in read_score_sheet(tmp_path / "s.json").scores for w in s.warnings}
    assert any(w.startswith(mistake.says) for w in in_file)


def test_an_honest_prediction_is_told_nothing(scene: Path, tmp_path: Path, capsys: Capture):
    assert main(["score", str(write(scene, tmp_path / "p")), str(scene)]) == 0
    assert "warning" not in capsys.readouterr().out


def test_two_mistakes_are_two_warnings(scene: Path, tmp_path: Path, capsys: Capture):
    folder = write(scene, tmp_path / "p", MISTAKES[1].make, MISTAKES[2].make)
    assert main(["score", str(folder), str(scene)]) == 0
    told = [text for text, _ in warnings_of(capsys.readouterr().out).values()]
    assert len(told) == 2
    assert all(text.startswith(MISTAKES[i].says) for text, i in zip(told, (1, 2), strict=True))


@pytest.mark.parametrize("shown_in", ["the table of protocols", "a group of protocols"])
def test_published_protocols_do_not_hide_warnings(
    scene: Path, tmp_path: Path, capsys: Capture, shown_in: str
):
    folder = write(scene, tmp_path / "p", MISTAKES[4].make)
    group = "all" if shown_in == "the table of protocols" else "albedo"
    assert main(["score", str(folder), str(scene), "--protocol", group]) == 0
    assert MISTAKES[4].says in capsys.readouterr().out


def change_files(folder: Path, more: tuple[str, ...], without: tuple[str, ...] = ()) -> None:
    for path in folder.glob("views/*.exr"):
        rewrite(path, {name: np.full((24, 28), 0.5, np.float32) for name in more}, without)
    index = '{"method": "mine", "track": "dark", "scene": "tiny-0000"}'
    (folder / "predictions.json").write_text(index)


@pytest.mark.parametrize(
    ("channels", "named"),
    [
        (("uncertainty.Y",), "uncertainty.Y"),
        (("base_color.A",), "base_color.A"),
        (("Z",), "Z"),
        (("roughnes.Y",), "roughnes.Y (did you mean roughness?)"),
        (("albdo.R", "albdo.G", "albdo.B"), "albdo.B, albdo.G, albdo.R (did you mean albedo?)"),
        (tuple(f"aov{i}.Y" for i in range(7)), "aov3.Y; aov4.Y; those of 2 more names"),
    ],
    ids=["layer", "alpha", "no-suffix", "misspelt", "colour", "many"],
)
def test_a_channel_of_no_layer_concerns_itself_alone(
    scene: Path, tmp_path: Path, capsys: Capture, channels: tuple[str, ...], named: str
):
    folder = write(scene, tmp_path / "p")
    main(["score", str(folder), str(scene), "--json", str(tmp_path / "before.json")])
    change_files(folder, channels)
    capsys.readouterr()
    assert main(["score", str(folder), str(scene), "--json", str(tmp_path / "after.json")]) == 0
    ((text, of),) = warnings_of(capsys.readouterr().out).values()
    assert of == FOLDER
    assert text.startswith("channels of no known layer were left out: ")
    assert text.endswith(named)
    before, after = (read_score_sheet(tmp_path / f"{name}.json") for name in ("before", "after"))
    assert after.scores == before.scores
    assert after.warnings == (text,)


def test_a_layer_that_lacks_a_channel_fails_alone(scene: Path, tmp_path: Path, capsys: Capture):
    folder = write(scene, tmp_path / "p")
    change_files(folder, (), without=("normal.Z",))
    assert main(["score", str(folder), str(scene), "--json", str(tmp_path / "s.json")]) == 1
    assert "expected channels normal.X, normal.Y, normal.Z in" in capsys.readouterr().err
    statuses = {s.metric: s.status for s in read_score_sheet(tmp_path / "s.json").scores}
    assert {m for m, status in statuses.items() if status == "failed"} == {
        m for m in statuses if m.startswith("normal.")
    }
    assert statuses["albedo.psnr.channel"] == "scored"


def test_a_file_without_any_layer_is_an_error(scene: Path, tmp_path: Path, capsys: Capture):
    folder = write(scene, tmp_path / "p")
    everything = tuple(f"{n}.{c}" for n in ("radiance", "base_color") for c in "RGB")
    change_files(folder, ("Beauty.R",), (*everything, "normal.X", "normal.Y", "normal.Z", "depth.Z"))
    assert main(["score", str(folder), str(scene)]) == 1
    assert "expected channels named <layer>.<suffix> in" in capsys.readouterr().err


def sheet_with(*told: tuple[str, tuple[str, ...]], folder: tuple[str, ...] = ()) -> ScoreSheet:
    """Return a sheet of scores that warn."""
    scores = tuple(replace(score_of(METRICS[0], 1.0), metric=m, warnings=texts) for m, texts in told)
    return ScoreSheet("dark", "s0", "row", "", "", scores, warnings=folder)


def test_what_is_the_same_but_for_numbers_is_told_once():
    sheet = sheet_with(
        ("a", ("test_001: 3 of 40 depths are +inf", "test_003: 5 of 41 depths are +inf")),
        ("b", ("test_001: 7 of 40 depths are +inf", "other")),
        ("c", ("other",)),
    )
    first, second = warned(sheet)
    assert first.lines() == (
        "test_001: 3 of 40 depths are +inf (a; with other numbers the others)",
        "of a, b; views: test_001, test_003",
    )
    assert second.lines() == ("other", "of b, c")


def test_what_concerns_no_score_concerns_the_folder():
    (only,) = warned(sheet_with(("a", ()), folder=("left out: x",)))
    assert only.lines() == ("left out: x", f"of {FOLDER}")


def test_names_with_digits_are_not_told_as_one():
    sheet = sheet_with(("a", ("lamp-1 has that of lamp-2", "lamp-2 has that of lamp-3")))
    assert len(warned(sheet)) == 2


def run_that_warns(*places: tuple[str, int, str]) -> RunRecord:
    """Return a run of two rows on three scenes, whose score warns at some (row, scene, text)."""
    run = run_of({row: {"psnr": (1.0, 1.0, 1.0)} for row in ("a", "b")})
    texts = {(row, f"s{number}"): text for row, number, text in places}
    results = []
    for result in run.results:
        assert result.sheet is not None
        (score,) = result.sheet.scores
        says = texts.get((result.job.method, result.job.scene))
        sheet = replace(result.sheet, scores=(replace(score, warnings=(says,) if says else ()),))
        results.append(replace(result, sheet=sheet))
    return replace(run, results=tuple(results))


def test_a_run_tells_a_warning_once_for_all_rows_and_scenes():
    told = run_lines(
        run_that_warns(
            *(("a", n, f"normal looks like camera axes (error {n + 90} before)") for n in range(3)),
            ("b", 1, "normal looks like camera axes (error 3.5 before)"),
        )
    )
    assert told == [
        [
            "normal looks like camera axes (error 90 before)",
            "psnr",
            "a on all 3 scenes of dark; b on dark/s1",
        ]
    ]


def test_that_the_truth_is_too_good_is_no_news():
    says = f"50.0 dB is 3.0 dB above: {HOLDS_NOISE}"
    run = run_that_warns(("a", 0, says), ("b", 0, says))
    oracle = MethodRecord("a", "the truth", ("truth",))
    run = replace(run, methods=(oracle, *run.methods[1:]))
    assert [line[-1] for line in run_lines(run)] == ["b on dark/s0"]


def test_a_result_without_a_sheet_tells_nothing():
    failed = replace(result_of("a", 0, {}), sheet=None, status="failed")
    assert run_lines(replace(run_that_warns(), results=(failed,))) == []
