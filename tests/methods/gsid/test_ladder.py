# SPDX-License-Identifier: Apache-2.0
"""A model that contains another explains its own photographs no worse."""

from dataclasses import replace

import pytest
import torch

from graycard.io import silent
from graycard.methods.gsid import GsidSettings
from graycard.methods.gsid._fit import train_lights
from graycard.methods.gsid._guess import MaterialGuess
from graycard.methods.gsid._materials import first_materials
from graycard.methods.gsid._model import SIDE, lit_side
from graycard.methods.gsid._settings import Visibility
from graycard.methods.gsid._stage import LightStage, objective_in, renewed
from graycard.methods.gsid._start import first_parameters
from graycard.methods.splat import GEOMETRY, initial_state
from graycard.methods.surfels import srgb_encode_tensor
from lit_sheets import EXTENT, World

LADDER = GsidSettings(iterations=120, sky_size=4, tile=36, visibility="none", bounces=False)
SLACK = 0.1
"""Decibels."""


def training_psnr(world: World, settings: GsidSettings) -> float:
    """Return PSNR of the second stage on true surfaces, without known materials and lights."""
    shots = [replace(shot, guess=MaterialGuess()) for shot in world.shots]
    stage = LightStage(world.surfels, shots, settings, EXTENT, 0)
    surface = {name: world.surface[name].clone() for name in (*GEOMETRY, "open sky")}
    surface |= first_materials(world.surfels, world.normals, shots)
    surface[SIDE] = lit_side(world.surfels, world.normals)
    fitted = train_lights(initial_state(first_parameters(stage, surface), 0), stage, silent).parameters
    objective = objective_in(renewed(stage, fitted), fitted)
    errors = [
        (srgb_encode_tensor(objective.picture(fitted.all, number).whole) - shot.shown).square().mean()
        for number, shot in enumerate(objective.shots)
    ]
    return float(-10 * torch.stack(errors).mean().log10())


def test_lamps_explain_more_than_surroundings_alone(world: World):
    """Rows ``gsid-sgm`` and ``gsid-env-ao``."""
    found = {lamps: training_psnr(world, replace(LADDER, lamps=lamps)) for lamps in (0, 8)}
    assert found[8] >= found[0] - SLACK


@pytest.mark.slow
@pytest.mark.parametrize("visibility", ["vector", "traced"])
def test_more_lamps_explain_more(world: World, visibility: Visibility):
    """Rows ``gsid-lamps-16`` and ``gsid-lamps-1``: with vectors, as by default, and with rays."""
    shadowed = replace(LADDER, visibility=visibility)
    found = {lamps: training_psnr(world, replace(shadowed, lamps=lamps)) for lamps in (1, 16)}
    assert found[16] >= found[1] - SLACK
