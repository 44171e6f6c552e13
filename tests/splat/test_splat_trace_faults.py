# SPDX-License-Identifier: Apache-2.0
"""Inputs that the tracer refuses, and its messages."""

from dataclasses import fields
from types import SimpleNamespace

import psutil
import pytest
import torch

from graycard import MethodError, UnknownNameError
from graycard.methods import splat
from random_surfels import random_surfels
from traced_scenes import all_ways, facing


def test_bad_rays_are_named():
    good = all_ways(3)
    with pytest.raises(ValueError, match="directions to be of unit length, got .* at ray 0"):
        splat.Rays(good.origins, 2 * good.directions)
    broken = good.origins.clone()
    broken[1, 2] = torch.nan
    with pytest.raises(ValueError, match="origins to be finite, got .*nan.* at ray 1"):
        splat.Rays(broken, good.directions)
    with pytest.raises(ValueError, match=r"directions of shape \(3, 3\) .* got \(2, 3\)"):
        splat.Rays(good.origins, good.directions[:2])
    with pytest.raises(ValueError, match="one floating dtype, got .* in torch.int64"):
        splat.Rays(good.origins.long(), good.directions)
    with pytest.raises(ValueError, match="width that divides the 3 rays, got 2"):
        splat.Rays(good.origins, good.directions, 2)
    with pytest.raises(ValueError, match=r"far of shape \(3,\) in torch.float64, got \(2,\)"):
        splat.Rays(good.origins, good.directions, far=torch.ones(2).double())
    with pytest.raises(ValueError, match="far to be zero metres or more, got nan at ray 2"):
        splat.Rays(good.origins, good.directions, far=torch.tensor([1, 2, torch.nan]).double())
    with pytest.raises(ValueError, match="origins to be a torch.Tensor, got list"):
        splat.Rays([[0.0, 0, 0]], good.directions)  # type: ignore[arg-type]  # on purpose


def test_what_does_not_fit_is_refused():
    surfels, rays = random_surfels(5), all_ways(3)
    with pytest.raises(
        ValueError, match="rays in torch.float64 on cpu, as the surfels are, got torch.float32"
    ):
        splat.trace_rays(surfels, splat.Rays(rays.origins.float(), rays.directions.float()))
    with pytest.raises(ValueError, match=r"features of shape \(5, C\)"):
        splat.trace_rays(surfels, rays, torch.zeros(4, 3).double())
    with pytest.raises(ValueError, match="near distance of zero metres or more, got -1"):
        splat.trace_rays(surfels, rays, near=-1)
    with pytest.raises(UnknownNameError, match="did you mean 'reference'"):
        splat.trace_rays(surfels, rays, backend="referense")  # type: ignore[arg-type]  # on purpose


@pytest.mark.parametrize(("surfels", "rays"), [(3, 2_000_000), (1_000_000, 3)])
def test_too_little_memory_is_said_before_it_is_taken(
    surfels: int, rays: int, monkeypatch: pytest.MonkeyPatch
):
    """Surfels or rays would take it."""
    few = SimpleNamespace(available=2_000_000)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: few)
    same = torch.eye(3)[:1].expand(rays, 3)
    lines = splat.Rays(same, same)
    one = facing([1.0])
    many = splat.Surfels(
        *(getattr(one, f.name).float().expand(surfels, *getattr(one, f.name).shape[1:]) for f in fields(one))
    )
    with pytest.raises(MethodError, match=rf"GiB of memory to draw {surfels} surfels along {rays} rays"):
        splat.trace_rays(many, lines)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["origins", "directions"])
def test_rays_that_are_no_numbers_are_refused(name: str, bad: float):
    values = {"origins": torch.zeros(3, 3), "directions": torch.eye(3)}
    values[name][1, 2] = bad
    with pytest.raises(ValueError, match=rf"expected {name} to be finite, got .*(nan|inf).* at ray 1"):
        splat.Rays(values["origins"], values["directions"])


def test_surfels_elsewhere_are_refused():
    surfels = random_surfels(2)
    # A device without data stands for one that is not here; its values cannot be looked at.
    elsewhere = object.__new__(splat.Surfels)
    for field in fields(surfels):
        object.__setattr__(elsewhere, field.name, getattr(surfels, field.name).to("meta"))
    with pytest.raises(ValueError, match="surfels on the CPU, got them on meta"):
        splat.build_bvh(elsewhere)
    with pytest.raises(ValueError, match="rays in torch.float64 on meta"):
        splat.trace_rays(elsewhere, all_ways(1))
