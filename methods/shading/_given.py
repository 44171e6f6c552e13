# SPDX-License-Identifier: Apache-2.0
"""Lights that shine on a decomposition in place of those that it found."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from graycard import EnvironmentLight, Light, LocalLight, MethodError
from graycard.io import read_rgb
from graycard.lights import light_from_json, light_to_json
from graycard.methods.shading._cubemap import from_latitudes

_LIGHTS, _SKY = "given", "given sky"


@dataclass(frozen=True, eq=False)
class GivenLights:
    """Lights in true units."""

    local: tuple[LocalLight, ...]
    sky: torch.Tensor
    """Cubemap ``(6, N, N, 3)``, W/m²/sr."""

    def to_store(self) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Facts and arrays, as they are saved with a decomposition."""
        return {_LIGHTS: [light_to_json(light) for light in self.local]}, {_SKY: self.sky.numpy()}


def given_lights(lights: Sequence[Light], own: EnvironmentLight, sky: torch.Tensor) -> GivenLights:
    """Lights by their places, and one sky of all surroundings.

    Args:
        lights: All that shine, in true units. The ``image`` of surroundings is the full path of its file.
        own: What a decomposition calls its own surroundings: among the lights it stands for ``sky``.
        sky: They, shape ``(6, N, N, 3)``, W/m²/sr; others get as many texels.

    Raises:
        DatasetError: An image is missing or broken.
    """
    total = torch.zeros_like(sky)
    for light in lights:
        if isinstance(light, EnvironmentLight):
            image = Path(light.image)
            total = total + (sky if light == own else from_latitudes(read_rgb(image), sky.shape[1]))
    return GivenLights(tuple(light for light in lights if not isinstance(light, EnvironmentLight)), total)


def given_from_store(facts: Mapping[str, Any], arrays: dict[str, np.ndarray]) -> GivenLights | None:
    """Arrays that :meth:`GivenLights.to_store` gave, which is taken out of the arrays; None where nothing was
    saved.

    Raises:
        MethodError: It is damaged.
    """
    if _LIGHTS not in facts:
        return None
    if _SKY not in arrays:
        raise MethodError(f"expected the array {_SKY!r} beside given lights, got none. Save it again")
    lights = (light_from_json(light, MethodError, "given lights") for light in facts[_LIGHTS])
    sky = torch.from_numpy(arrays.pop(_SKY).copy())
    return GivenLights(tuple(light for light in lights if not isinstance(light, EnvironmentLight)), sky)
