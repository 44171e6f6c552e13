# SPDX-License-Identifier: Apache-2.0
"""A machine that refuses what is asked of it: words and exit code 2, no traceback."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from graycard import MethodError
from graycard.cli import main

LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_NOFILE, (int(sys.argv[1]), resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
from graycard.cli import main
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="has no such limits")
@pytest.mark.parametrize("files", [6, 8, 12])
def test_too_few_open_files(tiny_scenes: dict[str, Path], tmp_path: Path, files: int):
    verb = ["fit", "gray", str(tiny_scenes["dark"]), "--out", str(tmp_path / "p")]
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(files), *verb], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "Too many open files" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("code", "advice"),
    [(errno.EMFILE, "ulimit"), (errno.ENOSPC, "Free some space"), (errno.EIO, "run the same command again")],
)
def test_what_the_system_refuses_is_said_in_words(
    code: int, advice: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def refuse(*_: object) -> int:
        raise OSError(code, os.strerror(code), "/some/place")

    monkeypatch.setattr("graycard.cli._main._run", refuse)
    assert main(["methods"]) == 2
    said = capsys.readouterr().err
    assert said.startswith(
        f"graycard: expected a machine that can go on, got {os.strerror(code)} at /some/place"
    )
    assert advice in said


def test_other_errors_of_files_are_bugs(monkeypatch: pytest.MonkeyPatch):
    def fail(*_: object) -> int:
        raise NotADirectoryError(errno.ENOTDIR, "x")

    monkeypatch.setattr("graycard.cli._main._run", fail)
    with pytest.raises(NotADirectoryError):
        main(["methods"])


def test_a_method_that_meets_the_limits_of_the_machine_is_not_to_blame(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def fail(*_: object) -> int:
        raise MethodError("expected room for a worker process") from OSError(errno.EMFILE, "x")

    monkeypatch.setattr("graycard.cli._main._run", fail)
    assert main(["methods"]) == 2
    assert "Traceback" not in capsys.readouterr().err
