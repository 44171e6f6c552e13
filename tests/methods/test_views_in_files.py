# SPDX-License-Identifier: Apache-2.0
"""Fits whose views lie in files, as those of large captures do."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rooms_in_files import all_in_files
from tiny_fits import TRACKS, fitted, pictures

QUICK = {"iterations": 10, "surfels": 150, "fill": 0.0}
CASES = {
    **{name: (name, {}) for name in TRACKS},
    "2dgs by stereo": ("2dgs", {"fill": 0.75, "surfels": 400}),
    "sunfaded by stereo": ("sunfaded", {"fill": 0.75, "surfels": 400, "clearing": 0.9}),
    "gsid by stereo": ("gsid", {"fill": 0.75, "surfels": 400}),
    "grouping": ("grouping", {}),
    "removal of each view": ("removal-per-view", {}),
    "goris with its shadow": ("goris", {"shadow": True, "distilled": True}),
}
FEW = ("sunfaded", "2dgs by stereo", "gsid by stereo", "goris")
"""Cases of every run of the tests, with and without stereo; the others are slow tests."""


@pytest.fixture
def files(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of arrays in all files from now on, as if there was no memory."""
    return all_in_files(monkeypatch)


@pytest.mark.parametrize("case", [c if c in FEW else pytest.param(c, marks=pytest.mark.slow) for c in CASES])
def test_a_fit_with_views_in_files_ends_with_the_same_bits(
    case: str, make_scene: Callable[..., Path], request: pytest.FixtureRequest
) -> None:
    name, changes = CASES[case]
    scene = make_scene(track=TRACKS.get(name, "tabletop"), train=4, test=1)
    usual = pictures(fitted(name, scene, "cpu", **QUICK | changes), scene)
    files: list[int] = request.getfixturevalue("files")
    assert np.array_equal(pictures(fitted(name, scene, "cpu", **QUICK | changes), scene), usual)
    assert len(files) >= 4, "a file or more of each view"
