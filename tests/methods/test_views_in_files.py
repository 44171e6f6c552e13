# SPDX-License-Identifier: Apache-2.0
"""Fits whose views lie in files, as those of large captures do."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from graycard.io import _room
from tiny_fits import TRACKS, fitted, pictures


@pytest.mark.parametrize("name", TRACKS)
def test_a_fit_with_views_in_files_ends_with_the_same_bits(
    name: str, make_scene: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = make_scene(track=TRACKS[name], train=4, test=1)
    changes = {"iterations": 10, "surfels": 150, "fill": 0.0}
    usual = pictures(fitted(name, scene, "cpu", **changes), scene)
    made: list[int] = []
    mapped = _room.mapped
    monkeypatch.setattr(_room, "SHARE", 0.0)
    monkeypatch.setattr(_room, "SMALL", 0)
    monkeypatch.setattr(_room, "hand_back_freed_memory", lambda: True)
    monkeypatch.setattr(_room, "mapped", lambda values: made.append(values.nbytes) or mapped(values))
    assert np.array_equal(pictures(fitted(name, scene, "cpu", **changes), scene), usual)
    assert len(made) >= 4, "a file or more of each view"
