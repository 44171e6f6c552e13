# SPDX-License-Identifier: Apache-2.0
"""The first tutorial, command by command, as a newcomer types it."""

import shlex
from pathlib import Path

import pytest

from graycard.cli import main
from prose import ROOT

PAGE = ROOT / "docs" / "tutorials" / "first-report.md"


def commands() -> list[list[str]]:
    """Return the commands of the tutorial, in order."""
    lines = [line.partition(" #")[0].strip() for line in PAGE.read_text(encoding="utf-8").splitlines()]
    return [shlex.split(line)[1:] for line in lines if line.startswith("graycard ")]


@pytest.mark.slow
def test_the_first_report_comes_out_as_the_tutorial_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    said = {}
    for command in commands():
        assert main(command) == 0, command
        said[command[0]] = capsys.readouterr().out
    assert (tmp_path / "runs/demo/report/index.html").is_file()
    assert said["bench"].splitlines()[-1].startswith("bench: 19 jobs, 0 failures")
    best = {line.split()[0] for line in said["bench"].splitlines() if " *" in line}
    assert {"sunfaded", "goris", "gsid"} <= best
    assert "gate: passed" in said["gate"]


def test_the_tutorial_begins_with_the_demo_and_ends_with_the_gate():
    assert [command[0] for command in commands()][:1] == ["bench"]
    assert commands()[-1][0] == "gate"
