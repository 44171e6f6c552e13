# SPDX-License-Identifier: Apache-2.0
"""A device that stands in for a GPU where there is none: it computes on the CPU, and is as strict.

A tensor on it says that it lies on ``cuda:0``, NumPy cannot read it, and an operation on it and on a tensor
of the CPU fails as on a GPU: only numbers without dimension, and indices, may be left on the CPU.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_map, tree_map_only

GPU = torch.device("cuda", 0)
_INDEXED = (torch.ops.aten.index.Tensor, torch.ops.aten.index_put.default, torch.ops.aten.index_put_.default)
"""Operations whose indices may lie on the CPU."""
_TOGETHER = (torch.ops.aten.cat.default, torch.ops.aten.stack.default)
"""Operations that leave no number on the CPU."""


class OnGpu(torch.Tensor):
    """A tensor of the CPU that says that it lies on the GPU."""

    held: torch.Tensor

    @staticmethod
    def __new__(cls, inner: torch.Tensor) -> "OnGpu":
        made = torch.Tensor._make_wrapper_subclass(  # pyright: ignore[reportAttributeAccessIssue]
            cls, inner.shape, strides=inner.stride(), storage_offset=inner.storage_offset(),
            dtype=inner.dtype, device=inner.device,
        )  # fmt: skip
        made.held = inner.detach()
        return made

    @property
    def device(self) -> torch.device:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Say that it is a GPU."""
        return GPU

    def __repr__(self, *, tensor_contents: Any = None) -> str:
        return f"OnGpu({self.held!r})"

    @classmethod
    def __torch_dispatch__(cls, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = dict(kwargs or {})
        if func is torch.ops.aten.copy_.default:
            _inner(args[0]).copy_(_inner(args[1]))
            return args[0]
        _check_places(func, args, kwargs)
        before = {id(_inner(one)): one for one in _tensors((args, kwargs)) if isinstance(one, OnGpu)}
        found = func(*tree_map(_inner, args), **tree_map(_inner, kwargs))
        return tree_map_only(
            torch.Tensor, lambda one: before[id(one)] if id(one) in before else OnGpu(one), found
        )

    def numpy(self, *args: Any, **kwargs: Any) -> Any:
        """Refuse, as a tensor on a GPU does."""
        raise TypeError("can't convert cuda:0 device type tensor to numpy")

    def tolist(self) -> Any:
        """Give the numbers."""
        return self.held.tolist()

    def __array__(self, *args: Any, **kwargs: Any) -> Any:
        raise TypeError("can't convert cuda:0 device type tensor to numpy")


def _check_places(func: Any, args: Any, kwargs: Any) -> None:
    """Refuse tensors of both devices; zeros that autograd puts in the place of a gradient know no device."""
    in_autograd = torch._C._current_graph_task_id() != -1
    for one in _tensors((args[:1], args[2:], kwargs) if func in _INDEXED else (args, kwargs)):
        if isinstance(one, OnGpu) or (in_autograd and not one.any()):
            continue
        if one.ndim or func in _TOGETHER:
            raise RuntimeError(
                "Expected all tensors to be on the same device, but found at least two, cuda:0 and cpu: "
                f"{func} with one of shape {tuple(one.shape)}"
            )


def _inner(value: Any) -> Any:
    return value.held if isinstance(value, OnGpu) else value


def _tensors(values: Any) -> Iterator[torch.Tensor]:
    found: list[torch.Tensor] = []
    tree_map_only(torch.Tensor, found.append, values)
    yield from found


class _Factories(TorchFunctionMode):
    """Tensors that are made on the GPU, or moved between it and the CPU."""

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = dict(kwargs or {})
        if func is torch.Tensor.cpu or func is torch.Tensor.cuda:
            return _sent(args[0], "cpu" if func is torch.Tensor.cpu else GPU, args[0].dtype)
        if func is torch.Tensor.to:
            return _sent(args[0], *_destination(*args, **kwargs))
        if func is torch.Tensor.new_tensor and isinstance(args[0], OnGpu):
            dtype = kwargs.get("dtype", args[0].dtype)
            return OnGpu(torch.tensor(args[1], dtype=dtype))
        device = kwargs.get("device")
        if device is None or torch.device(device).type != "cuda":
            return func(*args, **kwargs)
        wants = kwargs.pop("requires_grad", False)
        made = OnGpu(func(*tree_map(_inner, args), **{**kwargs, "device": "cpu"}))
        return made.requires_grad_() if wants else made


def _destination(value: torch.Tensor, *rest: Any, **kwargs: Any) -> tuple[Any, torch.dtype]:
    """Device and dtype out of what ``to`` is given, in any order."""
    device, dtype = value.device, value.dtype
    for part in (*rest, kwargs.get("device"), kwargs.get("dtype"), kwargs.get("other")):
        if isinstance(part, torch.Tensor):
            device, dtype = part.device, part.dtype
        elif isinstance(part, torch.dtype):
            dtype = part
        elif isinstance(part, torch.device | str):
            device = part
    return device, dtype


def _sent(value: torch.Tensor, device: Any, dtype: torch.dtype) -> torch.Tensor:
    if value.dtype != dtype:
        value = value.type(dtype)
    there = torch.device(device).type == "cuda"
    if there == isinstance(value, OnGpu):
        return value
    return _ToGpu.apply(value) if there else _FromGpu.apply(value)  # pyright: ignore[reportReturnType]


class _ToGpu(torch.autograd.Function):
    """A way to the GPU."""

    @staticmethod
    def forward(ctx: Any, value: torch.Tensor) -> torch.Tensor:
        """The tensor on the GPU: a copy."""
        return OnGpu(value.detach().clone())

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Any) -> Any:
        """The gradient on the CPU."""
        return grad_outputs[0].held.clone() if isinstance(grad_outputs[0], OnGpu) else grad_outputs[0]


class _FromGpu(torch.autograd.Function):
    """A way back."""

    @staticmethod
    def forward(ctx: Any, value: Any) -> torch.Tensor:
        """The tensor on the CPU: a copy."""
        return value.held.detach().clone()

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Any) -> Any:
        """The gradient on the GPU."""
        return OnGpu(grad_outputs[0].detach().clone())


@contextmanager
def stand_in_gpu() -> Iterator[torch.device]:
    """Give the device, for as long as tensors are made on it."""
    with _Factories():
        yield GPU


def by_inner(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function, of the place of a GPU's kernels, that computes with tensors of the CPU."""

    def called(*args: Any, **kwargs: Any) -> Any:
        found = function(
            *tree_map_only(torch.Tensor, _back, args), **tree_map_only(torch.Tensor, _back, kwargs)
        )
        return tree_map_only(torch.Tensor, lambda one: one.to(GPU), found)

    return called


def _back(one: torch.Tensor) -> torch.Tensor:
    return one.to("cpu") if isinstance(one, OnGpu) else one
