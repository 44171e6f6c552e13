# SPDX-License-Identifier: Apache-2.0
"""Beside vectors: whether any lane is above another, the bits of a word, lines of the cache."""

from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError

from graycard.methods.splat.simd._vector import LANES, _address, _call, _instruction, float32x16

_INT, _WORD = ir.IntType(32), ir.IntType(64)
_BYTE = ir.IntType(8)
_KEEP, _DATA = 3, 1
"""Arguments of LLVM's prefetch: into all levels of the cache; not instructions."""


@_instruction
def any_above(typing: Any, values: types.Type, limits: types.Type) -> Any:
    """1 where a lane of the first vector is above that of the second, else 0."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        lanes = builder.bitcast(builder.fcmp_ordered(">", *given), ir.IntType(LANES))
        return builder.zext(builder.icmp_unsigned("!=", lanes, ir.Constant(ir.IntType(LANES), 0)), _WORD)

    if (values, limits) != (float32x16, float32x16):
        raise TypingError(f"expected two float32x16, got {values} and {limits}")
    return types.int64(values, limits), code


@_instruction
def lowest_bit(typing: Any, bits: types.Type) -> Any:
    """Place of the lowest bit that is set in 64; at least one must be."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return builder.cttz(given[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.uint64), code


@_instruction
def bit_count(typing: Any, bits: types.Type) -> Any:
    """Return how many of 64 bits are set."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return builder.ctpop(given[0])

    return types.int64(types.uint64), code


def _prefetch(writes: bool, summary: str) -> Any:
    """Return an intrinsic that asks for one line of the cache."""

    def ask(typing: Any, array: types.Type, offset: types.Type) -> Any:
        def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
            pointer = builder.bitcast(_address(context, builder, signature, given), _BYTE.as_pointer())
            kind = [ir.Constant(_INT, int(writes)), ir.Constant(_INT, _KEEP), ir.Constant(_INT, _DATA)]
            _call(builder, "llvm.prefetch.p0", [pointer, *kind], ir.VoidType())
            return context.get_dummy_value()

        return types.void(array, offset), code

    ask.__doc__ = summary
    return _instruction(ask)


prefetch = _prefetch(False, "Have the line of the cache brought that holds ``array[offset]``, to be read.")
prefetch_to_write = _prefetch(True, "The same for a line that is to be written.")
