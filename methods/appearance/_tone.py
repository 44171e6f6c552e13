# SPDX-License-Identifier: Apache-2.0
"""Appearance: a network that changes the colours of surfels from codes of surfel and photograph.

The network is that of WildGaussians (Kulhanek et al. 2024, their code): it is given a surfel's colour and
code and the photograph's embedding, and gives a factor and an offset for each channel.
"""

from collections.abc import Mapping
from itertools import pairwise
from math import pi, sqrt

import numpy as np
import torch
from torch.nn.functional import linear

from graycard.methods.appearance._settings import AppearanceSettings
from graycard.methods.splat import LearningRateSchedule

EMBEDDINGS, CODE = "embeddings", "code"
"""Parameters: of the photographs, shape ``(M, E)``, and of the surfels, shape ``(N, 24)``."""
BANDS = 4
"""Frequencies of the first code of a place: 1, 2, 4, 8 half waves over the scene."""
SPREAD = 0.97
"""Quantile of distances from the middle that counts as the scene: a few points lie far out."""
SMALL = 0.01
"""Scale of the network's output: at the start photographs are nearly alike."""
NETWORK = tuple(f"tone {kind} {layer}" for layer in range(3) for kind in ("weights", "biases"))


def codes_of(centres: torch.Tensor) -> torch.Tensor:
    """Return where surfels are, as sines and cosines, shape ``(N, 24)`` of ``(N, 3)``."""
    away = centres - centres.mean(dim=0)
    reach = float(np.quantile(away.abs().amax(dim=1).numpy(), SPREAD))
    waves = (away / max(reach, 1e-6))[..., None] * pi * 2.0 ** torch.arange(BANDS)
    return torch.cat([waves.sin(), waves.cos()], dim=-1).flatten(start_dim=1)


def tone_parameters(photographs: int, settings: AppearanceSettings, seed: int) -> dict[str, torch.Tensor]:
    """Embeddings and a network that has learnt nothing, shared by all surfels.

    Embeddings are normal with a standard deviation of 0.01; weights and biases uniform within one over the
    root of the number of inputs, as ``torch.nn.Linear`` begins.
    """
    random = torch.Generator().manual_seed(seed)
    found = {EMBEDDINGS: 0.01 * torch.randn(photographs, settings.embedding, generator=random)}
    sizes = (3 + 6 * BANDS + settings.embedding, settings.width, settings.width, 6)
    for layer, (inputs, outputs) in enumerate(pairwise(sizes)):
        bound = 1 / sqrt(inputs)
        for kind, shape in (("weights", (outputs, inputs)), ("biases", (outputs,))):
            found[f"tone {kind} {layer}"] = bound * (2 * torch.rand(shape, generator=random) - 1)
    return found


def tone_rates(settings: AppearanceSettings) -> dict[str, LearningRateSchedule]:
    """Learning rates by the names of parameters."""
    network = {name: LearningRateSchedule(settings.network_rate) for name in NETWORK}
    return {
        EMBEDDINGS: LearningRateSchedule(settings.embedding_rate),
        CODE: LearningRateSchedule(settings.code_rate),
        **network,
    }


def toned(values: Mapping[str, torch.Tensor], seen: torch.Tensor, photograph: int) -> torch.Tensor:
    """Colours as a photograph has them: ``0.5 + (c - 0.5) (1 + 0.01 m) + 0.01 o``, m and o of the network.

    About gray, since that is what the harmonics of 2DGS are added to; the paper's factor begins at 0 instead
    of 1, from which its thirty thousand steps find back.

    Args:
        values: Parameters by name.
        seen: Shape ``(N, 3)``: encoded colours of the surfels as a camera sees them.
        photograph: Number of the training view.

    Returns:
        Shape ``(N, 3)``, encoded; differentiable.
    """
    embedding = values[EMBEDDINGS][photograph].expand(len(seen), -1)
    hidden = torch.cat([seen, values[CODE], embedding], dim=1)
    for layer in range(2):
        hidden = _layer(values, layer, hidden).relu()
    offset, factor = (SMALL * _layer(values, 2, hidden)).split(3, dim=1)
    return 0.5 + (seen - 0.5) * (1 + factor) + offset


def _layer(values: Mapping[str, torch.Tensor], number: int, inputs: torch.Tensor) -> torch.Tensor:
    return linear(inputs, values[f"tone weights {number}"], values[f"tone biases {number}"])
