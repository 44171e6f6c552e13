# SPDX-License-Identifier: Apache-2.0
"""Surfels come and go while light transport is fitted and, where settings ask for it, in the removal."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from glossy_captures import QUICK, UNTOLD, told
from glossy_sheets import EXTENT, GlossyWorld, glossy_world, shots_of_world, with_settings
from graycard import open_capture
from graycard.io import silent
from graycard.methods.goris import GorisMethod, GorisSettings
from graycard.methods.goris._fit import fit_colours, fit_light, light_density_rules, light_rates
from graycard.methods.goris._objective import LightObjective
from graycard.methods.goris._remove import RemovalObjective, RemovalTarget, removal_density_rules
from graycard.methods.goris._training_views import training_views
from graycard.methods.priors import PriorSpec
from graycard.methods.splat import LOGITS, Parameters, TrainConfig, initial_state, train


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


def test_rules_are_those_of_the_stages():
    """Shares of the paper's steps; pruning in the first stage alone."""
    light = light_density_rules(with_settings(light_density=0.3))
    steps = [step for step in range(1, 101) if light.densifies(step, 100)]
    assert steps == [5, 10, 15, 20, 25]
    assert light.least_opacity > 0
    assert light.limit == 2000
    removal = removal_density_rules(with_settings(removal_density=0.5))
    steps = [step for step in range(1, 201) if removal.densifies(step, 200)]
    assert steps == [30, 40, 50, 60, 70, 80, 90]
    assert removal.least_opacity == 0.0
    assert not any(rules.resets(step, 100) for rules in (light, removal) for step in range(100))


@pytest.mark.parametrize("tile", [112, 18])
def test_a_step_tells_what_the_picture_asks_of_each_surfel_until_densification_is_over(
    world: GlossyWorld, tile: int
):
    settings = with_settings(light_density=0.5, tile=tile)
    objective = LightObjective(shots_of_world(world), settings, EXTENT, 0)
    last = settings.light_steps // 2
    result = objective(world.parameters.all, last - 1)
    assert result.offsets is not None
    assert result.radius is not None
    assert result.radius.shape == (len(world.part),)
    assert result.size == (44, 36)
    (found,) = torch.autograd.grad(result.loss, [result.offsets])
    assert float((found.norm(dim=1) > 0).float().mean()) > 0.3
    assert objective(world.parameters.all, last).offsets is None


@pytest.mark.parametrize("step", [0, 3])
def test_a_step_without_densification_has_the_same_loss_and_tells_nothing(world: GlossyWorld, step: int):
    shots = shots_of_world(world)
    aims = upside_down(world)
    plain, dense = (with_settings(light_density=share, removal_density=share) for share in (0.0, 1.0))
    for objectives in (
        [LightObjective(shots, settings, EXTENT, 0) for settings in (plain, dense)],
        [RemovalObjective(shots, aims, settings, EXTENT, 0) for settings in (plain, dense)],
    ):
        one, other = (objective(world.parameters.all, step) for objective in objectives)
        assert torch.equal(one.loss, other.loss)
        assert one.offsets is None
        assert other.offsets is not None


def test_surfels_come_while_light_is_fitted(world: GlossyWorld):
    """Only where settings ask for it, with all that a surfel has, and no more than settings allow."""
    shots = shots_of_world(world)
    counts = []
    for share, limit in ((0.0, 2500), (1.0, 2500), (1.0, len(world.part) + 9)):
        settings = with_settings(light_density=share, surfels=limit, residual_degree=1)
        found = fit_light(world.parameters, shots, settings, 0, silent).parameters
        assert {len(values) for values in found.surfels.values()} == {len(found)}
        assert all(torch.isfinite(values).all() for values in found.all.values())
        counts.append(len(found))
    assert counts[0] == len(world.part)
    assert counts[1] > counts[0]
    assert counts[2] <= len(world.part) + 9


def test_the_first_steps_leave_room(scene: Path):
    """Surfels reach the number that settings allow in the end, not before light is fitted."""
    capture = open_capture(scene / "capture", check=False)
    priors = told(scene, PriorSpec("oracle", 1, overrides=UNTOLD))
    counts = []
    for share in (0.0, 0.9):
        settings = replace(QUICK, light_density=share, iterations=24)
        masks = [np.asarray(capture.target_mask(view), bool) for view in capture.train]
        shots = training_views(capture, priors, masks, settings)
        coloured = fit_colours(capture, shots, settings, 0, silent)
        counts += [len(coloured), len(fit_light(coloured, shots, settings, 0, silent).parameters)]
    assert counts[:3] == [400, 400, 350]
    assert 350 < counts[3] <= 400


def upside_down(world: GlossyWorld) -> list[RemovalTarget]:
    """Photographs as they are not, believed everywhere."""
    kept = torch.ones(36, 44)
    return [
        RemovalTarget(kept, 0 * kept, 0 * kept, shot.photograph.encoded.flip(0), {})
        for shot in shots_of_world(world)
    ]


def fitted(scene: Path, settings: GorisSettings):
    capture = open_capture(scene / "capture", check=False)
    priors = told(scene, PriorSpec("oracle", 1, overrides=UNTOLD))
    return GorisMethod().fit(capture, priors, settings, 0, silent)


@pytest.mark.parametrize("share", [0.0, 0.8])
def test_surfels_come_in_the_removal_and_none_goes(world: GlossyWorld, share: float):
    """Not even those that are next to transparent; pictures are upside down, so that they ask for more."""
    settings = with_settings(removal_density=share, second_share=0.5)
    own = dict(world.parameters.surfels)
    own[LOGITS] = torch.where(torch.arange(len(world.part)) < 100, -9.0, own[LOGITS])
    objective = RemovalObjective(shots_of_world(world), upside_down(world), settings, EXTENT, 0)
    rules, rates = removal_density_rules(settings), light_rates(EXTENT, settings, found=True)
    config = TrainConfig(settings.second_steps, rates, EXTENT, rules if share else None)
    start = initial_state(Parameters(own, world.parameters.shared), 0)
    found = train(start, config, objective, silent).parameters
    assert (len(found) > len(world.part)) == (share > 0)
    assert len(found) <= settings.surfels
    assert int((found.surfels[LOGITS] < -5).sum()) >= 100


def test_a_densified_fit_that_is_resumed_ends_with_the_same_bits(scene: Path, tmp_path: Path):
    settings = replace(QUICK, light_density=0.8, removal_density=0.8, second_share=1.0, residual_degree=1)
    whole = fitted(scene, settings)
    saved = replace(settings, checkpoint=str(tmp_path / "fit"))
    fitted(scene, saved)
    for stage in ("light", "removal"):
        (tmp_path / f"fit.{stage}").unlink()
        again = fitted(scene, saved)
        for name, values in whole.after.parameters.all.items():
            assert np.array_equal(values, again.after.parameters.all[name]), name


@pytest.mark.parametrize("name", ["light_density", "removal_density"])
@pytest.mark.parametrize("share", [-0.1, 1.1])
def test_no_other_shares(name: str, share: float):
    with pytest.raises(ValueError, match=r"removal_density in \[0, 1\]"):
        with_settings(**{name: share})
