# SPDX-License-Identifier: Apache-2.0
"""The check of methods in this process, on scenes that are written once: others take seconds."""

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from graycard.benchmarks.kit import _check, _commands
from tiny_benches import served_here


class _Here:
    """A worker that runs the stages in this process."""

    def __init__(self, work: Any, *_: Any, **__: Any) -> None:
        self.do = work

    def close(self) -> None:
        """Nothing is open."""


@cache
def _scene_of(dataset: Path, track: str) -> Path:
    return _check.tiny_scene(dataset, track)


def checked_here(patch: pytest.MonkeyPatch, temporary: Path, dataset: Path) -> None:
    """Let checks run in this process.

    Args:
        patch: Undoes it.
        temporary: Folder for temporary files, the only one that methods may write to.
        dataset: Folder for the scenes, kept for other checks.
    """
    served_here(patch)
    patch.setattr(tempfile, "tempdir", str(temporary))
    patch.setenv("TORCHINDUCTOR_CACHE_DIR", str(temporary))  # PyTorch keeps the first one of a process
    for module in (_check, _commands):
        patch.setattr(module, "StandingWorker", _Here)
    patch.setattr(_check._Check, "scene", lambda self, track: _scene_of(dataset, track))
