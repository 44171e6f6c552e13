# SPDX-License-Identifier: Apache-2.0
"""The object's shadow: a box over a floor under a light that is known, and a fit that removes it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from glossy_captures import QUICK, UNTOLD, told
from glossy_sheets import EXTENT, FLOOR, OBJECT, SETTINGS, GlossyWorld, glossy_world, shots_of_world
from graycard import open_capture
from graycard.io import silent
from graycard.methods.goris import GorisMethod
from graycard.methods.goris._model import BRIGHTEST, DIFFUSE
from graycard.methods.goris._shadow import (
    LEAST_LEFT,
    Hiders,
    Sight,
    blocked_light,
    brightened,
    cosines_of,
    light_directions,
    light_found,
    sight_of,
    without_shadow,
)
from graycard.methods.priors import PriorSpec
from graycard.methods.splat import SH_DC, surfels_from_points, surfels_of
from graycard.methods.surfels import COEFFICIENTS, srgb_decode_tensor, srgb_encode_tensor

LOW, HIGH = np.array([-0.1, -0.1, 0.05]), np.array([0.1, 0.1, 0.35])
SUN, SKY = 40.0, 0.5


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


def floor_points() -> torch.Tensor:
    steps = np.arange(-0.8, 0.81, 0.04)
    x, y = np.meshgrid(steps, steps)
    return torch.from_numpy(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1).astype(np.float32))


def box_hiders() -> Hiders:
    """A box of discs over a floor of discs."""
    steps = (np.arange(20) + 0.5) / 20
    u, v = (part.ravel() for part in np.meshgrid(steps, steps))
    places, normals = [], []
    for axis in range(3):
        for end in (LOW, HIGH):
            side = np.empty((len(u), 3))
            side[:, axis] = end[axis]
            first, second = (axis + 1) % 3, (axis + 2) % 3
            side[:, first] = LOW[first] + u * (HIGH - LOW)[first]
            side[:, second] = LOW[second] + v * (HIGH - LOW)[second]
            places.append(side)
            normals.append(np.tile(np.eye(3)[axis], (len(u), 1)))
    box = np.concatenate(places)
    discs = surfels_from_points(box, np.concatenate(normals), np.zeros_like(box), opacity=0.99)
    floor = floor_points().numpy().astype(np.float64)
    ground = surfels_from_points(floor, np.tile([0.0, 0, 1], (len(floor), 1)), 0 * floor, opacity=0.99)
    return Hiders(discs, ground, 0.02)


def hit_box(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return true for rays that meet the box, shape ``(P, K)``, by its slabs."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = [(end - points)[:, None] / directions[None] for end in (LOW, HIGH)]
    near, far = np.minimum(*ends).max(axis=-1), np.maximum(*ends).min(axis=-1)
    return (far > 0) & (near < far)


def known_light(directions: torch.Tensor) -> torch.Tensor:
    """An even sky and a sun, warmer than the sky."""
    sun = int((directions @ torch.nn.functional.normalize(torch.tensor([0.7, 0.3, 0.8]), dim=0)).argmax())
    light = torch.full((len(directions), 3), SKY)
    light[sun] += SUN * torch.tensor([1.0, 0.8, 0.6])
    return light


def true_sight(points: torch.Tensor, directions: torch.Tensor, sizes: torch.Tensor) -> Sight:
    cosines = cosines_of(torch.tensor([[0.0, 0.0, 1.0]]).expand(len(points), 3), directions)
    hit = torch.from_numpy(hit_box(points.double().numpy(), directions.double().numpy()))
    return Sight(cosines * sizes, torch.ones_like(cosines), (~hit).float())


def test_the_share_that_a_box_takes_of_a_known_light_is_found():
    """Within a few per cent, from brightness alone, on a floor whose reflectance varies."""
    points, (directions, sizes) = floor_points(), light_directions()
    normals = torch.tensor([[0.0, 0.0, 1.0]]).repeat(len(points), 1)
    light, truth = known_light(directions), true_sight(points, directions, sizes)
    wanted = truth.left(light)
    noise = torch.exp(0.05 * torch.randn(len(points), 1, generator=torch.Generator().manual_seed(0)))
    brightness = 0.3 * noise * (truth.whole @ light)
    seen = sight_of(points, normals, directions, box_hiders()).weighted(sizes)
    found = seen.left(light_found(seen, brightness, torch.ones(len(directions), 3)))
    clear = torch.from_numpy(~hit_box(points.double().numpy(), np.array([[0.0, 0.0, 1.0]]))[:, 0])
    shaded = clear & (wanted[:, 0] < 0.7)
    assert int(shaded.sum()) > 20
    assert float((found - wanted)[clear].abs().mean()) < 0.015
    assert float((found - wanted)[shaded].mean().abs()) < 0.05
    assert float((1 - wanted)[shaded].mean()) > 0.3
    red, blue = (1 - found)[shaded].mean(dim=0)[[0, 2]].tolist()
    assert red > blue  # the box hides the warmer of the two


def test_pixels_are_told_what_points_are():
    """Rays that miss the object's bounding sphere are not traced, and nothing is lost."""
    points, (directions, sizes) = floor_points()[::7], light_directions()
    normals = torch.tensor([[0.0, 0.0, 1.0]]).repeat(len(points), 1)
    hiders, light = box_hiders(), known_light(directions)
    seen = sight_of(points, normals, directions, hiders).weighted(sizes)
    wanted = (seen.emptied - seen.whole) @ light
    found = blocked_light(points, normals, directions, light * sizes[:, None], hiders)
    torch.testing.assert_close(found, wanted, atol=5e-3, rtol=1e-2)
    assert float(wanted.max()) > 1
    away = replace(
        hiders, target=replace(hiders.target, centres=hiders.target.centres - torch.tensor([0, 0, 9]))
    )
    assert not blocked_light(points, normals, directions, light, away).any()


def test_surfels_get_all_of_the_light(world: GlossyWorld):
    """They get brighter by the share, but no brighter than is believed."""
    left = torch.full((len(world.part), 3), 0.5)
    left[world.part == OBJECT] = 0.01
    found = brightened(world.parameters, left)
    before, after = (
        [
            srgb_decode_tensor(BRIGHTEST * one.surfels[DIFFUSE].sigmoid()),
            srgb_decode_tensor(0.5 + SH_DC * one.surfels[COEFFICIENTS][:, 0]),
        ]
        for one in (world.parameters, found)
    )
    dim = torch.from_numpy(world.part == FLOOR)
    for was, now in zip(before, after, strict=True):
        torch.testing.assert_close(now[dim], 2 * was[dim], rtol=1e-3, atol=1e-4)
    dark = torch.from_numpy(world.part == OBJECT)
    torch.testing.assert_close(after[1][dark], before[1][dark] / LEAST_LEFT, rtol=1e-3, atol=1e-4)


def test_the_shadow_of_a_board_goes_from_surfels_and_photographs(world: GlossyWorld):
    """The floor is darkened as one lamp would, and is nearer to what it was."""
    directions, sizes = light_directions()
    parts = {name: torch.from_numpy(world.part == name) for name in (FLOOR, OBJECT)}
    target = surfels_of(world.parameters.take(parts[OBJECT]).surfels)
    others = surfels_of(world.parameters.take(~parts[OBJECT]).surfels)
    floor = others.centres[: int(parts[FLOOR].sum())]
    normals = torch.tensor([[0.0, 0.0, 1.0]]).repeat(len(floor), 1)
    seen = sight_of(floor, normals, directions, Hiders(target, others, SETTINGS.near * EXTENT))
    share = seen.weighted(sizes).left(known_light(directions))
    own = dict(world.parameters.surfels)
    for name, low, high in ((DIFFUSE, 0.0, BRIGHTEST), (COEFFICIENTS, 0.5, 0.0)):
        rows = slice(0, len(floor))
        own[name] = own[name].clone()
        if name == DIFFUSE:
            dim = srgb_decode_tensor(high * own[name][rows].sigmoid()) * share
            own[name][rows] = torch.logit(srgb_encode_tensor(dim) / high)
        else:
            dim = srgb_decode_tensor(low + SH_DC * own[name][rows, 0]) * share
            own[name][rows, 0] = (srgb_encode_tensor(dim) - low) / SH_DC
    shaded = replace(world, parameters=replace(world.parameters, surfels=own))
    left = shaded.parameters.take(~parts[OBJECT])
    found = without_shadow(target, left, shots_of_world(shaded), SETTINGS, EXTENT)
    wanted, before, after = (
        srgb_decode_tensor(BRIGHTEST * one.surfels[DIFFUSE][: len(floor)].sigmoid())
        for one in (world.parameters, left, found.parameters)
    )
    dark = share[:, 0] < 0.85
    assert int(dark.sum()) > 20
    was, now = ((wanted - one)[dark].abs().mean() for one in (before, after))
    assert now < 0.6 * was
    assert len(found.added) == len(world.cameras)
    assert all((one >= 0).all() for one in found.added)
    assert max(one.max() for one in found.added) > 0.02


def test_a_fit_without_the_shadow_is_another_and_repeats(scene: Path):
    """Through the method, whose first stage and picture with the object stay the same."""
    capture = open_capture(scene / "capture", check=False)
    priors, camera = told(scene, PriorSpec("oracle", 1, overrides=UNTOLD)), capture.test[0].camera
    settings = replace(QUICK, shadow=True)
    assert settings.first == QUICK.first
    fits = [GorisMethod().fit(capture, priors, one, 0, silent) for one in (QUICK, settings, settings)]
    plain, lit, again = (fit.remove(3).render(camera, ["radiance"])["radiance"] for fit in fits)
    np.testing.assert_array_equal(lit, again)
    assert np.isfinite(lit).all()
    assert not np.array_equal(lit, plain)
    before, after = (fit.render(camera, ["radiance"])["radiance"] for fit in fits[:2])
    np.testing.assert_array_equal(before, after)
