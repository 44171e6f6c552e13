# SPDX-License-Identifier: Apache-2.0
"""The examples in the docstrings say what happens."""

import doctest
import importlib

import pytest

MODULES = (
    "measures._colour_difference",
    "measures._psnr",
    "measures._ssim",
    "scoring._gauge",
    "scoring._mask",
    "protocols._find",
)


@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    result = doctest.testmod(importlib.import_module(f"graycard.eval.{module}"), optionflags=flags)
    assert result.attempted > 0
    assert result.failed == 0
