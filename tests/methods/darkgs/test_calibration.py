# SPDX-License-Identifier: Apache-2.0
"""The beam of a lamp as photographs of a white board tell it."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from graycard import PointLight, SpotLight
from graycard.methods.darkgs._calibration import (
    ELECTRONS,
    READ_NOISE,
    REFLECTANCE,
    fit_profile,
    photograph_board,
)
from graycard.methods.darkgs._lamp import LampProfile, MeasuredLamp, irradiance, warming

SPOT = SpotLight("lamp", (0.25, -0.06, 0.0), (-0.08, 0.03, 1.0), (9.0, 8.0, 6.0), 15.0, 38.0, "camera")
BULB = PointLight("lamp", (0.3, -0.1, 0.0), (12.0, 10.0, 8.0), "camera")


def seen(count: int = 500) -> torch.Tensor:
    """Points that a camera of 62 degrees sees, up to five metres away."""
    draws = torch.Generator().manual_seed(0)
    ahead = 0.8 + 4 * torch.rand(count, 1, generator=draws, dtype=torch.float64)
    aside = ahead * (1.2 * torch.rand(count, 2, generator=draws, dtype=torch.float64) - 0.6)
    return torch.cat([aside, ahead], dim=1)


@pytest.mark.parametrize("lamp", [pytest.param(SPOT, marks=pytest.mark.slow), BULB])
def test_a_measured_lamp_is_close_to_the_true_one_and_is_not_it(lamp: SpotLight | PointLight):
    profile = fit_profile(lamp, photograph_board(lamp))
    true, found = irradiance(lamp, seen()), irradiance(MeasuredLamp(lamp, profile), seen())
    wrong = (found - true).abs().mean() / true.mean()
    assert 1e-4 < wrong < 0.02
    assert profile.exponent == pytest.approx(1, abs=0.02)


def test_the_fit_looks_at_the_photographs_and_not_at_the_formula():
    """The same samples give the same profile, whatever strength and beam the lamp is said to have."""
    samples = photograph_board(SPOT)
    said = replace(SPOT, intensity=(1.0, 1.0, 1.0), beam_width=5.0, cutoff_angle=60.0)
    assert fit_profile(said, samples) == fit_profile(SPOT, samples)


def test_photographs_have_the_noise_they_say():
    samples = photograph_board(BULB)
    true = irradiance(BULB, torch.from_numpy(samples.points)).numpy() * samples.reflected
    error = (samples.radiance - true) / samples.sigma
    assert error.mean() == pytest.approx(0, abs=0.02)
    assert error.std() == pytest.approx(1, abs=0.03)
    assert samples.reflected.max() <= REFLECTANCE / np.pi
    assert samples.reflected.min() > 0
    other = photograph_board(BULB, seed=1)
    assert not np.array_equal(samples.radiance, other.radiance)
    assert READ_NOISE < ELECTRONS


def test_a_profile_is_read_between_its_rows():
    profile = LampProfile(((4.0, 2.0, 1.0), (2.0, 1.0, 0.5), (0.0, 0.0, 0.0)), 40.0, 0.5, 2.0)
    lamp = MeasuredLamp(PointLight("lamp", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), "camera"), profile)
    at = np.radians([10.0, 30.0, 80.0])
    points = torch.from_numpy(2 * np.stack([np.sin(at), 0 * at, np.cos(at)], axis=1))
    expected = np.array([[3.0, 1.5, 0.75], [1.0, 0.5, 0.25], [0, 0, 0]]) / 4.5**2
    np.testing.assert_allclose(irradiance(lamp, points), expected, atol=1e-6)


def test_a_measured_lamp_has_the_slope_of_finite_differences():
    lamp = MeasuredLamp(SPOT, fit_profile(SPOT, photograph_board(SPOT)))
    assert torch.autograd.gradcheck(lambda points: irradiance(lamp, points), (seen(5).requires_grad_(),))


def test_a_measured_lamp_warms_up_as_a_told_one():
    lamp = MeasuredLamp(SPOT, LampProfile(((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)), 40.0, 0.01, 1.0))
    half = warming(lamp, 0.5)
    assert (half.lamp, half.profile) == (warming(SPOT, 0.5), lamp.profile)
