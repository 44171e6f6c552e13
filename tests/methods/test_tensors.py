# SPDX-License-Identifier: Apache-2.0
"""Conversions between arrays and tensors."""

import numpy as np
import torch

from graycard.methods._tensors import contiguous_array, contiguous_float_tensor, float_tensor


def test_values_become_float32_and_keep_their_shape():
    values = np.arange(6.0).reshape(2, 3).T
    for found in (float_tensor(values), contiguous_float_tensor(values)):
        assert found.dtype == torch.float32
        np.testing.assert_array_equal(found.numpy(), values)
    assert contiguous_float_tensor(values).is_contiguous()


def test_an_array_of_a_turned_tensor_lies_in_c_order_without_its_gradient():
    turned = torch.arange(6.0).reshape(2, 3).requires_grad_().T
    found = contiguous_array(turned)
    assert found.flags.c_contiguous
    np.testing.assert_array_equal(found, turned.detach().numpy())
