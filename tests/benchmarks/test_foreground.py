# SPDX-License-Identifier: Apache-2.0
"""Threads of a fit that the command line asks for."""

import os
from pathlib import Path
from unittest import mock

import pytest

from graycard import MethodError
from graycard.benchmarks import _foreground
from graycard.benchmarks._fit import FitSpec
from graycard.benchmarks._foreground import _Asked
from graycard.benchmarks._jobs import THREADS


@pytest.mark.parametrize(
    ("told", "seen"),
    [
        ({}, ("3", "3", "3")),
        ({"OMP_NUM_THREADS": "2"}, ("2", "2", "3")),
        ({"NUMBA_NUM_THREADS": "1"}, ("3", "3", "1")),
    ],
)
def test_a_fit_starts_as_many_threads_as_it_may_use_cores(
    monkeypatch: pytest.MonkeyPatch, told: dict[str, str], seen: tuple[str | None, ...]
):
    """A request to one library holds for it alone; one to OpenMP holds for MKL, too."""
    found: list[tuple[str | None, ...]] = []

    def fit_scene(*_: object) -> None:
        found.append(tuple(os.environ.get(name) for name in THREADS))
        raise MethodError("that is all")

    monkeypatch.setattr(_foreground, "fit_scene", fit_scene)
    monkeypatch.setattr(_foreground, "usable_cores", lambda: 3)
    asked = _Asked(FitSpec("gray", {}, 0, Path("scene")), Path("predictions"), None)
    others = {name: value for name, value in os.environ.items() if name not in THREADS}
    with mock.patch.dict(os.environ, {**others, **told}, clear=True):
        assert _foreground._fit(asked).reason == "that is all"
    assert found == [seen]
