# SPDX-License-Identifier: Apache-2.0
"""Large arrays of a backward pass are used again, and what they held before changes no gradient."""

from collections import deque
from dataclasses import fields

import numpy as np
import pytest
import torch

from graycard import Camera, look_at
from graycard.methods import splat
from graycard.methods.splat.raster import _idle, _stages
from graycard.methods.splat.raster._blocks import LANES
from graycard.methods.splat.raster._stage_arrays import Slots, vectors
from graycard.methods.splat.raster._stages import NARROW
from random_surfels import random_surfels


@pytest.fixture
def idle(monkeypatch: pytest.MonkeyPatch) -> "deque[np.ndarray]":
    """Keep arrays of any size; none at first."""
    kept: deque[np.ndarray] = deque(maxlen=2)
    monkeypatch.setattr(_idle, "LEAST", 64)
    monkeypatch.setattr(_idle, "_idle", kept)
    return kept


def slots(pairs: int) -> Slots:
    return Slots(_idle.borrowed(pairs, LANES), _idle.borrowed(pairs, LANES), LANES)


def gradients(channels: int, *, shaped: bool) -> dict[str, torch.Tensor]:
    """Draw discs, all maps or the features alone, and return the gradients of their sum."""
    K = np.array([[30, 0, 18.8], [0, 33, 14.3], [0, 0, 1]])
    camera = Camera(37, 29, K, look_at(np.array([0.2, -2.5, 0.3]), np.zeros(3)))
    surfels = random_surfels(400, 2)
    features = torch.linspace(-1, 1, 400 * channels, dtype=torch.float64).reshape(400, channels)
    leaves = {field.name: getattr(surfels, field.name) for field in fields(surfels)} | {"features": features}
    for leaf in leaves.values():
        leaf.requires_grad_()
    draw = splat.rasterize if shaped else splat.rasterize_features
    maps = draw(surfels, camera, features, backend="cpu")
    torch.stack([getattr(maps, field.name).sum() for field in fields(maps)]).sum().backward()
    return {name: leaf.grad for name, leaf in leaves.items() if leaf.grad is not None}


@pytest.mark.parametrize("shaped", [True, False])
@pytest.mark.parametrize("channels", [3, 8, 16])
def test_gradients_are_the_same_in_arrays_that_were_used_before(
    channels: int, shaped: bool, idle: "deque[np.ndarray]"
):
    first = gradients(channels, shaped=shaped)
    rooms = list(idle)
    assert len(rooms) == (2 if shaped or channels > NARROW else 1)
    for room in rooms:
        room.fill(np.nan)
    again = gradients(channels, shaped=shaped)
    assert all(room is kept for room, kept in zip(rooms, idle, strict=True))
    assert not any(np.isnan(room).all() for room in rooms)
    assert len(first) == 5
    assert first["centres"].abs().sum() > 0
    assert all(torch.equal(first[name], again[name]) for name in first)


def test_smaller_rows_fit_and_larger_ones_get_a_new_array(idle: "deque[np.ndarray]"):
    first = slots(9)
    assert not np.shares_memory(first.geometry, first.channels)
    _idle.give_back(first)
    smaller = slots(4)
    assert np.shares_memory(smaller.geometry, first.geometry)
    assert not np.shares_memory(smaller.geometry, smaller.channels)
    _idle.give_back(smaller)
    larger = slots(20)
    assert not any(np.shares_memory(larger.geometry, room) for room in (first.geometry, first.channels))
    assert (larger.geometry.shape, larger.geometry.ctypes.data % 64) == ((20, LANES), 0)
    assert not idle


def test_rows_that_are_held_are_not_lent(idle: "deque[np.ndarray]"):
    first, second = slots(9), slots(9)
    assert not np.shares_memory(first.geometry, second.geometry)
    _idle.give_back(first)
    third = slots(9)
    assert np.shares_memory(third.geometry, first.geometry)
    assert not any(np.shares_memory(third.geometry, rows) for rows in (second.geometry, second.channels))


def test_rows_that_are_given_back_twice_are_lent_once(idle: "deque[np.ndarray]"):
    first = slots(9)
    _idle.give_back(first)
    _idle.give_back(first)
    second = slots(9)
    assert not np.shares_memory(second.geometry, second.channels)


def test_idle_arrays_go_before_a_drawing_is_refused(
    idle: "deque[np.ndarray]", monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(_stages, "UNCHECKED", 0)
    monkeypatch.setattr(_stages, "free_memory", lambda: 1 if idle else 1 << 40)
    _idle.give_back(slots(9))
    gradients(3, shaped=True)  # is not refused


def test_small_arrays_are_left_to_the_library(idle: "deque[np.ndarray]", monkeypatch: pytest.MonkeyPatch):
    _idle.give_back(slots(9))
    monkeypatch.setattr(_idle, "LEAST", 1 << 20)
    slots(4)
    _idle.give_back(Slots(vectors(9, LANES), None, 0))
    assert len(idle) == 2
