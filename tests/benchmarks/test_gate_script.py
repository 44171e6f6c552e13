# SPDX-License-Identifier: Apache-2.0
"""The gate's script for any service: where it takes the baseline from, and what it leaves as it was."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gate_action import ACTION, commit, git, make_repository

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the script is for bash")
GRAYCARD = f'#!/bin/sh\nexec "{sys.executable}" -m graycard "$@"\n'


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A clone with three commits, and a run that has no record."""
    checkout = make_repository(tmp_path)
    for word in ("second", "third"):
        (checkout / "mine.py").write_text(word)
        commit(checkout, word)
    program = tmp_path / "cache" / "env" / "bin" / "graycard"
    program.parent.mkdir(parents=True)
    program.write_text(GRAYCARD)
    program.chmod(0o755)
    (checkout / "graycard-gate").mkdir()
    (checkout / "graycard-gate" / "bench.code").write_text("0\n")
    return checkout


def gate(checkout: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GITHUB_")}
    environment |= {"GATE_CACHE": str(checkout.parent / "cache"), **variables}
    shell = ["bash", str(ACTION / "gate.sh"), "gate"]
    return subprocess.run(shell, cwd=checkout, env=environment, capture_output=True, text=True, check=False)


def test_a_branch_that_cannot_be_fetched_passes_nothing(checkout: Path):
    done = gate(checkout, GATE_BRANCH="mian")
    assert done.returncode == 2
    assert "expected a branch mian on the remote origin that can be fetched" in done.stderr
    git(checkout, "remote", "remove", "origin")
    assert gate(checkout).returncode == 2


def test_a_branch_without_a_baseline_passes_and_the_clone_stays_whole(checkout: Path):
    done = gate(checkout)
    assert done.returncode == 0, done.stderr
    assert "gate: passed: no graycard-baseline.json on main yet" in done.stdout
    assert len(git(checkout, "log", "--format=%h").splitlines()) == 3
    assert git(checkout, "rev-parse", "--is-shallow-repository").strip() == "false"
