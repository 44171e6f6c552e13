# SPDX-License-Identifier: Apache-2.0
"""Sealed scenes that are rendered anew are held against the record."""

import json
import sys
from pathlib import Path

import pytest

import sealed_truth
from docs_of_reference import DOCS
from published import folders_of_second

HERE = {"novel_view.psnr": 15.6, "albedo.leakage": 4e-5, "novel_view.lpips": 0.9}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, []),
        ({"novel_view.psnr": 15.7}, []),
        ({"novel_view.psnr": 15.8}, ["novel_view.psnr: expected 15.8, as in the record, got 15.6"]),
        ({"albedo.leakage": 5e-4}, []),
        ({"albedo.leakage": 5e-3}, ["albedo.leakage: expected 0.005, as in the record, got 4e-05"]),
        ({"depth.rmse": 1.0}, ["depth.rmse: expected it here and in the record, got one of both"]),
        ({"novel_view.fid": 1.0}, []),
    ],
)
def test_scores_of_another_scene_are_told_of(change: dict[str, float], words: list[str]):
    assert sealed_truth.unlike(HERE, HERE | change) == words


def test_nothing_in_common_is_far():
    assert sealed_truth.farthest({}, HERE) == (float("inf"), "")
    assert len(sealed_truth.unlike({}, HERE)) == 2


def test_a_scene_that_cannot_be_rendered_stops_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fail(*_: object) -> None:
        raise OSError("no room")

    monkeypatch.setattr(sealed_truth, "render_scene", fail)
    run = next(folder for folder in folders_of_second() if folder.name == "dark-sealed-2")
    line = sealed_truth.verified(sealed_truth.Task(run, 0, tmp_path, float("inf")))
    assert line is not None
    assert (line["scene"], line["failed"]) == ("dark/corridor-0913", 1)
    assert line["failures"] == ["OSError: no room"]
    assert sealed_truth._told(line) == "dark-sealed-2 dark/corridor-0913: 0 passed, 1 failed, 0 skipped"
    assert sealed_truth.verified(sealed_truth.Task(run, 0, tmp_path, 0.0)) is None


def test_the_last_line_of_a_scene_counts(tmp_path: Path):
    lines = [{"run": "a", "number": number, "failed": failed} for number, failed in ((0, 1), (1, 0), (0, 0))]
    (tmp_path / "verified.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert sealed_truth._last_lines(tmp_path / "verified.jsonl") == {("a", 0): lines[2], ("a", 1): lines[1]}
    assert sealed_truth._last_lines(tmp_path / "none.jsonl") == {}


def test_a_failure_is_kept_and_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    line = {"run": "dark-sealed", "number": 0, "failed": 1}
    (tmp_path / "verified.jsonl").write_text(json.dumps(line) + "\n")
    run = next(folder for folder in folders_of_second() if folder.name == "tabletop-sealed")
    monkeypatch.setattr(sys, "argv", ["sealed_truth.py", str(tmp_path), str(run), "--seconds", "-1"])
    assert sealed_truth.main() == 1
    assert json.loads((tmp_path / "verified.jsonl").read_text()) == line


def test_the_page_tells_of_all_lines():
    folder = DOCS / "lab-notes"
    lines = sealed_truth._last_lines(folder / "sealed-truth.jsonl").values()
    passed, skipped = (sum(line[of] for line in lines) for of in ("passed", "skipped"))
    failed = sum(line["failed"] for line in lines)
    page = (folder / "2026-11-sealed-truth.md").read_text()
    assert f"| all | {len(lines)} of 67 | {passed:,} | {failed} | {skipped:,} |" in page
