# SPDX-License-Identifier: Apache-2.0
"""The tracer's parts: the tree of boxes and the masks of comparisons."""

from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest
import torch

from graycard.methods import splat
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.trace import _bvh_kernels
from graycard.methods.splat.trace import _masks as masks
from random_surfels import random_surfels
from traced_scenes import all_ways, side_by_side


def test_a_tree_serves_more_than_once():
    surfels, rays = random_surfels(200, 2), all_ways(60)
    tree = splat.build_bvh(surfels)
    for lines in (rays, side_by_side(30)):
        again, anew = splat.trace_rays(surfels, lines, bvh=tree), splat.trace_rays(surfels, lines)
        assert torch.equal(again.features, anew.features)
    moved = replace(surfels, centres=surfels.centres + 1e-3)
    with pytest.raises(ValueError, match="others .in their centres."):
        splat.trace_rays(moved, rays, bvh=tree)
    with pytest.raises(ValueError, match="others .in their centres."):
        splat.trace_rays(random_surfels(3), rays, bvh=tree)


def test_neighbours_on_the_curve_are_neighbours_in_space():
    """Over the 512 cubes of the coarsest three levels, each of which the curve fills before it leaves."""
    cubes = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    keys = [_bvh_kernels.curve_key.py_func(*(int(k) << 7 for k in cube)) >> 21 for cube in cubes]
    np.testing.assert_array_equal(np.sort(keys), np.arange(512))
    steps = np.abs(np.diff(cubes[np.argsort(keys)], axis=0)).sum(axis=1)
    np.testing.assert_array_equal(steps, 1)


@pytest.mark.parametrize("count", [0, 1, 16, 17, 256, 257, 5000])
def test_boxes_hold_what_is_below_them(count: int):
    surfels = random_surfels(count, 3, 1)
    tree = splat.build_bvh(surfels).tree
    np.testing.assert_array_equal(np.sort(tree.order[tree.order >= 0]), np.arange(count))
    groups = tree.boxes.reshape(-1, 6, 16)
    for level, first in enumerate(tree.levels[:-1]):
        children = groups[first : tree.levels[level + 1]]
        parents = groups[tree.levels[level + 1] :].transpose(0, 2, 1).reshape(-1, 6)[: len(children)]
        np.testing.assert_array_equal(parents[:, :3], children[:, :3].min(axis=2))
        np.testing.assert_array_equal(parents[:, 3:], children[:, 3:].max(axis=2))


@numba.njit
def bits(a: Any, b: Any) -> tuple[int, int]:
    mask = masks.mask_at_least(simd.load(a, 0), simd.load(b, 0))
    return mask, masks.lowest_bit(mask)


def test_masks_are_the_comparisons():
    a = np.array([0, 1, -np.inf, np.nan, 2, 2, np.inf, 0] * 2, np.float32)
    b = np.array([1, 1, np.inf, 0, np.nan, 1, np.inf, -0.0] * 2, np.float32)
    expected = int(sum(1 << lane for lane in range(16) if a[lane] >= b[lane]))
    assert bits(a, b) == (expected, 1)
    assert bits(b, b)[0] == 0xFFFF - (1 << 4) - (1 << 12)


def test_masks_of_other_types_are_refused():
    @numba.njit
    def wrong(x: float) -> int:
        return masks.mask_at_least(x, x)

    with pytest.raises(numba.TypingError, match="expected float32x16 in both places"):
        wrong(1.0)
