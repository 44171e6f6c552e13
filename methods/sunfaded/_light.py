# SPDX-License-Identifier: Apache-2.0
"""The lamp on the camera: a network that says how bright it is in each direction and at each distance.

Neither the falloff with the distance nor the beam is built in, and nothing casts a shadow: the paper's lamp
has to learn the former and cannot learn the latter. The layers are those of the released code.
"""

from collections.abc import Mapping
from math import sqrt

import torch
from torch.nn.functional import linear, normalize, softplus

POSITION = "lamp position"
"""Parameter: shape ``(3,)``, metres, in camera axes."""
BANDS = 6
"""Frequencies of the code of a number: 1, 2, 4, ... radians."""
UNITS_PER_METRE = 0.1
"""Distances are coded in units of ten metres, as the released code scales its worlds: at the top frequency
a metre is 3.2 radians, so that the distances of a room are told apart and neighbours stay alike."""
_LAYERS = ((4 * BANDS, 128), (128, 128), (128, 64), (64 + 2 * BANDS, 64), (64, 3))
"""Inputs and outputs; before the fourth the code of the distance is put beside what the third gives."""
NETWORK = tuple(f"lamp {kind} {n}" for n in range(len(_LAYERS)) for kind in ("weights", "biases"))
"""Parameters of the network."""


def lamp_parameters(seed: int, level: torch.Tensor | None = None) -> dict[str, torch.Tensor]:
    """Return a lamp in the middle of the lens, and a network that has learnt nothing.

    Weights and biases are uniform within one over the root of the number of inputs, as ``torch.nn.Linear``
    begins.

    Args:
        seed: Of the network.
        level: Shape ``(3,)``, above 0: about what the lamp sends everywhere to begin with. One that begins
            far too bright is put out in the first steps, and its place runs away. None: about log 2, as the
            layers give it.
    """
    random = torch.Generator().manual_seed(seed)
    found = {POSITION: torch.zeros(3)}
    for number, (inputs, outputs) in enumerate(_LAYERS):
        for kind, shape in (("weights", (outputs, inputs)), ("biases", (outputs,))):
            drawn = torch.rand(shape, generator=random) * 2 - 1
            found[f"lamp {kind} {number}"] = drawn / sqrt(inputs)
    if level is not None:
        found[NETWORK[-1]] = level.expm1().log()  # softplus gives the level
    return found


def lamp_intensity(values: Mapping[str, torch.Tensor], points: torch.Tensor) -> torch.Tensor:
    """Light of the lamp at points, before the cosine at the surface.

    Args:
        values: The lamp's parameters by name, and any others.
        points: Shape ``(..., 3)``, metres, in camera axes.

    Returns:
        Shape ``(..., 3)``, positive, in the unit of radiance over albedo; differentiable in the parameters.
    """
    away = points - values[POSITION]
    distance = away.norm(dim=-1, keepdim=True)
    x, y, z = normalize(away, dim=-1).unbind(dim=-1)
    # At the poles an arcsine has no slope: a rounding away from them it has a large one, and is finite.
    angles = torch.stack([torch.asin(y.clamp(-_POLE, _POLE)), torch.atan2(x, z)], dim=-1)
    hidden = _code(angles)
    for number in range(3):
        hidden = _layer(values, number, hidden).relu()
    hidden = torch.cat([hidden, _code(distance * UNITS_PER_METRE)], dim=-1)
    return softplus(_layer(values, 4, _layer(values, 3, hidden).relu()))


_POLE = 1 - 1e-6


def cosine_to_lamp(
    values: Mapping[str, torch.Tensor], points: torch.Tensor, normals: torch.Tensor
) -> torch.Tensor:
    """``max(0, n . w)`` with the direction ``w`` from each point to the lamp, shape ``(..., 1)``.

    Args:
        values: As in :func:`lamp_intensity`.
        points: Shape ``(..., 3)``, metres, in camera axes.
        normals: Shape ``(..., 3)``, in camera axes, of any length: it counts.
    """
    toward = normalize(values[POSITION] - points, dim=-1)
    return (normals * toward).sum(dim=-1, keepdim=True).relu()


def _layer(values: Mapping[str, torch.Tensor], number: int, inputs: torch.Tensor) -> torch.Tensor:
    return linear(inputs, values[f"lamp weights {number}"], values[f"lamp biases {number}"])


def _code(numbers: torch.Tensor) -> torch.Tensor:
    """Sines and cosines of numbers times 1, 2, 4, ...: shape ``(..., 2 BANDS n)`` of ``(..., n)``."""
    scaled = numbers[..., None] * 2.0 ** torch.arange(BANDS, dtype=numbers.dtype, device=numbers.device)
    return torch.cat([scaled.sin(), scaled.cos()], dim=-1).flatten(start_dim=-2)
