# SPDX-License-Identifier: Apache-2.0
"""Sealed scenes that are rendered anew are held against the record."""

import json
from pathlib import Path

import pytest

import sealed_truth
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


def test_only_scenes_that_have_passed_are_kept(tmp_path: Path):
    lines = [{"run": "a", "number": number, "failed": number % 2} for number in range(3)]
    (tmp_path / "verified.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert sealed_truth._passed(tmp_path / "verified.jsonl") == [lines[0], lines[2]]
    assert sealed_truth._passed(tmp_path / "none.jsonl") == []
