# SPDX-License-Identifier: Apache-2.0
"""Place of a flat glossy surface by its outlines, on surfels whose place is known."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from glossy_sheets import GlossyWorld, glossy_world, shots_of_world
from graycard import Camera, look_at
from graycard.methods.goris import GorisSettings, _flat
from graycard.methods.goris._flat import _Outline, agreement, flat_surface
from graycard.methods.goris._training_views import TrainingView
from graycard.methods.splat import CENTRES
from graycard.methods.surfels import plane_depth, sparse_start
from rooms_in_files import all_in_files
from sparse_points import with_points

UP = np.array([0.0, 0.0, 1.0])
POINTS = np.array([[0.0, 0.0, -0.4], [0.0, 0.0, 0.6]])
"""Between which heights are looked for: the floor is at 0."""


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


def from_above(world: GlossyWorld) -> GlossyWorld:
    """With cameras that see where the floor ends."""
    places = [(3.2, 0.6), (0.4, -3.4), (-3.3, -0.5), (-0.7, 3.1), (2.3, 2.2)]
    eyes = [look_at(np.array([x, y, 2.4]), np.zeros(3)) for x, y in places]
    return replace(world, cameras=[Camera.from_fov(88, 72, 45, eye) for eye in eyes])


def leaning(shots: list[TrainingView], degrees: float) -> list[TrainingView]:
    """With normals that lean by so much, each another way."""
    random, changed = torch.Generator().manual_seed(1000), []
    for shot in shots:
        way = 2 * torch.pi * torch.rand(shot.glossy.shape, generator=random)
        sine, cosine = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
        normal = torch.stack([sine * way.cos(), sine * way.sin(), torch.full_like(way, cosine)], dim=-1)
        changed.append(replace(shot, normal=normal))
    return changed


def test_the_floor_is_found_where_it_is(world: GlossyWorld):
    """Though boards on it hide parts of it, and mirrored boards are in its pictures."""
    shots = shots_of_world(from_above(world))
    found = flat_surface(shots, POINTS)
    assert found is not None
    for shot, depth in zip(shots, found.depths, strict=True):
        true = plane_depth(shot.photograph.camera, np.array([0.0, 0.0, 1.0, 0.0]))
        told = np.isfinite(depth)
        assert told.sum() > 0.9 * float(shot.glossy.sum())
        assert not (told & (shot.glossy.numpy() < 0.5)).any()
        assert np.abs(depth / true - 1)[told].max() < 0.03


def test_outlines_agree_best_at_their_height(world: GlossyWorld):
    """To half a pixel, which is 0.03 here; what is lost is at rims."""
    cameras = world.cameras
    outlines = []
    for camera in cameras:
        depth = plane_depth(camera, np.append(UP, -0.2))
        at = camera.unproject(np.nan_to_num(depth))
        outlines.append(_Outline(camera, np.isfinite(depth) & (np.abs(at[..., :2]) < 0.3).all(axis=-1)))
    heights = np.linspace(-0.3, 0.7, 101)
    agree = [agreement(outlines, UP, height) for height in heights]
    assert abs(heights[int(np.argmax(agree))] - 0.2) < 0.031
    assert max(agree) > 0.85
    assert agree[0] < 0.3 > agree[-1]
    assert agreement([_Outline(one.camera, np.zeros_like(one.inside)) for one in outlines], UP, 0.2) == 0


def test_what_is_not_flat_or_not_told_is_left_to_stereo(world: GlossyWorld):
    assert flat_surface(shots_of_world(world), POINTS) is None  # a floor that fills the pictures
    shots = shots_of_world(from_above(world))
    assert flat_surface(leaning(shots, 10), POINTS) is not None
    assert flat_surface(leaning(shots, 40), POINTS) is None
    assert flat_surface([replace(shot, normal=None) for shot in shots], POINTS) is None
    assert flat_surface([replace(shot, told=False) for shot in shots], POINTS) is None
    assert flat_surface([replace(shot, glossy=0 * shot.glossy) for shot in shots], POINTS) is None
    assert flat_surface(shots, POINTS + 5 * UP) is None
    up = torch.from_numpy(UP).float().expand(*shots[0].glossy.shape, 3)
    torn = [replace(one, normal=up, glossy=torch.zeros_like(one.glossy)) for one in shots]
    for number, one in enumerate(torn):
        one.glossy[:6, 6 * number : 6 * number + 6] = 1
    assert flat_surface(torn, POINTS) is None


@pytest.mark.parametrize(("curvature", "flat"), [(0.02, True), (0.12, False)])
def test_normals_that_turn_with_the_place_are_of_a_curved_surface(
    world: GlossyWorld, curvature: float, flat: bool
):
    """Though no normal is farther from the common one than errors of a prior's."""
    shots = shots_of_world(from_above(world))
    for number, shot in enumerate(shots):
        camera = shot.photograph.camera
        at = camera.unproject(plane_depth(camera, np.append(UP, 0.0)))
        normal = np.stack([curvature * at[..., 0], curvature * at[..., 1], np.ones(at.shape[:2])], axis=-1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        shots[number] = replace(shot, normal=torch.from_numpy(np.nan_to_num(normal)).float())
    assert (flat_surface(shots, POINTS) is not None) == flat


@pytest.mark.parametrize("seed", range(5))
def test_the_turn_is_that_of_a_fit_to_all_pixels(seed: int):
    random = np.random.default_rng(seed)
    common = random.normal(size=3) / 3
    common /= np.linalg.norm(common)
    camera, shape = from_above(glossy_world()).cameras[0], (72, 88)
    depths = [np.where(random.random(shape) > 0.5, random.uniform(1, 5, shape), np.nan) for _ in range(3)]
    told = [
        _flat._Told(common + random.normal(0, 0.1, (*shape, 3)), *np.ones((2, *shape), bool)) for _ in depths
    ]
    outlines = [_Outline(camera, np.ones(shape, bool))] * len(depths)
    seen = [np.isfinite(depth) for depth in depths]
    places = np.concatenate([camera.unproject(d)[s] for d, s in zip(depths, seen, strict=True)])
    normals = np.concatenate([one.normal[s] for one, s in zip(told, seen, strict=True)])
    along = np.linalg.svd(common[None])[2][1:]
    place = (places - places.mean(axis=0)) @ along.T
    lean = (normals - normals.mean(axis=0)) @ along.T
    fitted = place @ np.linalg.lstsq(place, lean, rcond=None)[0]
    wanted = np.degrees(np.sqrt((fitted**2).sum(axis=1).mean()))
    assert _flat._turn(outlines, depths, told, common) == pytest.approx(wanted, rel=1e-9)


def test_a_flat_mirror_is_the_same_where_views_lie_in_files(
    world: GlossyWorld, monkeypatch: pytest.MonkeyPatch
):
    shots = shots_of_world(from_above(world))
    usual = flat_surface(shots, POINTS)
    files = all_in_files(monkeypatch)
    found = flat_surface(shots, POINTS)
    assert usual is not None
    assert found is not None
    assert files.count(len(shots)) == 3, "each component of the normals of all views in a file"
    assert np.array_equal(found.normal, usual.normal)
    assert np.array_equal(found.mirrors, usual.mirrors)
    assert np.array_equal(found.depths, usual.depths, equal_nan=True)


def test_what_faces_other_ways_is_not_glossy(world: GlossyWorld):
    """A glazed jar on a table; what normals are not known of is left as it is."""
    shots = shots_of_world(from_above(world))
    sideways, unknown = torch.tensor([1.0, 0.0, 0.0]), torch.zeros(3)
    for shot in shots:
        assert shot.normal is not None
        shot.glossy[:5] = 1
        shot.normal[:5, :10], shot.normal[:5, 10:] = sideways, unknown
    found = flat_surface(shots, POINTS)
    assert found is not None
    for shot, alone in zip(shots, found.alone(shots), strict=True):
        assert (alone.glossy[:5, :10] == 0).all()
        assert (alone.glossy[:5, 10:] == 1).all()
        assert shot.normal is not None
        up = shot.normal[..., 2] > 0.99
        assert torch.equal(alone.glossy[up], shot.glossy[up])


def test_a_flat_mirror_has_one_normal(world: GlossyWorld):
    """In place of a prior's, whose errors of 4 degrees differ from pixel to pixel; they stay elsewhere."""
    shots, draw = shots_of_world(from_above(world)), torch.Generator().manual_seed(1000)
    for number, shot in enumerate(shots):
        assert shot.normal is not None
        off = 0.05 * torch.randn(shot.normal.shape, generator=draw)
        shots[number] = replace(shot, normal=torch.nn.functional.normalize(shot.normal + off, dim=-1))
    found = flat_surface(shots, POINTS)
    assert found is not None
    np.testing.assert_allclose(found.normal, UP, atol=0.005)
    for shot, alone in zip(shots, found.alone(shots), strict=True):
        assert alone.normal is not None
        assert shot.normal is not None
        mirror = alone.glossy > 0
        assert (alone.normal[mirror] == torch.from_numpy(found.normal).float()).all()
        assert torch.equal(
            alone.normal[~mirror & (shot.glossy == 0)], shot.normal[~mirror & (shot.glossy == 0)]
        )


@pytest.mark.parametrize(
    ("best", "far", "believed"),
    [
        (0.80, 0.77, True),
        (0.98, 0.973, True),  # a third more is wrong
        (0.97, 0.964, False),
        (0.69, 0.10, False),
    ],
)
def test_a_height_is_believed_if_others_are_worse(
    best: float, far: float, believed: bool, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(_flat, "agreement", lambda _, __, at: best if abs(at - 0.3) < 0.03 else far)
    found = _flat._height([], UP, np.array([-0.4, 0.6]))
    assert (found is not None) == believed
    assert found is None or abs(found - 0.3) < 0.03


def test_surfels_begin_on_depths_that_are_known(write_tiny: Callable[..., Path], tmp_path: Path):
    """Stereo gives the places of others."""
    folder = write_tiny(tmp_path, track="tabletop", train=4, test=1)
    capture = with_points(folder)
    settings = GorisSettings(surfels=800)
    size = capture.train[0].camera.height, capture.train[0].camera.width
    known = [np.full(size, np.nan) for _ in capture.train]
    by_stereo = sparse_start(capture, settings, 0).surfels[CENTRES]
    assert torch.equal(sparse_start(capture, settings, 0, known).surfels[CENTRES], by_stereo)
    known[0][:] = 0.7
    some = sparse_start(capture, settings, 0, known).surfels[CENTRES]
    each = len(some) // len(known)
    assert torch.equal(some[each:], by_stereo[each:])
    _, depth = capture.train[0].camera.project(some[:each].double().numpy())
    np.testing.assert_allclose(depth, 0.7, rtol=1e-5)
