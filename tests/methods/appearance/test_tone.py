# SPDX-License-Identifier: Apache-2.0
"""Changes of colours by photographs, and the photograph that a new view is like."""

import numpy as np
import pytest
import torch

from graycard import Camera, look_at
from graycard.methods.appearance import AppearanceSettings
from graycard.methods.appearance._nearest import eyes_of
from graycard.methods.appearance._tone import (
    CODE,
    EMBEDDINGS,
    NETWORK,
    codes_of,
    tone_parameters,
    tone_rates,
    toned,
)

SETTINGS = AppearanceSettings(embedding=5, width=7)


def parameters(surfels: int = 6) -> dict[str, torch.Tensor]:
    random = torch.Generator().manual_seed(4)
    centres = torch.rand(surfels, 3, generator=random) * 4
    found = {CODE: codes_of(centres), **tone_parameters(3, SETTINGS, 0)}
    return {name: values.double() for name, values in found.items()}


def by_hand(values: dict[str, torch.Tensor], colour: np.ndarray, surfel: int, photograph: int) -> np.ndarray:
    """The network of one surfel in plain numpy."""
    hidden = np.concatenate([colour, values[CODE][surfel].numpy(), values[EMBEDDINGS][photograph].numpy()])
    for layer in range(3):
        weights, biases = (values[f"tone {kind} {layer}"].numpy() for kind in ("weights", "biases"))
        hidden = weights @ hidden + biases
        hidden = np.maximum(hidden, 0) if layer < 2 else 0.01 * hidden
    return 0.5 + (colour - 0.5) * (1 + hidden[3:]) + hidden[:3]


def test_the_network_is_that_of_the_text():
    values = parameters()
    seen = torch.rand(6, 3, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    for photograph in range(3):
        expected = [by_hand(values, colour, n, photograph) for n, colour in enumerate(seen.numpy())]
        np.testing.assert_allclose(toned(values, seen, photograph), expected, rtol=1e-12)


def test_every_number_gets_the_slope_of_finite_differences():
    values = {name: v.requires_grad_() for name, v in parameters(2).items()}
    seen = torch.rand(2, 3, generator=torch.Generator().manual_seed(2), dtype=torch.float64)

    def shown(*numbers: torch.Tensor) -> torch.Tensor:
        return toned(dict(zip(values, numbers, strict=True)), seen, 1)

    assert torch.autograd.gradcheck(shown, tuple(values.values()))
    assert set(values) == {CODE, EMBEDDINGS, *NETWORK} == set(tone_rates(SETTINGS))


def test_photographs_begin_nearly_alike():
    values, seen = parameters(), torch.full((6, 3), 0.3, dtype=torch.float64)
    first, second = toned(values, seen, 0), toned(values, seen, 1)
    assert (first - seen).abs().max() < 0.02
    assert 0 < (first - second).abs().max() < 1e-3


def test_codes_are_waves_over_the_scene():
    centres = torch.tensor([[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    codes = codes_of(centres)
    assert codes.shape == (4, 24)
    reach = np.quantile([2, 2, 1, 1], 0.97)
    for band in range(4):
        angle = np.pi * 2**band * 2.0 / reach
        assert float(codes[1, band]) == pytest.approx(np.sin(angle), abs=1e-5)
        assert float(codes[1, 4 + band]) == pytest.approx(np.cos(angle), abs=1e-5)
    torch.testing.assert_close(codes[0, :4], -codes[1, :4])
    assert torch.isfinite(codes_of(torch.zeros(3, 3))).all()


def camera(x: float, towards: float) -> Camera:
    eye = np.array([x, 0.0, 1.0])
    ahead = np.array([np.sin(towards), np.cos(towards), 0.0])
    return Camera.from_fov(8, 6, 50, look_at(eye, eye + ahead))


def test_the_nearest_photograph_is_told_by_place_and_direction():
    eyes = eyes_of([camera(-1.0, 0.0), camera(1.0, 0.0), camera(1.0, 1.5)])
    assert [eyes.nearest(camera(x, turn)) for x, turn in ((-0.9, 0.1), (0.8, 0.2), (0.8, 1.2))] == [0, 1, 2]
    # the other way round the place alone, or the direction alone, would decide
    assert eyes.nearest(camera(0.9, 1.4)) == 2
    assert eyes.nearest(camera(-0.4, 1.4)) == 2
    for number, known in enumerate((camera(-1.0, 0.0), camera(1.0, 0.0), camera(1.0, 1.5))):
        assert eyes.nearest(known) == number
