# SPDX-License-Identifier: Apache-2.0
"""All lamps on surfaces in one sweep, and one back: the sums that a fit looks at."""

from typing import Any, NamedTuple, cast

import numpy as np
import torch
from torch.autograd.function import once_differentiable
from torch.nn.functional import normalize

from graycard.methods._tensors import contiguous_array
from graycard.methods.shading._lamps import Lamps
from graycard.methods.shading._material import Material


class LampLight(NamedTuple):
    """Light of K lamps on surfaces of shape ``(...)``."""

    returned: torch.Tensor
    """Radiance that surfaces return of all lamps together, shape ``(..., 3)``."""
    given: torch.Tensor
    """Irradiance of each lamp, unhindered but for what is in the way, on surfaces that face it: the mean over
    surfaces and channels, shape ``(K,)``."""


class InTheWay(NamedTuple):
    """Obstacles between surfaces and K lamps; without any field none."""

    vector: torch.Tensor | None = None
    """Shape ``(..., 3)``, of any length: brought to length 1, of light from the direction w ``1 - max(0, v .
    w)^8`` arrives."""
    known: torch.Tensor | None = None
    """Shape ``(K,)``, bool: the lamps that vectors know; None: all."""
    shares: torch.Tensor | None = None
    """Shape ``(..., K)``: besides, the share that arrives of each lamp's light; no gradient."""


def light_of_lamps(
    material: Material,
    normal: torch.Tensor,
    eye: torch.Tensor,
    points: torch.Tensor,
    lamps: Lamps,
    *,
    soften: float = 0.0,
    in_the_way: InTheWay | None = None,
) -> LampLight:
    """Light surfaces as :func:`arriving` and :func:`lit_by_lamps` do, in float32 on the CPU.

    Args:
        material: Of surfaces of shape ``(...)``.
        normal: Shape ``(..., 3)``, unit.
        eye: Shape ``(..., 3)``, unit, from the surface to the eye; a constant.
        points: Shape ``(..., 3)``, metres; a constant.
        lamps: K of them.
        soften: Metres, see :func:`arriving`.
        in_the_way: What is; None: nothing.

    Returns:
        Differentiable once in the material, normals, lamps and vectors.

    Raises:
        ValueError: Tensors are not float32 on the CPU.
    """
    way, shape = in_the_way or InTheWay(), normal.shape[:-1]
    layers = (normal, material.base_color, material.roughness[..., None], material.metallic[..., None])
    rows = [layer.reshape(-1, layer.shape[-1]) for layer in layers]
    vector = None if way.vector is None else way.vector.reshape(-1, 3)
    still = _Still(
        points.detach().reshape(-1, 3),
        eye.detach().reshape(-1, 3),
        None if way.shares is None or not len(lamps) else way.shares.detach().reshape(-1, len(lamps)),
        torch.ones(len(lamps)) if way.known is None else way.known.float(),
        soften**2,
    )
    of_lamps = lamps.positions, normalize(lamps.axes, dim=-1), lamps.sharpness, lamps.amplitudes
    _check(*rows, *of_lamps, *(one for one in (vector, *still[:3]) if one is not None))
    returned, given = cast(tuple[torch.Tensor, torch.Tensor], _Lit.apply(*rows, vector, *of_lamps, still))
    return LampLight(returned.reshape(*shape, 3), given / (3 * max(1, len(rows[0]))))


def _check(*tensors: torch.Tensor) -> None:
    """Refuse what the kernels cannot read."""
    for one in tensors:
        if one.dtype != torch.float32 or one.device.type != "cpu":
            raise ValueError(f"expected float32 on the CPU, got {one.dtype} on {one.device}")


class _Still(NamedTuple):
    """Inputs that take no gradient: one row a surface."""

    points: torch.Tensor
    eye: torch.Tensor
    shares: torch.Tensor | None
    known: torch.Tensor
    softened: float


class _Lit(torch.autograd.Function):
    """The kernels as one differentiable step."""

    @staticmethod
    def forward(ctx: Any, *inputs: Any) -> tuple[torch.Tensor, torch.Tensor]:
        """From rows of normals, base colours, roughness, metallic and vectors, the lamps' four and a rest."""
        from graycard.methods.shading._lamp_kernels import LANES, PARTS, lit  # Numba takes long to import

        *tensors, still = inputs
        ctx.save_for_backward(*tensors)
        ctx.still = still
        surfaces, lamps = _surfaces(tensors[:5], still), _lamp_rows(tensors[5:], still)
        returned = torch.empty(surfaces.counted.size, 3)
        given = np.zeros((PARTS, len(still.known), LANES), np.float32)
        lit(surfaces, lamps, still.softened, given.ravel(), returned.view(-1).numpy())
        sums = given.sum(axis=(0, 2), dtype=np.float64).astype(np.float32)
        return returned[: len(tensors[0])], torch.from_numpy(sums)

    @staticmethod
    @once_differentiable
    def backward(  # type: ignore[override]  # the decorator hides the name of ctx from type checkers
        ctx: Any, *grad_outputs: torch.Tensor
    ) -> tuple[torch.Tensor | None, ...]:
        """Gradients of all but the rest."""
        from graycard.methods.shading._lamp_backward_kernels import (
            OF_LAMP,
            OF_LOBE,
            ToSurfaces,
            lit_backward,
        )
        from graycard.methods.shading._lamp_kernels import LANES, PARTS

        tensors, still = ctx.saved_tensors, ctx.still
        surfaces, lamps = _surfaces(tensors[:5], still), _lamp_rows(tensors[5:], still)
        count, lobes = tensors[7].shape
        sums = np.zeros((PARTS, count, OF_LAMP + OF_LOBE * lobes, LANES), np.float32)
        rows = surfaces.counted.size
        widths = (3, 3, 1, 1, 0 if tensors[4] is None else 3)
        found = [np.empty(rows * width, np.float32) for width in widths]
        upstream = contiguous_array(grad_outputs[1]), _filled(grad_outputs[0], rows)
        lit_backward(surfaces, lamps, still.softened, upstream, sums.ravel(), ToSurfaces(*found))
        to_rows = [
            None if width == 0 else torch.from_numpy(one.reshape(rows, width)[: len(tensors[0])])
            for one, width in zip(found, widths, strict=True)
        ]
        to_lamps = torch.from_numpy(sums.sum(axis=(0, 3), dtype=np.float64).astype(np.float32))
        to_lobes = to_lamps[:, OF_LAMP:].reshape(count, lobes, OF_LOBE)
        axes, sharpness, amplitudes = to_lobes.split([3, 1, 3], dim=-1)
        return *to_rows, to_lamps[:, :OF_LAMP], axes, sharpness[..., 0], amplitudes, None


def _surfaces(rows: Any, still: _Still) -> Any:
    """Return the surfaces as the kernels read them: the last fill a vector."""
    from graycard.methods.shading._lamp_kernels import LANES, Surfaces

    normal, base_color, roughness, metallic, vector = rows
    count = len(normal)
    size = -(-count // LANES) * LANES
    counted = np.zeros(size, np.float32)
    counted[:count] = 1
    shares = None if still.shares is None else still.shares.T
    return cast(Any, Surfaces)(
        *(_filled(one, size) for one in (still.points, normal, still.eye, base_color, roughness, metallic)),
        _nothing() if vector is None else _filled(vector, size),
        _nothing() if shares is None else np.concatenate([_filled(one[:, None], size) for one in shares]),
        counted,
    )


def _lamp_rows(tensors: Any, still: _Still) -> Any:
    from graycard.methods.shading._lamp_kernels import LampRows

    return LampRows(*(contiguous_array(one).reshape(-1) for one in (*tensors, still.known)))


def _nothing() -> np.ndarray:
    return np.empty(0, np.float32)


def _filled(rows: torch.Tensor, size: int) -> np.ndarray:
    """Rows ``(S, C)``, flat; the last is repeated until there are so many."""
    array = contiguous_array(rows)
    if len(array) < size:
        array = np.concatenate([array, np.repeat(array[-1:], size - len(array), axis=0)])
    return array.reshape(-1)
