# SPDX-License-Identifier: Apache-2.0
"""Reflections of rough surfaces: levels of blur, what lies between them, and the network that chooses."""

from itertools import pairwise

import numpy as np
import pytest
import torch
from scipy.ndimage import correlate1d

from graycard.methods.goris._filter import (
    LEVELS,
    Reading,
    filtered,
    pyramid,
    translated,
    translation_parameters,
)

READINGS: tuple[Reading, ...] = ("paper", "release")


def image_of(height: int = 32, width: int = 48, channels: int = 2, seed: int = 0) -> torch.Tensor:
    return torch.rand(height, width, channels, generator=torch.Generator().manual_seed(seed))


def facing(image: torch.Tensor) -> torch.Tensor:
    return torch.tensor([0.0, 0.0, 1.0]).expand(*image.shape[:2], 3)


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("size", [(32, 48), (31, 17), (3, 2), (1, 1)])
def test_levels_are_of_one_size_and_keep_what_is_even(reading: Reading, size: tuple[int, int]):
    even = torch.full((*size, 3), 0.7)
    levels = pyramid(even, reading, facing(even))
    assert len(levels) == LEVELS
    for level in levels:
        torch.testing.assert_close(level, even)


@pytest.mark.parametrize("reading", READINGS)
def test_levels_are_not_shifted_where_sides_are_odd(reading: Reading):
    """A ramp stays where it was, away from the border."""
    ramp = torch.arange(37.0)[None, :, None].expand(41, 37, 1)
    for level in pyramid(ramp, reading, facing(ramp))[:3]:
        torch.testing.assert_close(level[:, 12:24], ramp[:, 12:24], atol=0.02, rtol=0)


def test_the_release_wants_normals():
    with pytest.raises(ValueError, match="expected normals for the pyramid of the release"):
        pyramid(image_of(), "release")


def test_the_second_level_is_a_gaussian_blur_at_half_size():
    """Against SciPy."""
    image = image_of()
    blurred = image.numpy()
    for axis in (0, 1):
        blurred = correlate1d(blurred, np.array([1, 4, 6, 4, 1]) / 16, axis=axis, mode="nearest")
    half = blurred.reshape(16, 2, 24, 2, 2).mean(axis=(1, 3))
    level = pyramid(image, "paper")[1].numpy()
    # bilinear back to full size: pixel 1 lies a quarter of the way from the half-size pixel 0 to pixel 1
    rows = 0.75 * half[:-1] + 0.25 * half[1:]
    want = 0.75 * rows[:, :-1] + 0.25 * rows[:, 1:]
    np.testing.assert_allclose(level[1:-1:2, 1:-1:2], want, atol=1e-6)


@pytest.mark.parametrize("reading", READINGS)
def test_each_level_is_less_sharp(reading: Reading):
    image = image_of()
    spreads = [float(level.std()) for level in pyramid(image, reading, facing(image))]
    assert all(after < 0.9 * before for before, after in pairwise(spreads))


def test_what_faces_elsewhere_is_left_out_by_the_release():
    """Two walls at a right angle, one black and one white: nothing mixes at the first levels' edge."""
    image, normal = torch.zeros(32, 32, 1), torch.zeros(32, 32, 3)
    image[:, 16:], normal[:, :16, 0], normal[:, 16:, 2] = 1.0, 1.0, 1.0
    apart, mixed = pyramid(image, "release", normal)[1], pyramid(image, "paper")[1]
    assert float((apart[:, :14]).max()) == 0.0
    assert float((mixed[:, 14]).max()) > 0.05


def test_blur_chooses_levels_and_what_lies_between():
    levels = [torch.full((2, 5, 1), float(number)) for number in range(LEVELS)]
    blur = torch.tensor([[0.0, 0.1, 0.3, 0.5, 1.0], [0.2, 0.4, 0.6, 0.9, 0.05]])
    want = (5 * blur - 0.5).clamp(0, 4)
    torch.testing.assert_close(filtered(levels, blur)[..., 0], want)


@pytest.mark.parametrize("reading", READINGS)
def test_blur_begins_as_roughness(reading: Reading):
    values = translation_parameters(reading, 0)
    roughness = image_of(channels=1)[..., 0]
    distances = image_of(channels=1 if reading == "paper" else 2, seed=1)
    torch.testing.assert_close(
        translated(values, roughness, distances), roughness.clamp(1e-3, 1 - 1e-3), atol=1e-6, rtol=0
    )
    weights = [name for name in values if "weight" in name]
    assert len(weights) == 8, "convolutions"
    assert [values[name].shape[-1] for name in weights] == [1, 3, 3, 3, 3, 3, 3, 1]


@pytest.mark.parametrize("reading", READINGS)
def test_the_network_learns_what_roughness_is_on_the_screen(reading: Reading):
    """Less of it further away."""
    values = {name: v.requires_grad_() for name, v in translation_parameters(reading, 0).items()}
    roughness = torch.full((16, 24), 0.4)
    distances = (
        torch.linspace(0.5, 2, 24).expand(16, 24)[..., None].repeat(1, 1, 1 if reading == "paper" else 2)
    )
    target = 0.4 / distances[..., 0]
    optimiser = torch.optim.Adam(values.values(), lr=5e-3)
    for _ in range(150):
        optimiser.zero_grad()
        (translated(values, roughness, distances) - target).abs().mean().backward()
        optimiser.step()
    with torch.no_grad():
        assert float((translated(values, roughness, distances) - target).abs().mean()) < 0.03


@pytest.mark.parametrize("reading", READINGS)
def test_gradients_are_those_of_finite_differences(reading: Reading):
    torch.manual_seed(0)
    image = torch.rand(6, 7, 1, dtype=torch.float64, requires_grad=True)
    blur = (0.15 + 0.7 * torch.rand(6, 7, dtype=torch.float64)).requires_grad_()
    normal = torch.nn.functional.normalize(torch.rand(6, 7, 3, dtype=torch.float64), dim=-1)
    assert torch.autograd.gradcheck(lambda i, b: filtered(pyramid(i, reading, normal), b), (image, blur))
