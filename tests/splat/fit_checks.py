# SPDX-License-Identifier: Apache-2.0
"""A small fit, run as a program so that it can be killed: ``fit_checks.py OUT CHECKPOINT|- STOP``.

It hangs before step STOP until it is killed, or never if STOP is negative; the last state is saved to OUT.
"""

import sys
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch

from graycard import Camera, look_at
from graycard.methods import splat

STEPS, EVERY = 40, 8
RULES = splat.DensityRules(
    every=0.2,
    reset_every=0.3,
    until=0.8,
    gradient=1e-7,
    small=0.15,
    limit=40,
    least_opacity=0.15,
    reset_opacity=0.2,
    largest=0.3,
)
RATES = {
    splat.CENTRES: splat.LearningRateSchedule(1e-2, 1e-3),
    splat.LOG_SCALES: splat.LearningRateSchedule(5e-3),
    splat.ROTATIONS: splat.LearningRateSchedule(1e-3),
    splat.LOGITS: splat.LearningRateSchedule(5e-2, windows=((0.0, 0.5), (0.7, 1.0))),
    "colour": splat.LearningRateSchedule(1e-2),
    "gain": splat.LearningRateSchedule(1e-2),
}


def start() -> splat.FitState:
    """Twelve surfels with a colour each, and one number that all share."""
    random = np.random.default_rng(2)
    surfels = splat.surfels_from_points(
        random.uniform(-0.6, 0.6, (12, 3)), random.normal(size=(12, 3)), np.zeros((12, 0)), 0.6
    )
    colour = torch.from_numpy(random.random((12, 3)).astype(np.float32))
    return splat.initial_state(splat.parameters_of(surfels, {"colour": colour}, {"gain": torch.ones(1)}), 3)


def objective(values: Mapping[str, torch.Tensor], step: int) -> splat.LossResult:
    """Far from a chessboard, from one of three sides."""
    turn = 0.7 * (step % 3)
    eye = 3 * np.array([np.sin(turn), -np.cos(turn), 0.3])
    camera = Camera.from_fov(24, 20, 40, look_at(eye, np.zeros(3)))
    y, x = torch.meshgrid(torch.arange(20), torch.arange(24), indexing="ij")
    target = ((x // 6 + y // 5) % 2).float()[..., None].expand(20, 24, 3)
    offsets = torch.zeros(len(values[splat.CENTRES]), 2, requires_grad=True)
    surfels = splat.surfels_of(values, values["colour"])
    drawn = splat.rasterize_features(surfels, camera, offsets=offsets)
    loss = (values["gain"] * drawn.features - target).abs().mean()
    return splat.LossResult(loss, offsets, torch.zeros(len(offsets)), (24, 20))


def plan(checkpoint: Path | None) -> splat.TrainConfig:
    """The whole fit."""
    saved = None if checkpoint is None else splat.Checkpoint(checkpoint, EVERY, "fit_checks")
    return splat.TrainConfig(STEPS, RATES, 1.0, RULES, saved)


def main(out: str, checkpoint: str, stop: str) -> None:
    """Fit, or hang where the killer waits."""

    def progress(done: float, doing: str) -> None:
        if round(done * STEPS) == int(stop):
            sys.stdout.write("here\n")
            sys.stdout.flush()
            time.sleep(600)

    path = None if checkpoint == "-" else Path(checkpoint)
    last = splat.train(start(), plan(path), objective, progress)
    splat.save_state(splat.Checkpoint(Path(out), 1, ""), last)


if __name__ == "__main__":
    main(*sys.argv[1:])
