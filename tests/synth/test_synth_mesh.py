# SPDX-License-Identifier: Apache-2.0
"""Meshes against closed forms: volume, closedness, normals."""

from collections.abc import Callable

import numpy as np
import pytest

from graycard.synth._mesh import Mesh, blob, box, lathe, merge, torus
from graycard.synth.families.props import _everyday as props
from graycard.synth.families.props import _toys as toys


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def volume(mesh: Mesh) -> float:
    """By the divergence theorem; negative if the faces point inwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def open_edges(mesh: Mesh) -> int:
    """Return the number of directed edges without their opposite, vertices at one place being one."""
    _, place = np.unique(np.round(mesh.vertices, 6), axis=0, return_inverse=True)
    f = place.reshape(-1)[mesh.faces]
    edges = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    edges = edges[edges[:, 0] != edges[:, 1]]
    balance: dict[tuple[int, int], int] = {}
    for a, b in edges.tolist():
        balance[min(a, b), max(a, b)] = balance.get((min(a, b), max(a, b)), 0) + (1 if a < b else -1)
    return sum(abs(v) for v in balance.values())


SHAPES: dict[str, Callable[[], Mesh]] = {
    "box": lambda: box((1.0, 0.6, 0.3), 0.02),
    "torus": lambda: torus(0.5, 0.2),
    "blob": lambda: blob(0.4, rng()),
    "vase": lambda: props.vase(rng(), 0.5, 0.3),
    "bottle": lambda: props.bottle(0.4, 0.08),
    "jar": lambda: props.jar(0.3, 0.1),
    "barrel": lambda: props.barrel(0.9, 0.3),
    "bowl": lambda: props.bowl(0.3),
    "crate": lambda: props.crate(0.5, 0.4, 0.3),
    "books": lambda: props.books(rng(), 3, 0.3),
    "shelf": lambda: props.shelf(1.5, 0.4, (0.3, 0.8)),
    "stool": lambda: props.stool(0.5, 0.2),
    "pipe": lambda: props.pipe(2.0, 0.05),
    "brick": lambda: toys.studded_brick(4, 2, 0.1),
    "ring tower": lambda: merge(toys.ring_tower(rng(), 4, 0.4)),
    "flower pot": lambda: toys.flower_pot(0.3, 0.15),
    "helmet": lambda: toys.helmet(0.2),
    "leaf": lambda: toys.leaf(0.3, 0.1, 1.0, 1.5),
    "plant": lambda: toys.plant(rng(), 5, 0.3),
}


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_are_closed_outward_and_finite(name: str) -> None:
    mesh = SHAPES[name]()
    assert open_edges(mesh) == 0
    assert volume(mesh) > 0
    assert mesh.faces.max() == len(mesh.vertices) - 1 or mesh.faces.max() < len(mesh.vertices)
    assert np.isfinite(mesh.vertices).all()
    assert np.isfinite(mesh.uv).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals[np.unique(mesh.faces)], axis=1), 1, atol=1e-6)


@pytest.mark.parametrize("name", SHAPES)
def test_normals_agree_with_the_faces(name: str) -> None:
    """Smooth normals stay on their side of every face, and bend away from it beside sharp edges only."""
    mesh = SHAPES[name]()
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    area = np.linalg.norm(face, axis=1)
    mean = np.sum([mesh.normals[mesh.faces[:, k]] for k in range(3)], axis=0)
    cosine = (face * mean).sum(-1) / (area * np.linalg.norm(mean, axis=1))
    assert (cosine > 0).all()
    assert area[cosine < np.cos(np.radians(10))].sum() < 0.15 * area.sum()


@pytest.mark.parametrize(
    "name", [n for n in SHAPES if n not in ("box", "torus", "blob", "pipe", "leaf", "plant")]
)
def test_props_stand_on_the_floor(name: str) -> None:
    assert SHAPES[name]().vertices[:, 2].min() == pytest.approx(0, abs=0.012)


def test_volumes() -> None:
    assert volume(box((1, 0.6, 0.3), 1e-6)) == pytest.approx(0.18, rel=1e-4)
    assert volume(torus(0.5, 0.2, 128)) == pytest.approx(2 * np.pi**2 * 0.5 * 0.04, rel=2e-3)
    assert volume(lathe([(0, 0), (0.5, 0), (0.5, 2), (0, 2)], 256)) == pytest.approx(np.pi / 2, rel=1e-3)


def test_torus_normals_point_away_from_the_tube() -> None:
    mesh = torus(0.5, 0.2, 96)
    middle = mesh.vertices * [1, 1, 0]
    middle *= 0.5 / np.linalg.norm(middle, axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.normals, (mesh.vertices - middle) / 0.2, atol=2e-3)


def test_a_large_bevel_is_cut_to_what_fits() -> None:
    assert volume(box((1, 1, 0.1), 5.0)) > 0.03


def test_moving_turns_scales_and_shifts() -> None:
    moved = box((2, 1, 1), 0.01).moved((5, 0, 0), turn=np.pi / 2, size=0.5)
    extent = np.ptp(moved.vertices, axis=0)
    np.testing.assert_allclose(extent, (0.5, 1, 0.5), atol=1e-9)
    assert moved.vertices[:, 0].mean() == pytest.approx(5)
    assert volume(moved) == pytest.approx(volume(box((2, 1, 1), 0.01)) / 8)


def test_tilting_keeps_the_shape() -> None:
    mesh = box((1, 2, 3), 0.01)
    assert volume(mesh.tilted(0.3)) == pytest.approx(volume(mesh))
    np.testing.assert_allclose(np.ptp(mesh.tilted(np.pi / 2).vertices, axis=0), (1, 3, 2), atol=1e-9)


def test_merged_meshes_keep_their_volumes() -> None:
    parts = [box((1, 1, 1)), torus(0.5, 0.2).moved((3, 0, 0))]
    assert volume(merge(parts)) == pytest.approx(sum(volume(p) for p in parts))


def test_blobs_follow_their_seed() -> None:
    assert np.array_equal(blob(0.3, rng()).vertices, blob(0.3, rng()).vertices)
    other = blob(0.3, np.random.default_rng(6))
    assert not np.allclose(blob(0.3, rng()).vertices, other.vertices)
