# SPDX-License-Identifier: Apache-2.0
"""A small scene drawn by the engine, held to the specification; run as a script it prints the bits that came.

A script, for what differs between processes: the number of threads, the processor that Numba compiles for.
"""

import hashlib
import sys
from dataclasses import fields

import numpy as np
import torch

from graycard import Camera, look_at
from graycard.methods import splat

FLIPS = 1
"""Pixels that rounding may decide otherwise, of the whole image."""


def scene() -> tuple[splat.Surfels, Camera]:
    """Discs of all sizes, some around the camera; more than one tile, no whole number of them."""
    r = np.random.default_rng(1000)
    turn = r.normal(size=(300, 4))
    values = [
        r.uniform([-1, -2.4, -1], [1, 1, 1], (300, 3)),
        turn / np.linalg.norm(turn, axis=1, keepdims=True),
        0.12 * np.exp(r.normal(0, 0.6, (300, 2))),
        r.uniform(0.02, 0.97, 300),
        r.uniform(-1, 1, (300, 3)),
    ]
    K = np.array([[40, 0.3, 26.3], [0, 44, 20.8], [0, 0, 1]])
    camera = Camera(53, 41, K, look_at(np.array([0.2, -2.5, 0.3]), np.zeros(3)))
    return splat.Surfels(*(torch.from_numpy(v) for v in values)), camera


def drawn(backend: splat.Backend) -> dict[str, torch.Tensor]:
    """All maps, the features alone, and the gradients of a random weighting of them."""
    surfels, camera = scene()
    leaves = {f.name: getattr(surfels, f.name).requires_grad_() for f in fields(surfels)}
    offsets = torch.linspace(-1, 1, 600, dtype=torch.float64).reshape(-1, 2).requires_grad_()
    maps = splat.rasterize(surfels, camera, backend=backend, offsets=offsets)
    only = splat.rasterize_features(surfels, camera, backend=backend, offsets=offsets)
    images = {f.name: getattr(maps, f.name) for f in fields(maps)}
    images |= {f"only {f.name}": getattr(only, f.name) for f in fields(only)}
    random, loss = torch.Generator().manual_seed(1000), torch.zeros((), dtype=torch.float64)
    for image in images.values():
        weights = torch.rand(image.shape, generator=random, dtype=torch.float64) - 0.5
        loss = loss + (weights * image).sum()
    loss.backward()
    leaves["offsets"] = offsets
    grads = {f"gradient of {name}": leaf.grad for name, leaf in leaves.items() if leaf.grad is not None}
    return {name: image.detach() for name, image in images.items()} | grads


def check_against_the_reference(ours: dict[str, torch.Tensor]) -> None:
    truth = drawn("reference")
    assert ours.keys() == truth.keys()
    for name, expected in truth.items():
        error = (ours[name] - expected).abs()
        if name.startswith("gradient"):
            assert error.norm() <= 1e-4 * expected.norm() > 0, name
        else:
            off = error > 1e-5 * expected.abs().clamp(min=1)
            assert (off if off.ndim == 2 else off.any(dim=2)).sum() <= FLIPS, name


def digest(images: dict[str, torch.Tensor]) -> str:
    whole = hashlib.sha256()
    for name in sorted(images):
        whole.update(images[name].contiguous().numpy().tobytes())
    return whole.hexdigest()


if __name__ == "__main__":
    ours = drawn("cpu")
    check_against_the_reference(ours)
    sys.stdout.write(digest(ours))
