# SPDX-License-Identifier: Apache-2.0
"""Harmonics that glossy surfels add to what they reflect: their value, gradients, and what they mend."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from glossy_sheets import EXTENT, GlossyWorld, glossy_world, seen, shots_of_world, with_settings
from graycard import look_at
from graycard.io import silent
from graycard.methods.goris._filter import Reading
from graycard.methods.goris._fit import fit_light, light_rates, with_light
from graycard.methods.goris._model import RESIDUAL, SURROUNDINGS, residual_radiance
from graycard.methods.goris._objective import LightObjective
from graycard.methods.goris._remove import with_painted_wall
from graycard.methods.removal import BackgroundPoints
from graycard.methods.splat import (
    CENTRES,
    GEOMETRY,
    LearningRateSchedule,
    Parameters,
    TrainConfig,
    initial_state,
    train,
)

NUMBERS = {1: 3, 2: 8, 3: 15}
"""Harmonics by degree, without the constant one."""


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


def with_residual(world: GlossyWorld, degree: int, size: float) -> dict[str, torch.Tensor]:
    random = torch.Generator().manual_seed(5)
    harmonics = size * torch.randn(len(world.part), NUMBERS[degree], 3, generator=random)
    return world.changed(**{RESIDUAL: harmonics})


@pytest.mark.parametrize("degree", NUMBERS)
def test_a_residual_of_zero_changes_nothing(world: GlossyWorld, degree: int):
    camera = world.cameras[0]
    (_, plain), (_, same) = (
        seen(values, camera) for values in (world.parameters.all, with_residual(world, degree, 0.0))
    )
    assert torch.equal(plain.encoded, same.encoded)
    assert torch.equal(plain.reflected, same.reflected)


@pytest.mark.parametrize("composite", ["release", "paper"])
def test_it_is_added_in_linear_light_where_pixels_are_glossy(world: GlossyWorld, composite: Reading):
    camera, settings = world.cameras[1], with_settings(composite=composite)
    values = with_residual(world, 2, 0.02)
    (_, plain), (buffers, picture) = (seen(each, camera, settings) for each in (world.parameters.all, values))
    assert buffers.residual is not None
    added = picture.reflected - plain.reflected
    torch.testing.assert_close(added, buffers.residual, atol=1e-6, rtol=1e-4)
    inside = buffers.glossy > 0.99
    assert inside.sum() > 100
    assert float(added[inside].abs().mean()) > 0.003
    assert float((picture.encoded - plain.encoded)[buffers.glossy < 1e-3].abs().max()) < 1e-3


def test_it_is_zero_in_the_mean_over_directions(world: GlossyWorld):
    """Else it would be diffuse radiance of a metal, which scatters none (octahedra integrate degree 3)."""
    values = with_residual(world, 3, 1.0)
    values[CENTRES] = torch.zeros_like(values[CENTRES])
    eyes = np.concatenate([np.eye(3), -np.eye(3)])
    seen_from = torch.stack([residual_radiance(values, eye) for eye in eyes])
    assert float(seen_from.abs().mean()) > 0.1
    torch.testing.assert_close(seen_from.mean(dim=0), torch.zeros(len(world.part), 3), atol=1e-5, rtol=0)


@pytest.mark.parametrize("composite", ["release", "paper"])
def test_its_gradient_is_that_of_finite_differences_and_moves_no_surface(
    world: GlossyWorld, composite: Reading
):
    settings, camera = with_settings(composite=composite), world.cameras[3]
    base = with_residual(world, 2, 0.01)
    leaves = {name: v.clone().requires_grad_(name in (RESIDUAL, *GEOMETRY)) for name, v in base.items()}
    weight = torch.rand(36, 44, 3, generator=torch.Generator().manual_seed(3))

    def looked(values: dict[str, torch.Tensor]) -> torch.Tensor:
        return (seen(values, camera, settings)[1].encoded * weight).mean()

    (gradient,) = torch.autograd.grad(looked(leaves), [leaves[RESIDUAL]])
    direction, step = gradient.sign(), 5e-3
    with torch.no_grad():
        up, down = (looked({**base, RESIDUAL: base[RESIDUAL] + s * step * direction}) for s in (1, -1))
    expected = float((gradient * direction).sum())
    assert float(up - down) / (2 * step) == pytest.approx(expected, rel=0.02)
    residual = seen(leaves, camera, settings)[0].residual
    assert residual is not None
    moves = torch.autograd.grad(residual.sum(), [leaves[name] for name in GEOMETRY], allow_unused=True)
    assert all(found is None for found in moves)


def psnr(world: GlossyWorld, parameters: Parameters) -> float:
    """From a place between the cameras, of the floor."""
    pose = look_at(np.array([0.2, -1.5, 1.1]), np.array([0.0, 0.1, 0.1]))
    camera = replace(world.cameras[0], camera_to_world=pose)
    with torch.no_grad():
        buffers, true = seen(world.parameters.all, camera)
        found = seen(parameters.all, camera)[1]
    floor = buffers.glossy > 0.99
    return float(-10 * torch.log10((found.encoded - true.encoded)[floor].square().mean()))


def test_it_takes_up_a_false_highlight_and_its_weight_holds_it_down(world: GlossyWorld):
    """The environment is wrong in one face and stays so; views between those of the fit gain, too."""
    wrong = dict(with_residual(world, 2, 0.0))
    sky = wrong.pop(SURROUNDINGS).clone()
    sky[2] += 1.5
    start = Parameters(
        {name: wrong[name] for name in (*world.parameters.surfels, RESIDUAL)},
        {**world.parameters.shared, SURROUNDINGS: sky},
    )
    before = psnr(world, start)
    found = []
    for weight in (0.1, 100.0):
        settings = with_settings(residual_weight=weight, normal_prior_weight=0.0, distortion_weight=0.0)
        objective = LightObjective(shots_of_world(world), settings, EXTENT, 0)
        config = TrainConfig(80, {RESIDUAL: LearningRateSchedule(5e-3)}, EXTENT)
        found.append(train(initial_state(start, 0), config, objective, silent).parameters)
    assert before < 30
    assert psnr(world, found[0]) > before + 2
    assert psnr(world, found[1]) == pytest.approx(before, abs=0.5)


def test_only_settings_that_ask_for_it_have_it(world: GlossyWorld):
    shots = shots_of_world(world)
    for degree, number in ({0: 0} | NUMBERS).items():
        settings = with_settings(residual_degree=degree)
        start = with_light(world.parameters, shots, settings, 0)
        assert (RESIDUAL in start.surfels) == (number > 0)
        assert (RESIDUAL in light_rates(EXTENT, settings, True)) == (number > 0)
        if number:
            assert start.surfels[RESIDUAL].shape == (len(world.part), number, 3)
            assert not start.surfels[RESIDUAL].any()
    untraced = with_settings(residual_degree=2, transport=False)
    assert RESIDUAL not in with_light(world.parameters, shots, untraced, 0).surfels


def test_it_begins_when_half_of_the_steps_are_done(world: GlossyWorld):
    shots = shots_of_world(world)
    settings = with_settings(iterations=10, radiance_share=0.6, residual_degree=1, first_light=False)
    found = fit_light(world.parameters, shots, settings, 0, silent).parameters.surfels[RESIDUAL]
    assert 0 < float(found.abs().max()) <= 2 * 1.01e-3, "two of four steps of Adam at its rate"


def test_new_surfels_of_a_removal_have_none(world: GlossyWorld):
    values = with_residual(world, 2, 0.5)
    left = Parameters(
        {name: values[name] for name in (*world.parameters.surfels, RESIDUAL)}, world.parameters.shared
    )
    points = np.random.default_rng(0).uniform(-1, 1, (60, 3)) * (1, 1, 0)
    wall = BackgroundPoints(points, np.tile([0.0, 0.0, 1.0], (60, 1)), np.full((60, 3), 0.3), np.ones(60))
    found = with_painted_wall(left, 60, wall, with_settings(), 0).surfels[RESIDUAL]
    count = len(world.part)
    assert found.shape == (count + 60, 8, 3)
    assert torch.equal(found[:count], values[RESIDUAL])
    assert not found[count:].any()


@pytest.mark.parametrize("degree", [-1, 4])
def test_no_other_degrees(degree: int):
    with pytest.raises(ValueError, match="residual_degree from 0 to 3"):
        with_settings(residual_degree=degree)
