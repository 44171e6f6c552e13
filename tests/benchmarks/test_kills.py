# SPDX-License-Identifier: Apache-2.0
"""A bench that is killed at any time goes on to the same bits and leaves nothing behind."""

import os
import sys
from pathlib import Path

import pytest

from kill_bench import fingerprint, kill_benches

KILLS = int(os.environ.get("GRAYCARD_KILLS", "6"))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")
def test_a_bench_that_is_killed_ends_as_if_nothing_had_been(tmp_path: Path) -> None:
    """`GRAYCARD_KILLS=100` for more kills; a seed of its own makes each number of them other ones."""
    trial = kill_benches(tmp_path, KILLS, seed=KILLS)
    assert trial.kills.total() == KILLS
    assert trial.compared
    assert trial.failures == []


def test_the_comparison_sees_whatever_differs(tmp_path: Path) -> None:
    """Times alone may differ; a byte, a file that is left and a score may not."""
    (tmp_path / "run.json").write_text('{"wall_s": 1.0, "results": [{"cost": 1, "value": 2.0}]}')
    (tmp_path / "a.exr").write_bytes(b"a")
    before = fingerprint(tmp_path)
    (tmp_path / "run.json").write_text('{"wall_s": 9.0, "results": [{"cost": 8, "value": 2.0}]}')
    assert fingerprint(tmp_path) == before
    (tmp_path / "run.json").write_text('{"wall_s": 1.0, "results": [{"cost": 1, "value": 2.5}]}')
    assert fingerprint(tmp_path) != before
    (tmp_path / "run.json").write_text('{"wall_s": 1.0, "results": [{"cost": 1, "value": 2.0}]}')
    (tmp_path / ".lock").touch()
    assert fingerprint(tmp_path).keys() - before.keys() == {".lock"}
    (tmp_path / ".lock").unlink()
    (tmp_path / "a.exr").write_bytes(b"b")
    assert fingerprint(tmp_path) != before
