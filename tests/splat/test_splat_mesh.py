# SPDX-License-Identifier: Apache-2.0
"""Surfels that cover known surfaces: evenly, without holes, and facing along the normals."""

import numpy as np
import pytest
import torch
from scipy.spatial import ConvexHull, KDTree
from scipy.spatial.transform import Rotation

from graycard import Camera, look_at
from graycard.methods import splat


def sphere(count: int = 600) -> tuple[np.ndarray, np.ndarray]:
    """Vertices on the unit sphere and faces that turn counter-clockwise from outside."""
    turn = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    z = 1 - (2 * np.arange(count) + 1) / count
    across = np.sqrt(1 - z**2)
    vertices = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    faces = ConvexHull(vertices).simplices
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = (np.cross(b - a, c - a) * a).sum(axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces


PLANE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def view(origin: tuple[float, float, float]) -> Camera:
    return Camera.from_fov(64, 64, 45, look_at(np.array(origin), np.zeros(3)))


def silhouette(camera: Camera, shape: str, shrunk: float) -> np.ndarray:
    """Pixels whose centre sees the unit sphere, or the plane's square, scaled by ``shrunk``."""
    rays, origin = camera.rays(), camera.position
    if shape == "sphere":
        along = rays @ origin
        return along**2 - origin @ origin + shrunk**2 > 0
    hit = origin - rays * (origin[2] / rays[..., 2:])
    return (np.abs(hit[..., :2]) < shrunk).all(axis=-1)


@pytest.mark.parametrize("shape", ["sphere", "plane"])
@pytest.mark.parametrize("origin", [(0.5, -1.0, 3.2), (2.5, 2.0, 1.2)])
@pytest.mark.parametrize("count", [300, 1500])
def test_nothing_shines_through(shape: str, origin: tuple[float, float, float], count: int):
    vertices, faces = sphere() if shape == "sphere" else PLANE
    surfels = splat.surfels_from_mesh(vertices, faces, vertices, count, seed=1)
    camera = view(origin)
    alpha = splat.rasterize(surfels, camera).alpha.numpy()
    inside = silhouette(camera, shape, 0.9)  # at the rim of a plane there are no discs beyond
    assert inside.sum() > 150
    assert alpha[inside].min() > 0.99
    # Where a disc falls below 1/255, and two pixels of low-pass, which at a slant are 25 cm.
    reach = 3.4 * float(surfels.scales.max()) + 0.25
    assert alpha[~silhouette(camera, shape, 1 + reach)].max(initial=0) < 0.01


def test_as_many_as_asked_on_the_surface_facing_outward():
    vertices, faces = sphere()
    surfels = splat.surfels_from_mesh(vertices, faces, 2 * vertices, 777, seed=0)
    assert len(surfels) == 777
    centres = surfels.centres.numpy()
    np.testing.assert_allclose(np.linalg.norm(centres, axis=1), 1, atol=0.01)
    np.testing.assert_allclose(surfels.features, 2 * centres, atol=1e-6)
    normals = Rotation.from_quat(surfels.rotations.numpy(), scalar_first=True).apply([0, 0, 1])
    assert (normals * centres).sum(axis=1).min() > 0.99


def test_area_counts_not_the_number_of_faces():
    """A large triangle beside many small ones, of nine times their area."""
    large = np.array([[0.0, 0, 0], [3, 0, 0], [0, 3, 0]])
    fan = np.array([[np.cos(t), np.sin(t), 0] for t in np.linspace(0, np.pi / 2, 40)])
    small = np.array([10.0, 0, 0]) + np.concatenate([[[0, 0, 0]], fan * np.sqrt(2 / np.pi)])
    faces = np.concatenate([[[0, 1, 2]], [[3, 4 + i, 5 + i] for i in range(39)]])
    vertices = np.concatenate([large, small])
    surfels = splat.surfels_from_mesh(vertices, faces, vertices, 1000, seed=0)
    share = float((surfels.centres[:, 0] < 5).double().mean())
    assert share == pytest.approx(0.9, abs=0.02)  # the discs at the rim count for more on the small one


def test_both_sides_of_a_sheet_are_covered():
    """Two planes nearer to each other than the discs are large, facing away from each other."""
    vertices = np.concatenate([PLANE[0] + [0, 0, 0.002], PLANE[0] - [0, 0, 0.002]])
    faces = np.concatenate([PLANE[1], PLANE[1][:, ::-1] + 4])
    red_or_blue = np.repeat([[1.0, 0, 0], [0, 0, 1]], 4, axis=0)
    surfels = splat.surfels_from_mesh(vertices, faces, red_or_blue, 800, seed=0)
    for height, channel in ((3.0, 0), (-3.0, 2)):  # straight on: else order by centres mixes the sides
        pose = look_at(np.array([0, 0, height]), np.zeros(3), up=(0, 1, 0))
        camera = Camera.from_fov(64, 64, 45, pose)
        seen = splat.rasterize(surfels, camera).features.numpy()[silhouette(camera, "plane", 0.9)]
        assert seen[:, channel].min() > 0.98
        assert seen[:, 2 - channel].max() < 0.02


def test_seeds_decide():
    vertices, faces = sphere()
    first, again, other = (splat.surfels_from_mesh(vertices, faces, vertices, 99, s) for s in (5, 5, 6))
    assert torch.equal(first.centres, again.centres)
    assert not torch.equal(first.centres, other.centres)


def test_spread_points_keep_their_distance_and_leave_no_hole():
    points = np.random.default_rng(0).random((6000, 2))
    chosen = points[splat.spread_evenly(points, 500, seed=0)]
    assert len(chosen) == 500
    apart = KDTree(chosen).query(chosen, k=2)[0][:, 1].min()
    hole = KDTree(chosen).query(points)[0].max()
    random = points[:500]
    assert apart > 10 * KDTree(random).query(random, k=2)[0][:, 1].min()
    assert apart > 0.6 / np.sqrt(500)  # a square lattice has 1, a hexagonal one 1.07
    assert hole < 1.5 * apart


@pytest.mark.parametrize("points", [np.zeros((50, 3)), np.arange(40.0)[:, None].repeat(3, 1)])
def test_points_that_coincide_or_lie_on_a_line_are_spread_too(points: np.ndarray):
    chosen = splat.spread_evenly(points, 7, seed=0)
    assert len(set(chosen.tolist())) == 7
    assert splat.spread_evenly(points, 1000, 0).tolist() == list(range(len(points)))


@pytest.mark.parametrize(
    ("vertices", "faces", "features", "message"),
    [
        (PLANE[0][:, :2], PLANE[1], PLANE[0], r"vertices \(V, 3\)"),
        (PLANE[0], PLANE[1], PLANE[0][:3], "features"),
        (PLANE[0], PLANE[1] + 1, PLANE[0], "faces of vertices 0 to 3"),
        (PLANE[0], PLANE[1][:0], PLANE[0], "got 0 faces"),
        (PLANE[0] * 0, PLANE[1], PLANE[0], "faces without"),
        (PLANE[0] * np.nan, PLANE[1], PLANE[0], "finite vertices"),
    ],
)
def test_no_mesh(vertices: np.ndarray, faces: np.ndarray, features: np.ndarray, message: str):
    with pytest.raises(ValueError, match=message):
        splat.surfels_from_mesh(vertices, faces, features, 10, 0)


def test_one_point_is_no_surface():
    with pytest.raises(ValueError, match="2 or more points"):
        splat.surfels_on_surface(np.zeros((1, 3)), np.ones((1, 3)), np.zeros((1, 0)), 10, 0)
