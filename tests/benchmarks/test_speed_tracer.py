# SPDX-License-Identifier: Apache-2.0
"""The benchmark of the tracer: that its records are whole, and that its peer traces the same scene."""

from dataclasses import fields

import numpy as np
import pytest
import torch

from graycard.benchmarks.speed._machine import QUICK
from graycard.benchmarks.speed._tracer import incoherent_rays, measure_tracer
from graycard.benchmarks.speed.engine._scenes import Workload, engine_camera, engine_surfels
from graycard.methods import splat
from graycard.synth import use_renderer
from graycard.synth.renderer._variant import can_render

TINY = Workload("tiny", 60, 24, 0.2)
needs_llvm = pytest.mark.skipif(not can_render("llvm_ad_rgb"), reason="no LLVM library for Mitsuba")


def test_rays_of_both_kinds_are_timed():
    camera, incoherent = measure_tracer((TINY,), QUICK, 64)
    assert (camera.workload, camera.kind, camera.surfels, camera.rays) == ("tiny", "camera", 60, 576)
    assert (incoherent.kind, incoherent.rays) == ("incoherent", 64)
    for cost in (camera, incoherent):
        own = (cost.build, cost.forward, cost.both)
        assert all(timing.ms > 0 for timing in own)
        assert cost.ns_per_ray == pytest.approx(1e6 * cost.forward.ms / cost.rays)
        for peer, mine, ratio in (
            (cost.peer_forward, cost.forward, cost.speedup),
            (cost.peer_both, cost.both, cost.speedup_both),
        ):
            assert (peer is None) == (ratio is None) == (not can_render("llvm_ad_rgb"))
            assert peer is None or ratio == pytest.approx(peer.ms / mine.ms)


def test_incoherent_rays_leave_surfels_for_all_ways():
    surfels = engine_surfels(TINY)
    rays = incoherent_rays(surfels, 1600)
    starts = rays.origins.reshape(100, 16, 3)
    assert torch.equal(starts, starts[:, :1].expand_as(starts))
    assert (starts[:, 0, None] == surfels.centres).all(dim=2).any(dim=1).all()
    assert rays.directions.mean(dim=0).norm() < 4 / 1600**0.5  # its root mean square is a quarter of that


@needs_llvm
def test_the_peer_traces_the_same_scene():
    """One disc, so that neither order nor steps play a part; its third axis is thin, not absent.

    Gradients too, of the sum of all channels: two implementations that share nothing.
    """
    use_renderer(variant="llvm_ad_rgb")
    from graycard.benchmarks.speed._ellipsoids import EllipsoidTracer

    surfels = engine_surfels(Workload("one", 1, 24, 0.5))
    rays = splat.camera_rays(engine_camera(TINY))
    leaves = [getattr(surfels, field.name).clone().requires_grad_() for field in fields(surfels)]
    traced = splat.trace_rays(splat.Surfels(*leaves), rays).features
    centres, _, _, opacities, features = torch.autograd.grad(traced.sum(), leaves)
    ours = traced.detach().numpy()
    theirs = EllipsoidTracer(surfels, rays)
    assert ours.max() > 0.1
    inside = ours.max(axis=1) > 0.1
    np.testing.assert_allclose(theirs.forward()[inside], ours[inside], atol=0.05)
    data, to_opacities, to_harmonics = theirs.both()
    np.testing.assert_allclose(data[:3], centres[0], rtol=0.02)
    np.testing.assert_allclose(to_opacities, opacities, rtol=0.02)
    np.testing.assert_allclose(to_harmonics, features[0] * 0.28209479, rtol=0.02)
