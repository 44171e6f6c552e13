# SPDX-License-Identifier: Apache-2.0
"""Counts of methods are part of the cost of a fit."""

from pathlib import Path

import numpy as np
import pytest

from graycard import MethodError, open_capture
from graycard.benchmarks import FitSpec, fit_scene
from graycard.io import from_builtins, silent, to_builtins
from graycard.records import Cost


def test_the_mean_over_held_out_views_is_kept(make_scene, tmp_path: Path) -> None:
    scene = make_scene()
    cost = fit_scene(FitSpec("small_methods:Counting", {}, 0, scene), tmp_path / "p", silent).cost
    views = open_capture(scene / "capture").test
    assert cost.counts == {"steps": pytest.approx(np.mean([v.camera.position[0] for v in views]))}
    assert from_builtins(Cost, to_builtins(cost)) == cost


def test_other_counts_in_other_views_are_refused(make_scene, tmp_path: Path) -> None:
    with pytest.raises(MethodError, match="expected the same counts of each view"):
        fit_scene(FitSpec("small_methods:Odd", {}, 0, make_scene()), tmp_path / "p", silent)


def test_a_method_that_counts_nothing_has_no_counts(make_scene, tmp_path: Path) -> None:
    assert fit_scene(FitSpec("gray", {}, 0, make_scene()), tmp_path / "p", silent).cost.counts == {}
