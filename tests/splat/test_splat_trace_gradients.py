# SPDX-License-Identifier: Apache-2.0
"""The gradients of the tracer: those of the specification, and the specification's against differences."""

from dataclasses import fields, replace

import numba
import numpy as np
import pytest
import torch

from graycard.methods import splat
from graycard.methods.splat.trace import _cpu as _trace_cpu
from random_surfels import random_surfels
from traced_scenes import (
    CASES,
    RAYS,
    SURFELS,
    all_ways,
    facing,
    generator,
    gradients,
    joined,
    mixed,
    rays_of,
    side_by_side,
)


@pytest.mark.parametrize(("surfels", "rays"), CASES)
def test_gradients_are_those_of_the_specification(surfels: str, rays: str):
    """Within 1e-3 of the length of the gradient as a whole (1e-5 is usual)."""
    scene, lines = SURFELS[surfels](), RAYS[rays]()
    truth = gradients(scene, lines, "reference")
    for name, got in gradients(scene, lines, "cpu").items():
        assert (got - truth[name]).norm() <= 1e-3 * truth[name].norm() + 1e-9, name


@pytest.mark.parametrize("channels", [0, 1, 4, 19, 20, 40])
@pytest.mark.parametrize("rays", ["all ways", "side by side"])
def test_gradients_of_any_number_of_channels(channels: int, rays: str):
    surfels, lines = random_surfels(60, 9, channels, 0.3), RAYS[rays]()
    truth = gradients(surfels, lines, "reference")
    for name, got in gradients(surfels, lines, "cpu").items():
        assert (got - truth[name]).norm() <= 1e-4 * truth[name].norm(), name


def test_gradients_of_the_specification_are_differences_of_its_values():
    """Between thresholds: the discs are wide enough for the lists of hits to stay as they are."""
    surfels = replace(
        facing([1.0, 1.5, 2.2], 0.7, 0.6), features=torch.rand(3, 2, generator=generator(0)).double()
    )
    turns = torch.nn.functional.normalize(surfels.rotations + 0.2 * random_surfels(3, 2).rotations, dim=1)
    surfels = replace(surfels, rotations=turns)
    rays = rays_of(np.array([[0.1, 0, 0], [-0.1, 0.2, 0.1]]), np.array([[0.1, 0.1, 1], [0, -0.2, 1]]))

    def traced(*leaves: torch.Tensor) -> tuple[torch.Tensor, ...]:
        found = splat.trace_rays(
            splat.Surfels(*leaves[:5]), splat.Rays(leaves[5], leaves[6]), backend="reference"
        )
        return found.features, found.transmittance, found.depth

    leaves = [getattr(surfels, field.name) for field in fields(surfels)] + [rays.origins, rays.directions]
    assert torch.autograd.gradcheck(traced, [leaf.clone().requires_grad_() for leaf in leaves], eps=1e-6)


def test_what_was_not_kept_is_found_again(monkeypatch: pytest.MonkeyPatch):
    """To the same bits: packets of which all is kept, some that met more, and nothing."""
    surfels, rays, found = random_surfels(300, 2), mixed(), []
    for kept in (_trace_cpu.KEPT, 60, 0):
        monkeypatch.setattr(_trace_cpu, "KEPT", kept)
        found.append(gradients(surfels, rays, "cpu"))
    for name, first in found[0].items():
        assert all(torch.equal(first, other[name]) for other in found[1:]), name


def test_sums_in_one_part_are_the_same(monkeypatch: pytest.MonkeyPatch):
    """One part is used with more surfels than the memory allows for several."""
    surfels, rays = random_surfels(300, 2), all_ways(900)
    several = gradients(surfels, rays, "cpu")
    monkeypatch.setattr(_trace_cpu, "SUMS_BYTES", 1)
    for name, got in gradients(surfels, rays, "cpu").items():
        assert (got - several[name]).norm() <= 1e-5 * several[name].norm(), name


def test_one_thread_and_two_give_the_same_bits():
    surfels, rays = random_surfels(500, 12, 5), splat.Rays(*joined([all_ways(999), side_by_side(999)]))
    before, found = numba.get_num_threads(), []
    try:
        for threads in (1, min(2, before), min(2, before)):
            numba.set_num_threads(threads)
            traced = splat.trace_rays(surfels, rays)
            found.append(
                {**vars(traced), **{f"to {k}": v for k, v in gradients(surfels, rays, "cpu").items()}}
            )
    finally:
        numba.set_num_threads(before)
    for name, first in found[0].items():
        assert all(torch.equal(first, other[name]) for other in found[1:]), name
