# SPDX-License-Identifier: Apache-2.0
"""The trial that kills clusters sees what it is there to see."""

import random
from pathlib import Path

from kill_bench import Trial, fingerprint
from kill_cluster import Results, forget


def record(run: Path, name: str, text: str) -> Path:
    path = run / "jobs" / "dark" / "corridor-0001" / "gray-0-abc" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    path.write_text(text)
    return path


def test_a_record_that_is_written_again_is_seen_also_with_the_same_words(tmp_path: Path) -> None:
    results = Results(tmp_path)
    record(tmp_path, "job.json", "{}")
    results.look()
    record(tmp_path, "scores.json", "{}")
    results.look()
    assert results.again == []
    record(tmp_path, "new", "{}").replace(record(tmp_path, "job.json", "{}"))
    results.look()
    assert results.again == ["done twice: jobs/dark/corridor-0001/gray-0-abc/job.json"]


def test_a_file_that_is_other_or_missing_is_seen_and_scenes_stay(tmp_path: Path) -> None:
    trial = Trial(tmp_path, random.Random(0), 1)
    scores = record(trial.run, "scores.json", "1")
    (trial.run / "dataset").mkdir()
    trial.reference = fingerprint(trial.run)
    assert trial.differences() == []
    scores.write_text("2")
    assert trial.differences() == ["other: jobs/dark/corridor-0001/gray-0-abc/scores.json"]
    forget(trial)
    assert [path.name for path in trial.run.iterdir()] == ["dataset"]
    assert trial.differences() == ["lacks: jobs/dark/corridor-0001/gray-0-abc/scores.json"]
    record(trial.run, "scores.json", "1")
    record(trial.run, "error.txt", "")
    assert trial.differences() == ["has also: jobs/dark/corridor-0001/gray-0-abc/error.txt"]
