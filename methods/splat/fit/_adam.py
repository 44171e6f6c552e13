# SPDX-License-Identifier: Apache-2.0
"""Adam (Kingma and Ba 2015) on tensors of either device."""

from collections.abc import Sequence

import torch
from torch.optim.adam import adam

from graycard.methods.splat._devices import DEVICES, is_on_cpu
from graycard.methods.splat.fit._moved import BETA_1, BETA_2, Moved


def move_all(parameters: Sequence[Moved], epsilon: float) -> None:
    """Move parameters in place: on the CPU by a kernel, on a GPU by PyTorch's own Adam.

    Raises:
        ValueError: Tensors of a parameter are not float32 on one device, in C order and of one shape.
    """
    for one in parameters:
        _check(one)
    if not parameters:
        return
    if not is_on_cpu(parameters[0].values):
        for one in parameters:
            move_by_pytorch(one, epsilon)
        return
    from graycard.methods.splat.fit._adam_kernel import move_by_kernel  # Numba takes long to import

    move_by_kernel(parameters, epsilon)


def move_by_pytorch(one: Moved, epsilon: float) -> None:
    """Move a parameter in place, some operations at a time on all its numbers."""
    steps = torch.tensor(one.steps - 1.0)  # PyTorch counts the move itself
    adam(
        [one.values], [one.gradient], [one.first], [one.second], [], [steps], foreach=True, amsgrad=False,
        beta1=BETA_1, beta2=BETA_2, lr=one.rate, weight_decay=0.0, eps=epsilon, maximize=False,
    )  # fmt: skip


def _check(one: Moved) -> None:
    for tensor in (one.values, one.gradient, one.first, one.second):
        sound = tensor.dtype == torch.float32 and tensor.device.type in DEVICES and tensor.is_contiguous()
        if not sound or (tensor.shape, tensor.device) != (one.values.shape, one.values.device):
            raise ValueError(
                "expected tensors in float32 on the CPU or a GPU, in C order and of one shape, got "
                f"{tensor.dtype} on {tensor.device} of shape {tuple(tensor.shape)}"
            )
