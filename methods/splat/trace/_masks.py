# SPDX-License-Identifier: Apache-2.0
"""Bit masks: which lanes of a vector pass a test, as the bits of a whole number."""

from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic

from graycard.methods.splat.simd._vector import LANES, float32x16

_BITS, _WORD = ir.IntType(LANES), ir.IntType(64)


def _instruction(definition: Any) -> Any:
    """Numba's decorator; called without the typing context, which type checkers need not know of."""
    return intrinsic(definition)


@_instruction
def mask_at_least(typing: Any, a: types.Type, b: types.Type) -> Any:
    """Bit i is one where lane i of ``a`` is at least that of ``b``; zero where one of them is NaN.

    Raises:
        TypingError: Something else than two vectors was given.
    """
    if (a, b) != (float32x16, float32x16):
        raise TypingError(f"expected float32x16 in both places, got {(a, b)}")

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return builder.zext(builder.bitcast(builder.fcmp_ordered(">=", *given), _BITS), _WORD)

    return types.int64(a, b), code


@_instruction
def lowest_bit(typing: Any, mask: types.Type) -> Any:
    """Place of the lowest bit that is one, of an int64 that is not zero."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        signature = ir.FunctionType(_WORD, [_WORD, ir.IntType(1)])
        count = cgutils.get_or_insert_function(builder.module, signature, "llvm.cttz.i64")
        return builder.call(count, [given[0], ir.Constant(ir.IntType(1), 1)])

    return types.int64(types.int64), code
