# SPDX-License-Identifier: Apache-2.0
"""Angles of normals against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import graycard.eval as ge
from graycard.eval.measures._pixelwise import Pixelwise, angle_errors

RNG = np.random.default_rng(2)


def directions(count: int) -> np.ndarray:
    v = RNG.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@pytest.mark.parametrize("degrees", [0, 1e-7, 0.01, 30, 60, 89.999, 90, 135, 179.99999, 180])
def test_known_angles(degrees: float) -> None:
    a = np.radians(degrees)
    p, t = np.array([np.cos(a), np.sin(a), 0]), np.array([1.0, 0, 0])
    assert ge.angles(p, t) == pytest.approx(degrees, rel=1e-9, abs=1e-13)


def test_identity_is_exactly_zero_in_float32_too() -> None:
    t = directions(1000).astype(np.float32)
    assert (ge.angles(t, t) == 0).all()
    arc_cosine = np.degrees(np.arccos(np.clip((t * t).sum(-1), -1, 1)))
    assert arc_cosine.mean() > 1e-3, "what the arc cosine would have cost"


def test_a_flipped_normal_is_180_degrees() -> None:
    t = directions(50)
    assert ge.angles(-t, t) == pytest.approx(np.full(50, 180.0), abs=1e-6)


@given(st.floats(1e-200, 1e200))
def test_length_does_not_matter(length: float) -> None:
    p, t = directions(20), directions(20)
    assert ge.angles(p * length, t) == pytest.approx(ge.angles(p, t), abs=1e-9)


def test_rotation_does_not_matter() -> None:
    p, t = directions(50), directions(50)
    turn, _ = np.linalg.qr(RNG.normal(size=(3, 3)))
    assert ge.angles(p @ turn, t @ turn) == pytest.approx(ge.angles(p, t), abs=1e-10)


def test_it_agrees_with_the_chord() -> None:
    p, t = directions(200), directions(200)
    chord = np.degrees(2 * np.arcsin(np.linalg.norm(p - t, axis=-1) / 2))
    assert ge.angles(p, t) == pytest.approx(chord, abs=1e-6)


def test_a_vector_of_length_zero_is_no_perfect_prediction() -> None:
    assert ge.angles(np.zeros((4, 3)), directions(4)).tolist() == [90.0] * 4
    assert ge.angles(directions(20_000), directions(20_000)).mean() == pytest.approx(90, abs=1)


def test_mean_and_median_are_over_the_mask_only() -> None:
    t = np.broadcast_to([0.0, 0, 1], (2, 3, 3))
    p = t.copy()
    p[0] = [1, 0, 0]
    p[1, 0] = [0, 1, 1]
    mask = np.array([[True, False, False], [True, True, True]])
    assert Pixelwise(angle_errors, np.mean)(p, t, mask) == pytest.approx((90 + 45) / 4)
    assert Pixelwise(angle_errors, np.median)(p, t, mask) == pytest.approx(22.5)


@pytest.mark.parametrize("shape", [(4, 3), (5, 2)])
def test_shapes_that_do_not_fit(shape: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="expected two fields of vectors"):
        ge.angles(np.zeros(shape), np.zeros((5, shape[1])))
