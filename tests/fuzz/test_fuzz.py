# SPDX-License-Identifier: Apache-2.0
"""Hostile files of every kind meet words: no traceback, no hang, nothing written elsewhere, little memory.

``make fuzz`` runs the same for an hour. Variables of the environment say how much: ``FUZZ_SECONDS`` or
``FUZZ_CASES``, ``FUZZ_SEED``, ``FUZZ_KINDS`` (parts of names of kinds, with commas), and ``FUZZ_KEEP``, the
folder that inputs of failures are copied to. Seed, kind and number make a case again.
"""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from fuzzer import Budget, fuzz, table
from fuzzer.corpus import build
from fuzzer.kinds import DEAR, KINDS

CASES = 60
"""Number of cases that CI has time for."""


def test_hostile_files_meet_words(
    tmp_path: Path, write_tiny: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    budget = Budget.from_environment(CASES, [name for name in KINDS if name not in DEAR])
    keep = Path(os.environ.get("FUZZ_KEEP", tmp_path / "failures"))
    build(tmp_path, [name for kind in budget.kinds for name in KINDS[kind].inputs], write_tiny)
    found = table(report := fuzz(budget, tmp_path, keep))
    with capsys.disabled():
        print(f"\n{found}")  # noqa: T201 - the table is what it is run for
    assert not report.faults, f"inputs are in {keep}"
