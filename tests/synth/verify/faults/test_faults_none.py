# SPDX-License-Identifier: Apache-2.0
"""Scenes without a fault pass, and what every fault does besides is no fault by itself."""

import pytest

from fault_planting import Copied, edit, failures, reseal
from graycard import TRACKS

pytestmark = pytest.mark.usefixtures("llvm")


@pytest.mark.parametrize("track", TRACKS)
def test_a_scene_without_a_fault_passes(copied: Copied, track: str):
    assert failures(copied(track), 2) == {}


@pytest.mark.parametrize("track", TRACKS)
def test_every_fault_is_of_a_kind_that_a_whole_scene_has_not(copied: Copied, track: str):
    """Rewriting and sealing the files, which each fault does, is no fault by itself."""
    scene = copied(track)
    edit(scene, lambda layers, view: None)
    reseal(scene)
    assert failures(scene, 0) == {}
