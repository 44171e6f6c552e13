# SPDX-License-Identifier: Apache-2.0
"""The tracer where it must agree with itself: order, sums, mirrors, images and cameras."""

from dataclasses import fields, replace

import numpy as np
import torch

from graycard import Camera, look_at
from graycard.methods import splat
from random_surfels import random_surfels
from traced_scenes import all_ways, assert_same, by_hand, facing, generator, given_by, grid, mixed, rays_of


def test_the_order_of_the_surfels_does_not_matter():
    surfels, rays = random_surfels(400, 13), mixed()
    order = torch.randperm(400, generator=generator(0))
    shuffled = splat.Surfels(*(getattr(surfels, field.name)[order] for field in fields(surfels)))
    assert_same(given_by("cpu", shuffled, rays), given_by("cpu", surfels, rays), 1e-6)


def test_features_superpose():
    surfels, rays = random_surfels(200, 14), mixed()
    other = torch.rand(200, 3, generator=generator(2), dtype=torch.float64)
    parts = [splat.trace_rays(surfels, rays, f).features for f in (surfels.features, other)]
    together = splat.trace_rays(surfels, rays, 2 * surfels.features - 3 * other).features
    torch.testing.assert_close(together, 2 * parts[0] - 3 * parts[1], atol=1e-5, rtol=0)


def test_an_opaque_wall_hides_what_is_behind():
    """Visibility of points on both sides of it, from a lamp: none or all, but for what the clamp lets by."""
    y, x = np.mgrid[-2:2:21j, -2:2:21j]
    wall = facing([0.0] * x.size, 1.0, 0.2)
    places = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    wall = replace(wall, centres=torch.from_numpy(places))
    r = np.random.default_rng(0)
    points = r.uniform([-1, -1, 0.1], [1, 1, 1.9], (300, 3)) * [1, 1, -1] ** r.integers(0, 2, (300, 1))
    lamp = np.array([0.1, 0.2, 2.0])
    seen = given_by("cpu", wall, rays_of(points, lamp - points)).transmittance
    behind = points[:, 2] < 0
    assert seen[behind].max() < 0.01
    assert behind.sum() > 100
    assert (seen[~behind] == 1).all()


def test_a_mirror_shows_what_the_mirrored_camera_sees():
    """Rays reflected at a plane meet what the camera behind the plane draws, to 40 dB or better.

    The discs lie across the view and apart, so that their centres' order is that of every ray.
    """
    count, r = 60, np.random.default_rng(15)
    surfels, turns = random_surfels(count, 15), np.array([1.0, 1, 0, 0]) + r.normal(0, 0.005, (count, 4))
    centres = np.stack([r.uniform(-1, 1, count), r.permutation(count) / 30 - 1, r.uniform(-1, 1, count)], 1)
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    wide = torch.from_numpy(r.uniform(0.15, 0.3, (count, 2)))
    surfels = replace(
        surfels, centres=torch.from_numpy(centres), rotations=torch.from_numpy(turns), scales=wide
    )
    K, eye = np.array([[60.0, 0, 30], [0, 60, 25], [0, 0, 1]]), np.array([0.3, -1.8, 0.2])
    camera = Camera(64, 48, K, look_at(eye, eye - [0, 1, 0]))
    rays = splat.camera_rays(camera, torch.float64)
    way = (-3 - rays.origins[:, 1:2]) / rays.directions[:, 1:2]  # to the mirror at y = -3
    flip = torch.tensor([1.0, -1, 1], dtype=torch.float64)
    reflected = splat.Rays(rays.origins + way * rays.directions, rays.directions * flip, rays.width)
    found = splat.trace_rays(surfels, reflected).features.reshape(48, 64, 3)
    K_flipped, pose = K * 1, camera.camera_to_world * 1
    K_flipped[0, 2] = 64 - K[0, 2]
    pose[1] *= -1
    pose[1, 3] -= 6
    pose[:3, 0] *= -1  # the picture of a mirrored camera is right-handed only when turned over
    drawn = splat.rasterize(surfels, Camera(64, 48, K_flipped, pose)).features.flip(1)
    assert 10 * torch.log10(1 / ((found - drawn) ** 2).mean()) > 40
    assert drawn.std() > 0.1


def test_an_image_is_its_rays_one_by_one():
    surfels, rays = random_surfels(300, 2), grid(21, 10)
    apart = splat.Rays(rays.origins, rays.directions)
    assert_same(given_by("cpu", surfels, rays), given_by("cpu", surfels, apart), 1e-6)


def test_rays_of_a_camera_go_through_its_pixels():
    K = np.array([[30.0, 0, 6.3], [0, 33, 4.8], [0, 0, 1]])
    camera = Camera(12, 10, K, look_at(np.array([0.2, -2.5, 0.3]), np.zeros(3)))
    rays = splat.camera_rays(camera, torch.float64)
    assert (rays.width, len(rays)) == (12, 120)
    points = camera.world_to_camera[:3, :3] @ rays.directions.numpy().T
    image = K @ (points / points[2])
    np.testing.assert_allclose(image[:2, 25], [1.5, 2.5])
    np.testing.assert_allclose(rays.origins.numpy(), np.tile(camera.position, (120, 1)))


def test_float32_comes_back_as_float32():
    surfels, rays = random_surfels(50), all_ways(40)
    single = splat.Surfels(*(getattr(surfels, f.name).float() for f in fields(surfels)))
    lines = splat.Rays(rays.origins.float(), rays.directions.float())
    found = splat.trace_rays(single, lines)
    assert {values.dtype for values in vars(found).values()} == {torch.float32}
    np.testing.assert_allclose(found.features, by_hand(surfels, rays).features, atol=1e-5)
