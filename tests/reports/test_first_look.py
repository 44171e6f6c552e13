# SPDX-License-Identifier: Apache-2.0
"""Comparison of runs that added scenes: pages, sites and files have that of the first look."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard.cli import main
from graycard.eval.statistics import Question, compare_first_look, compare_run
from graycard.io import write_json
from graycard.records import (
    COMPARISON,
    Comparison,
    Ledger,
    Look,
    Looks,
    RunRecord,
    read_comparison,
    read_run,
)
from graycard.records._run import read_record
from graycard.reports import headline_ids, publish_run, write_site
from runs_of_size import write_made_up


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Return a run with 6 scenes of its suite and 2 of a later look, and the comparison of the former."""
    record = write_made_up(tmp_path / "run", 4, 8, metrics=2, views=1)
    scenes = [f"dark/{scene.scene}" for scene in record.scenes]
    rows = tuple(method.name for method in record.methods)
    made = (Look(tuple(scenes[:6]), rows), Look(tuple(scenes[6:]), rows))
    record = replace(record, looks=Looks(8, 0.99, {}, made))
    write_json(tmp_path / "run" / "run.json", record)
    write_json(tmp_path / "run" / COMPARISON, compare_run(record.at_look(0)))
    return tmp_path / "run"


@pytest.fixture
def published(run: Path) -> Path:
    folder = run.parent / "published" / "mine"
    publish_run(run, folder, 100)
    return folder


def test_the_first_look_is_another_sample(run: Path) -> None:
    record = read_run(run)
    assert compare_first_look(record) == compare_run(record.at_look(0)) != compare_run(record)
    plain = replace(record, looks=None)
    assert compare_first_look(plain) == compare_run(plain)


def test_a_page_made_anew_is_the_page_of_the_run(
    published: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The record, which may be large, is read once."""
    read: list[Path] = []

    def counted(cls: type[Any], path: Path, *told: Any) -> Any:
        read.append(path)
        return read_record(cls, path, *told)

    monkeypatch.setattr("graycard.records._run.read_record", counted)
    page = (published / "index.html").read_bytes()
    assert main(["report", str(published), "--out", str(tmp_path / "new.html")]) == 0
    assert read == [published / "run.json"]
    assert (tmp_path / "new.html").read_bytes() == page


def test_a_site_tells_the_same(published: Path, tmp_path: Path) -> None:
    def asked(record: RunRecord) -> Comparison:
        return compare_first_look(record, Question(headline_ids(record)))

    assert main(["site", str(published), "--out", str(tmp_path / "one")]) == 0
    write_site([published], tmp_path / "two", asked)
    write_site([published], tmp_path / "three", lambda record: compare_run(record))
    one, two, three = (
        (tmp_path / name / "leaderboards.html").read_text() for name in ("one", "two", "three")
    )
    assert one == two != three


def test_compare_leaves_what_the_bench_wrote(run: Path) -> None:
    (run / COMPARISON).unlink()
    assert main(["compare", str(run)]) == 0
    record = read_run(run)
    assert read_comparison(run) == compare_run(record.at_look(0))


def test_new_verdicts_are_published_beside_the_same(published: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Comparison] = []
    ledger = Ledger("made-up", 1, "", 0.95, {}, {}, ())
    monkeypatch.setattr("graycard.benchmarks.claims.judge_run", lambda *_, **__: ledger)
    monkeypatch.setattr(
        "graycard.reports.republish_claims", lambda run, found, compared: given.append(compared)
    )
    assert main(["claims", str(published), "--republish"]) == 0
    assert given == [compare_run(read_run(published).at_look(0))]
