# SPDX-License-Identifier: Apache-2.0
"""Light from far away as a cubemap: where its texels look, how much of the sky each is, and what is seen.

A cubemap is a tensor of shape ``(6, N, N, 3)``: the faces +x, -x, +y, -y, +z and -z of the world, each with
rows from top to bottom and columns from left to right as it is seen from inside.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, cast

import numpy as np
import torch
from torch.autograd.function import once_differentiable

from graycard.methods._tensors import contiguous_array
from graycard.methods.splat import CPU

_FORWARD = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=np.float64)
_RIGHT = np.array([(0, 0, 1), (0, 0, -1), (-1, 0, 0), (-1, 0, 0), (-1, 0, 0), (1, 0, 0)], dtype=np.float64)
_DOWN = np.array([(0, -1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (0, -1, 0), (0, -1, 0)], dtype=np.float64)


def texel_directions(size: int, per_side: int = 1) -> np.ndarray:
    """Directions of the texels.

    Args:
        size: Texels along the side of a face.
        per_side: Points along the side of a texel, evenly spaced on the face.

    Returns:
        Shape ``(6, size * per_side, size * per_side, 3)``, unit, world, float64.
    """
    steps = _centres(size * per_side)
    return _on_cube(steps[None, None, :], steps[None, :, None])


def solid_angles(size: int) -> np.ndarray:
    """Return how much of the sphere each texel of a face is, exact: shape ``(size, size)``, sr; six faces are
    4 pi.

    ``A(u1, v1) - A(u0, v1) - A(u1, v0) + A(u0, v0)`` with ``A(u, v) = atan(u v / sqrt(1 + u² + v²))``.
    """
    edges = np.linspace(-1, 1, size + 1)
    u, v = edges[None, :], edges[:, None]
    corner = np.arctan2(u * v, np.sqrt(1 + u * u + v * v))
    return np.diff(np.diff(corner, axis=0), axis=1)


def turned_texels(size: int) -> torch.Tensor:
    """Return where each texel goes when the cube is turned so that a face becomes the first, shape ``(6, 6
    size²)``.

    Row ``f`` is for the turn that brings face ``f``, upright, to the place of face 0.
    """
    frames = np.stack([_RIGHT, _DOWN, _FORWARD], axis=1)
    directions = texel_directions(size).reshape(-1, 3)
    return torch.stack([_texels_at(directions @ frame.T @ frames[0], size) for frame in frames])


def look_up(cubemap: torch.Tensor, directions: torch.Tensor) -> torch.Tensor:
    """Return what is seen in directions, bilinear, across the edges of the faces too.

    Args:
        cubemap: Shape ``(6, N, N, C)``.
        directions: Shape ``(..., 3)``, world, of any length above 0.

    Returns:
        Shape ``(..., C)``, differentiable in both, once.
    """
    return look_up_between([cubemap], directions, directions.new_zeros(directions.shape[:-1]))


def look_up_between(
    cubemaps: Sequence[torch.Tensor], directions: torch.Tensor, levels: torch.Tensor
) -> torch.Tensor:
    """Return what is seen in directions between two of several cubemaps, linear between them.

    Args:
        cubemaps: Each of shape ``(6, N, N, C)``, with an N of its own.
        directions: Shape ``(..., 3)``, world, of any length above 0; what is seen in others is NaN, and has
            no part in gradients of the cubemaps.
        levels: Shape ``(...)``: number of a cubemap, or a place between two; beyond the ends those there.

    Returns:
        Shape ``(..., C)``, differentiable in all, once. What lies on a GPU is looked up on the CPU.
    """
    sizes = tuple(cubemap.shape[1] for cubemap in cubemaps)
    texels = torch.cat([cubemap.reshape(-1, cubemap.shape[-1]) for cubemap in cubemaps])
    dtype = torch.promote_types(torch.promote_types(texels.dtype, directions.dtype), levels.dtype)
    toward, place = directions.reshape(-1, 3), levels.expand(directions.shape[:-1]).reshape(-1)
    inputs = (values.to(CPU, dtype) for values in (texels, toward, place))
    found = cast(torch.Tensor, _Seen.apply(*inputs, sizes)).to(directions.device)
    return found.reshape(*directions.shape[:-1], cubemaps[0].shape[-1])


_Inputs = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class _Seen(torch.autograd.Function):
    """The kernels as one differentiable step."""

    @staticmethod
    def forward(
        ctx: Any, texels: torch.Tensor, directions: torch.Tensor, levels: torch.Tensor, sizes: tuple[int, ...]
    ) -> torch.Tensor:
        """Values seen, ``(R, C)``."""
        from graycard.methods.shading._cubemap_kernels import seen  # Numba takes long to import

        ctx.save_for_backward(texels, directions, levels)
        ctx.sizes = sizes
        found = directions.new_empty(len(directions), texels.shape[1])
        seen(*_inputs(texels, directions, levels, sizes), found.numpy())
        return found

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # the decorator hides the name of ctx from type checkers
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """Gradients of texels, directions and levels."""
        from graycard.methods.shading._cubemap_kernels import seen_backward

        texels, directions, levels = ctx.saved_tensors
        to_texels = torch.zeros_like(texels, memory_format=torch.contiguous_format)
        to_directions = torch.empty_like(directions, memory_format=torch.contiguous_format)
        to_levels = torch.empty_like(levels, memory_format=torch.contiguous_format)
        outputs = (to_texels.numpy(), to_directions.numpy(), to_levels.numpy())
        seen_backward(
            *_inputs(texels, directions, levels, ctx.sizes), contiguous_array(grad_outputs[0]), *outputs
        )
        return to_texels, to_directions, to_levels, None


def _inputs(
    texels: torch.Tensor, directions: torch.Tensor, levels: torch.Tensor, sizes: tuple[int, ...]
) -> _Inputs:
    """Arguments of both kernels."""
    toward = contiguous_array(directions)
    axes = np.stack([_RIGHT, _DOWN]).astype(toward.dtype)
    return (
        contiguous_array(texels),
        _all_bordered(sizes),
        np.array(sizes),
        toward,
        contiguous_array(levels),
        axes,
    )


def from_latitudes(image: np.ndarray, size: int, per_side: int = 4) -> torch.Tensor:
    """Return a cubemap of an environment.

    Args:
        image: Shape ``(H, W, 3)``, as :class:`graycard.EnvironmentLight` says.
        size: Texels along the side of a face.
        per_side: Points along the side of a texel, of which each texel is the mean by solid angle.

    Returns:
        Shape ``(6, size, size, 3)``, float32.
    """
    directions = texel_directions(size, per_side)
    weights = solid_angles(size * per_side)[None, ..., None]
    seen = _seen_in_latitudes(image, directions) * weights
    blocks = (6, size, per_side, size, per_side)
    total = seen.reshape(*blocks, -1).sum(axis=(2, 4))
    share = np.broadcast_to(weights, (*seen.shape[:-1], 1)).reshape(*blocks, 1).sum(axis=(2, 4))
    return torch.from_numpy((total / share).astype(np.float32))


def to_latitudes(cubemap: torch.Tensor, height: int) -> np.ndarray:
    """Return the image of a cubemap, shape ``(height, 2 height, 3)``, as :class:`graycard.EnvironmentLight`
    says.
    """
    polar = np.pi * (np.arange(height) + 0.5)[:, None] / height
    azimuth = np.pi * (np.arange(2 * height) + 0.5)[None, :] / height
    parts = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth
    directions = torch.from_numpy(np.stack(parts, axis=-1)).to(cubemap.dtype)
    return look_up(cubemap.detach(), directions).numpy()


def _on_cube(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return unit vectors through points of the faces, shape ``(6, V, U, 3)``."""
    forward, right, down = (axes[:, None, None, :] for axes in (_FORWARD, _RIGHT, _DOWN))
    through = forward + u[..., None] * right + v[..., None] * down
    return through / np.linalg.norm(through, axis=-1, keepdims=True)


def _centres(size: int) -> np.ndarray:
    return (2 * np.arange(size) + 1) / size - 1


def _on_face(directions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return number of the face, and where on it, each coordinate in [-1, 1]."""
    axis = directions.detach().abs().argmax(dim=-1)
    along = directions.gather(-1, axis[..., None])[..., 0]
    face = 2 * axis + (along < 0)
    right, down = (torch.from_numpy(axes).to(directions.dtype)[face] for axes in (_RIGHT, _DOWN))
    u, v = ((directions * axes).sum(dim=-1) / along.abs() for axes in (right, down))
    return face, u, v


@lru_cache(maxsize=8)
def _all_bordered(sizes: tuple[int, ...]) -> np.ndarray:
    """:func:`_bordered` of cubemaps one after the other, as are their texels."""
    begins = np.cumsum([0, *(6 * size**2 for size in sizes[:-1])])
    return np.concatenate([_bordered(n).numpy() + first for n, first in zip(sizes, begins, strict=True)])


@lru_cache(maxsize=8)
def _bordered(size: int) -> torch.Tensor:
    """Texels by their place in faces with a border of one texel, shape ``(6 (size + 2)²,)``.

    What is beyond an edge is the texel of the neighbour there; what is beyond a corner, where three faces
    meet, is the same texel for all of them, so that nothing jumps.
    """
    steps = np.concatenate([[-1 - 1 / size], _centres(size), [1 + 1 / size]])
    directions = _on_cube(steps[None, None, :], steps[None, :, None])
    directions[:, [[0], [-1]], [0, -1]] = np.sign(directions[:, [[0], [-1]], [0, -1]])
    return _texels_at(directions, size).reshape(-1)


def _texels_at(directions: np.ndarray, size: int) -> torch.Tensor:
    """Numbers of the texels that hold directions, of the same shape without the last axis."""
    face, u, v = _on_face(torch.from_numpy(directions))
    column, row = (((c + 1) * size / 2).floor().long().clamp(0, size - 1) for c in (u, v))
    return (face * size + row) * size + column


def _seen_in_latitudes(image: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Bilinear, around in azimuth."""
    height, width = image.shape[:2]
    x, y, z = np.moveaxis(directions, -1, 0)
    row = np.arccos(z.clip(-1, 1)) / np.pi * height - 0.5
    column = np.arctan2(y, x) / (2 * np.pi) * width - 0.5
    top, left = np.floor(row).astype(int), np.floor(column).astype(int)
    down, across = (row - top)[..., None], (column - left)[..., None]

    def at(below: int, right: int) -> np.ndarray:
        return image[np.clip(top + below, 0, height - 1), (left + right) % width].astype(np.float64)

    upper = at(0, 0) * (1 - across) + at(0, 1) * across
    lower = at(1, 0) * (1 - across) + at(1, 1) * across
    return upper * (1 - down) + lower * down
