# SPDX-License-Identifier: Apache-2.0
"""Parameters that a step of ``sunfaded`` moves, and those that it leaves alone."""

from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from graycard.methods.splat import (
    LearningRateSchedule,
    TrainConfig,
    initial_state,
    rasterize,
    surfels_of,
    view_at,
)
from graycard.methods.splat.fit._train import train_step
from graycard.methods.sunfaded import SunFadedSettings
from graycard.methods.sunfaded._guess import GeometryGuess
from graycard.methods.sunfaded._model import ALBEDO
from graycard.methods.sunfaded._objective import SunFadedObjective, photographs
from graycard.methods.sunfaded._start import start
from sparse_points import with_points


@pytest.fixture
def scene(make_scene: Callable[..., Path]) -> Path:
    return make_scene(train=5, test=2)


def settings(**changes: float) -> SunFadedSettings:
    """On the sparse points alone: there are many of them here."""
    return SunFadedSettings(iterations=80, surfels=400, fill=0.0, **changes)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("least", [0.0, 0.05])
def test_the_first_stage_leaves_paint_alone_where_the_lamp_shines(scene: Path, least: float):
    """Not by a small weight, which Adam takes out again, but without one."""
    capture, chosen = with_points(scene), settings(least_weight=least, blur=0.02)
    views = photographs(capture, chosen)
    state = initial_state(start(capture, views, chosen, 0), 0)
    before = state.parameters.surfels[ALBEDO].clone()
    view = views[view_at(0, len(views), 0)]
    paint = torch.ones(len(before), 1, requires_grad=True)
    drawn = rasterize(surfels_of(state.parameters.all, paint), view.camera).features
    dark = (view.weight >= 0.05 * view.weight.max()).float()
    in_view, in_the_dark = (
        torch.autograd.grad((drawn * pixels).sum(), paint, retain_graph=True)[0][:, 0] > 0
        for pixels in (torch.ones_like(dark), dark)
    )
    objective = SunFadedObjective(views, [GeometryGuess()] * len(views), chosen, 0)
    config = TrainConfig(chosen.iterations, {ALBEDO: LearningRateSchedule(5e-3)}, 1.0)
    moved = (train_step(state, config, objective).parameters.surfels[ALBEDO] - before).abs().amax(dim=1)
    lit = in_view & ~in_the_dark
    assert lit.sum() > 20
    assert moved[in_the_dark].median() == pytest.approx(5e-3, rel=0.01)
    assert moved[lit].median() == pytest.approx(5e-3 if least == 0 else 0, rel=0.01)
