# SPDX-License-Identifier: Apache-2.0
"""Freed memory is kept for later."""

import platform
import subprocess
import sys

import pytest

FAULTS = """
import resource
import numpy as np
from graycard.io import hand_back_freed_memory, keep_freed_memory

{call}

def faults_of_an_image():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.ones(3_000_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

faults_of_an_image()
print(faults_of_an_image())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's allocator is set")
def test_the_next_image_takes_the_memory_of_the_last() -> None:
    kept, given_back = (_faults(call) for call in ("assert keep_freed_memory()", ""))
    assert kept < 5 < given_back, "24 MB are 6,000 pages, or 12 large ones"


TRAINED = """
import torch
from graycard.io import silent
from graycard.methods.splat import LearningRateSchedule, LossResult, TrainConfig
from graycard.methods.splat import initial_state, parameters_of, surfels_from_points, train
assert hand_back_freed_memory()
discs = surfels_from_points(np.eye(3), np.eye(3), np.eye(3))
state = initial_state(parameters_of(discs, {}, {"light": torch.zeros(3)}), 0)
config = TrainConfig(1, {"light": LearningRateSchedule(1.0)}, 1.0)
train(state, config, lambda values, step: LossResult(values["light"].sum()), silent)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's allocator is set")
def test_steps_of_a_fit_take_the_memory_of_those_before() -> None:
    """Also where so much was kept of views that they went into files."""
    assert _faults(TRAINED) < 5


def _faults(call: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", FAULTS.format(call=call)], capture_output=True, text=True, check=True
    )
    return int(done.stdout)
