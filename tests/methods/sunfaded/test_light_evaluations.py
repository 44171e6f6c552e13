# SPDX-License-Identifier: Apache-2.0
"""Counts of the lamp's network: those of a decomposition are those that happen."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from graycard import Camera
from graycard.methods.sunfaded import _tiles
from graycard.methods.sunfaded._layers import Lighting
from graycard.methods.sunfaded._model import ALBEDO
from graycard.methods.sunfaded._scene import SunFadedScene
from graycard.methods.sunfaded._settings import SunFadedSettings


def asked(monkeypatch: pytest.MonkeyPatch, width: int, height: int, side: int, kind: Any) -> int:
    """Points that reach the network while a map of light is made."""
    points: list[int] = []

    def count(values: Any, at: torch.Tensor) -> torch.Tensor:
        points.append(at[..., 0].numel())
        return torch.ones_like(at)

    monkeypatch.setattr(_tiles, "lamp_intensity", count)
    _tiles.lamp_map({}, torch.ones(height, width, 3), side, kind)
    return sum(points)


@pytest.mark.parametrize("kind", ["nearest", "bilinear"])
@pytest.mark.parametrize("side", [1, 2, 3, 7, 40])
def test_the_count_is_that_of_the_map(monkeypatch: pytest.MonkeyPatch, side: int, kind: Any) -> None:
    assert _tiles.light_evaluations(23, 17, side) == asked(monkeypatch, 23, 17, side, kind)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"tile": 1 / 64}, 56 * 56),
        ({"tile": 1 / 256}, 112 * 112),
        ({"tile": 1 / 16}, 16 * 16),
        ({"shading": "surfel"}, 321),
    ],
)
def test_a_decomposition_counts_tiles_or_surfels(settings: dict[str, Any], expected: int) -> None:
    surfels: Any = SimpleNamespace(surfels={ALBEDO: torch.zeros(321, 3)})
    camera = Camera.from_fov(112, 112, 60, np.eye(4))
    scene = SunFadedScene(surfels, Lighting(SunFadedSettings(**settings), 1.0, 2.0))
    assert scene.counts(camera) == {"light evaluations": expected}
