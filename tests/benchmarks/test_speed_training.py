# SPDX-License-Identifier: Apache-2.0
"""What a training step costs is measured of a real one; how long it takes nobody asserts."""

from graycard.benchmarks.speed._engine_scenes import Workload
from graycard.benchmarks.speed._machine import QUICK
from graycard.benchmarks.speed._training import training_step_cost
from graycard.methods.surfels import SurfelSettings


def test_every_stage_has_its_time():
    tiny = Workload("tiny", 40, 16, 0.1)
    costs = training_step_cost(tiny, QUICK, SurfelSettings(iterations=50, degree=1))
    assert [cost.stage for cost in costs] == ["colours", "loss", "gradients", "adam", "step"]
    assert all(cost.timing.ms > 0 for cost in costs)
