# SPDX-License-Identifier: Apache-2.0
"""Draw the batch of a step: views cut, mirrored, exposed, tinted and made noisy at random."""

from collections.abc import Mapping

import numpy as np
import torch
from torch.nn.functional import interpolate

from graycard.methods.priors.network import rays_of

Batch = Mapping[str, torch.Tensor]
"""Arrays ``(N, C, H, W)``: ``image`` in display range, ``rays``, and the true layers."""

OF_PAINT = 0.2
"""Share of pictures that show the base colour, as methods ask anew when they have taken the light off."""
LEAST_CUT = 0.65
"""Side of the smallest cut-out, of the picture's."""
STOPS = (-1.5, 1.0)
"""Exposure beside that of the capture."""
TINT = 0.1
"""Standard deviation of the log of each channel's gain."""
NOISE = 0.03
"""Most noise, standard deviation at white; it falls with the root of the light."""
DARK_NOISE = 0.002
"""Most noise where there is no light."""


def whole_views(views: Mapping[str, np.ndarray], chosen: np.ndarray) -> Batch:
    """Return views as they are.

    Args:
        views: Of :func:`graycard.benchmarks.training.read_views`.
        chosen: Their numbers.
    """
    layers = {name: _tensor(values[chosen]) for name, values in views.items() if name != "K"}
    height, width = layers["image"].shape[-2:]
    return {**layers, "rays": torch.stack([rays_of(K, height, width) for K in views["K"][chosen]])}


def random_views(views: Mapping[str, np.ndarray], count: int, rng: np.random.Generator) -> Batch:
    """Return a number of views, each changed at random.

    Args:
        views: Of :func:`graycard.benchmarks.training.read_views`.
        count: How many.
        rng: Decides all of it.
    """
    chosen = rng.integers(len(views["image"]), size=count)
    whole = whole_views(views, chosen)
    singles = [_cut({name: values[n] for name, values in whole.items()}, rng) for n in range(count)]
    changed = [{**view, "image": _lit(view, rng)} for view in (_mirrored(one, rng) for one in singles)]
    return {name: torch.stack([view[name] for view in changed]) for name in whole}


def _tensor(values: np.ndarray) -> torch.Tensor:
    """Values ``(N, H, W)`` or ``(N, H, W, C)`` as ``(N, C, H, W)``, float32."""
    stacked = values[:, None] if values.ndim == 3 else np.moveaxis(values, -1, 1)
    return torch.from_numpy(np.ascontiguousarray(stacked, np.float32))


def _cut(view: dict[str, torch.Tensor], rng: np.random.Generator) -> dict[str, torch.Tensor]:
    """Half of the views as they are, of the others a square part at the whole's size."""
    height, width = view["image"].shape[-2:]
    share, right, down = rng.uniform((LEAST_CUT, 0, 0), 1)
    if rng.random() < 0.5:
        return view
    tall, wide = round(share * height), round(share * width)
    top, left = round(down * (height - tall)), round(right * (width - wide))

    def resized(name: str, values: torch.Tensor) -> torch.Tensor:
        part = values[None, :, top : top + tall, left : left + wide]
        if name in ("image", "rays"):
            return interpolate(part, (height, width), mode="bilinear")[0]
        return interpolate(part, (height, width), mode="nearest-exact")[0]

    return {name: resized(name, values) for name, values in view.items()}


def _mirrored(view: dict[str, torch.Tensor], rng: np.random.Generator) -> dict[str, torch.Tensor]:
    """Half of the views as they are, the others with left and right swapped."""
    if rng.random() < 0.5:
        return view
    flipped = {name: values.flip(-1) for name, values in view.items()}
    for name in ("normal", "rays"):
        flipped[name][0] *= -1
    return flipped


def _lit(view: dict[str, torch.Tensor], rng: np.random.Generator) -> torch.Tensor:
    """Return the picture at another exposure, with a tint and noise, or that of the paint with some light
    left.
    """
    image, leak = view["image"], float(rng.choice((0.0, rng.uniform(0, 0.6))))
    if rng.random() < OF_PAINT:
        logs = [torch.log(layer.clamp_min(1e-4)) for layer in (view["base_color"], image)]
        image = torch.exp((1 - leak) * logs[0] + leak * logs[1])
    gains = 2 ** rng.uniform(*STOPS) * np.exp(rng.normal(0, TINT, 3))
    image = image * torch.from_numpy(gains.astype(np.float32))[:, None, None]
    shot, dark = rng.uniform(0, (NOISE, DARK_NOISE))
    noise = torch.from_numpy(rng.standard_normal(image.shape, np.float32))
    return image + noise * torch.sqrt(shot**2 * image.clamp_min(0) + dark**2)
