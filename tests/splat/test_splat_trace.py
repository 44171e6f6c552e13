# SPDX-License-Identifier: Apache-2.0
"""The tracer: the engine and its specification against a third opinion."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from graycard.methods import splat
from random_surfels import random_surfels
from traced_scenes import (
    BACKENDS,
    CASES,
    RAYS,
    SURFELS,
    Answer,
    assert_same,
    by_hand,
    facing,
    given_by,
    gradients,
    in_a_row,
    mixed,
    rays_of,
)


@pytest.mark.parametrize(("surfels", "rays"), CASES)
def test_values_are_those_found_by_hand(surfels: str, rays: str):
    scene, lines = SURFELS[surfels](), RAYS[rays]()
    truth = by_hand(scene, lines)
    assert_same(given_by("reference", scene, lines), truth, 1e-9)
    assert_same(given_by("cpu", scene, lines), truth, 1e-5)


@pytest.mark.parametrize("rays", ["all ways", "side by side", "image", "mixed"])
def test_scenes_are_not_empty(rays: str):
    """Else the comparisons would compare nothing with nothing."""
    assert (by_hand(SURFELS["dense"](), RAYS[rays]()).transmittance < 0.5).mean() > 0.3


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("channels", [0, 1, 2, 4, 19, 20, 40])
def test_any_number_of_channels(channels: int, backend: splat.Backend):
    surfels, rays = random_surfels(150, 1, channels), mixed()
    assert_same(given_by(backend, surfels, rays), by_hand(surfels, rays), 1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_one_disc(backend: splat.Backend):
    """Met one standard deviation aside, at an angle: opacity times exp(-1/2), at the plane's distance."""
    surfels, way = facing([2.0], 0.8, 0.5), np.array([[0.6, 0, 0.8]])
    rays = rays_of(np.array([[0.5, 0, 2]]) - 3 * way, way)
    found = given_by(backend, surfels, rays)
    assert found.transmittance[0] == pytest.approx(1 - 0.8 * np.exp(-0.5), abs=1e-6)
    assert found.depth[0] == pytest.approx(3, abs=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_alpha_is_clamped_and_cut(backend: splat.Backend):
    lines = rays_of(np.zeros((1, 3)), np.array([[0.0, 0, 1]]))
    opaque, just, faint = (facing([1.0], value) for value in (1.0, 1.001 / 255, 0.999 / 255))
    assert given_by(backend, opaque, lines).transmittance[0] == pytest.approx(0.01, abs=1e-7)
    assert given_by(backend, just, lines).transmittance[0] == pytest.approx(1 - 1.001 / 255, abs=1e-6)
    assert given_by(backend, faint, lines).transmittance[0] == 1


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ray_ends_behind_the_disc_that_blocks_it(backend: splat.Backend):
    """Discs of 0.98 leave 4e-4 after two and 8e-6 after three: the fourth is not looked at, nor any
    behind."""
    surfels = facing([5.0, 4, 3, 2, 1], 0.98)
    one_hot = replace(surfels, features=torch.eye(5, dtype=torch.float64))
    rays = rays_of(np.zeros((16, 3)), np.tile([0.0, 0, 1], (16, 1)))
    found = given_by(backend, one_hot, rays)
    np.testing.assert_allclose(found.features, [[0, 0, 0.98 * 4e-4, 0.98 * 0.02, 0.98]] * 16, rtol=1e-3)
    np.testing.assert_allclose(found.transmittance, 8e-6, rtol=1e-3)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("near", [0.0, 1e-4, 0.5, 1.5])
def test_what_is_too_near_is_not_met(near: float, backend: splat.Backend):
    """The first of three discs holds the origins."""
    surfels = facing([0.0, 1.0, 2.0])
    rays = rays_of(np.array([[0.1, 0.2, 0], [0, 0, 0]]), np.array([[0.1, 0, 1], [0, 0, 1]]))
    found = given_by(backend, surfels, rays, near=near)
    np.testing.assert_array_equal(found.transmittance > 0.4, near > 1)  # one disc left, not two
    assert_same(found, by_hand(surfels, rays, near), 1e-6)
    assert_same(given_by(backend, facing([0.0]), rays), Answer(np.zeros((2, 1)), np.ones(2), np.zeros(2)), 0)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_lies_behind_the_end_is_not_met(backend: splat.Backend):
    surfels = facing([1.0, 2.0, 3.0])
    rays = rays_of(np.zeros((4, 3)), np.tile([0.0, 0, 1], (4, 1)))
    rays = replace(rays, far=torch.tensor([0.0, 1.5, 2.5, torch.inf], dtype=torch.float64))
    found = given_by(backend, surfels, rays)
    np.testing.assert_allclose(found.transmittance, [1, 0.5, 0.25, 0.125], rtol=1e-6)
    np.testing.assert_allclose(found.depth, [0, 1, 4 / 3, 11 / 7], rtol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_equal_distances_are_taken_by_index(backend: splat.Backend):
    one_hot = replace(facing([1.0] * 4), features=torch.eye(4, dtype=torch.float64))
    rays = rays_of(np.zeros((3, 3)), np.array([[0.0, 0, 1], [0, 0, 1], [0, 0, -1]]))
    expected = [[0.5, 0.25, 0.125, 0.0625]] * 2 + [[0.0] * 4]
    np.testing.assert_allclose(given_by(backend, one_hot, rays).features, expected, atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("spread", [0.01, 0.3])
def test_equal_distances_are_taken_by_index_wherever_they_lie(spread: float, backend: splat.Backend):
    """Discs all over one plane, which the tree has in another order; rays across it, side by side or not."""
    count, r = 60, np.random.default_rng(30)
    places = np.concatenate([r.uniform(-0.4, 0.4, (count, 2)), np.ones((count, 1))], axis=1)
    plane = facing([1.0] * count, 0.1, 0.5)
    plane = replace(plane, centres=torch.from_numpy(places), features=torch.eye(count, dtype=torch.float64))
    origins = np.concatenate([r.uniform(-spread, spread, (16, 2)), np.zeros((16, 1))], axis=1)
    found = given_by(backend, plane, rays_of(origins, np.tile([0.0, 0, 1], (16, 1))))
    square = ((origins[:, None, :2] - places[:, :2]) ** 2).sum(axis=2) / 0.5**2
    alpha = 0.1 * np.exp(-square / 2)
    before = np.cumprod(np.concatenate([np.ones((16, 1)), 1 - alpha], axis=1), axis=1)
    np.testing.assert_allclose(found.features, alpha * before[:, :-1], atol=1e-5)
    assert alpha.min() > 1.1 / 255


@pytest.mark.parametrize("rays", ["beam", "single"])
def test_more_hits_than_there_is_room_for_at_first(rays: str):
    """All of 900 discs count: the rows outgrow their memory, several times."""
    surfels, r = in_a_row(900), np.random.default_rng(0)
    ways = r.normal([0, 0, 1], 0.002 if rays == "beam" else 0.3, (16, 3))
    lines = rays_of(np.zeros((16, 3)), ways)
    truth = by_hand(surfels, lines)
    assert_same(given_by("cpu", surfels, lines), truth, 1e-5)
    assert truth.transmittance.max() < 0.05


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_along_a_disc_do_not_meet_it(backend: splat.Backend):
    surfels = facing([0.0, 0.0, 1.0])
    ways = np.array([[1.0, 0, 0], [0, -1, 0], [0.6, 0.8, 0]])
    rays = rays_of(-0.2 * ways, ways)
    found = given_by(backend, surfels, rays)
    assert (found.transmittance == 1).all()
    assert all(g.isfinite().all() for g in gradients(surfels, rays, backend).values())


@settings(max_examples=25, deadline=None)
@given(
    count=st.integers(0, 60),
    scale=st.floats(0.01, 3),
    seed=st.integers(1000, 9999),
    spread=st.sampled_from([0.0, 0.01, 0.3, 3]),
    rays=st.integers(1, 40),
)
def test_any_scene(count: int, scale: float, seed: int, spread: float, rays: int):
    """Rays about one direction, from a common origin, spread from not at all to all ways."""
    r = np.random.default_rng(seed)
    surfels = random_surfels(count, seed, 2, scale)
    origin, way = r.uniform(-2, 2, 3), r.normal(size=3)
    lines = rays_of(np.tile(origin, (rays, 1)), way + spread * r.normal(size=(rays, 3)))
    assert_same(given_by("cpu", surfels, lines), by_hand(surfels, lines), 3e-5)
