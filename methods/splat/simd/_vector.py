# SPDX-License-Identifier: Apache-2.0
"""A vector of sixteen float32 for Numba: values stay in registers, one instruction works on all lanes.

Numba turns loops into vector code only as far as LLVM proves that it may; kernels that carry state
across many small blocks stay scalar and run several times slower. Here the vector is a value of a type
of its own, whose data model is LLVM's ``<16 x float>``: one AVX-512 register, two of AVX, four of SSE or
NEON. Everything below works inside ``numba.njit`` functions only, on the operators ``+ - * /`` as well.

Arithmetic is IEEE 754, without fast-math: infinities and NaN are what they are. Offsets are in floats,
into contiguous one-dimensional float32 arrays, and are not checked.

Functions that Numba cached do not see later changes of this file: delete their ``__pycache__``.
"""

import operator
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

LANES = 16
EXP2_ERROR = 4e-7
"""Bound of the relative error of :func:`exp2`: 1.6e-7 of the polynomial, the rest is rounding."""
EXP2_RANGE = 126.0
"""Arguments of :func:`exp2` are clamped to plus or minus this: results stay normal float32 numbers."""

_EXP2_COEFFICIENTS = (1.000000072, 0.6931469671, 0.2402211972, 0.05550713274, 0.009675541334, 0.001327647187)
"""Minimax polynomial of 2^f for |f| <= 1/2 in relative error, degree 5, by Lawson's reweighting."""

_FLOAT, _INT = ir.FloatType(), ir.IntType(32)
_VECTOR, _INT_VECTOR = ir.VectorType(_FLOAT, LANES), ir.VectorType(_INT, LANES)


class Float32x16(types.Type):
    """The Numba type."""

    def __init__(self) -> None:
        super().__init__(name="float32x16")


float32x16 = Float32x16()


@register_model(Float32x16)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, numba_type: types.Type) -> None:
        super().__init__(manager, numba_type, _VECTOR)


def _instruction(definition: Callable[..., Any]) -> Any:
    """Numba's decorator; called without the typing context, which type checkers need not know of."""
    return intrinsic(definition)


def _constant(value: float) -> ir.Constant:
    return ir.Constant(_VECTOR, [float(value)] * LANES)


def _call(builder: ir.IRBuilder, name: str, arguments: Sequence[Any], result: ir.Type = _VECTOR) -> Any:
    """Call an LLVM intrinsic."""
    signature = ir.FunctionType(result, [argument.type for argument in arguments])
    return builder.call(cgutils.get_or_insert_function(builder.module, signature, name), arguments)


def _splat(builder: ir.IRBuilder, scalar: Any) -> Any:
    """One float in all lanes."""
    empty = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(empty, scalar, ir.Constant(_INT, 0))
    return builder.shuffle_vector(first, empty, ir.Constant(_INT_VECTOR, [0] * LANES))


def _address(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[Any]) -> Any:
    """Return the address of the element at an offset (second argument) in an array (first argument)."""
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    offset = context.cast(builder, arguments[1], signature.args[1], types.intp)
    return builder.gep(array.data, [offset], inbounds=True)


def _signature(*given: types.Type) -> Any:
    """From vectors to a vector.

    Raises:
        TypingError: Something else was given.
    """
    if any(one != float32x16 for one in given):
        raise TypingError(f"expected float32x16 in every place, got {given}")
    return float32x16(*given)


def _binary(generate: Callable[..., Any], summary: str) -> Any:
    """Return an intrinsic from two vectors to one."""

    def operation(typing: Any, a: types.Type, b: types.Type) -> Any:
        return _signature(a, b), lambda _context, builder, _types, given: generate(builder, *given)

    operation.__doc__ = summary
    return _instruction(operation)


def _selection(comparison: str, summary: str) -> Any:
    """Return an intrinsic that takes lanes from one of two vectors by comparing two others."""

    def select(typing: Any, a: types.Type, b: types.Type, yes: types.Type, no: types.Type) -> Any:
        def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
            mask = builder.fcmp_ordered(comparison, given[0], given[1])
            return builder.select(mask, given[2], given[3])

        return _signature(a, b, yes, no), code

    select.__doc__ = summary
    return _instruction(select)


def _smaller(builder: ir.IRBuilder, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered("<", a, b), a, b)


def _larger(builder: ir.IRBuilder, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


minimum = _binary(_smaller, "The smaller of each lane; the second where one is NaN.")
maximum = _binary(_larger, "The larger of each lane; the second where one is NaN.")
where_less = _selection("<", "``where_less(a, b, yes, no)``: yes where a < b, else no.")
where_at_least = _selection(">=", "``where_at_least(a, b, yes, no)``: yes where a >= b, else no.")


@_instruction
def load(typing: Any, array: types.Type, offset: types.Type) -> Any:
    """Sixteen floats from ``array[offset:]``; no alignment is needed."""

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        pointer = builder.bitcast(_address(context, builder, signature, given), _VECTOR.as_pointer())
        return builder.load(pointer, align=4)

    return float32x16(array, offset), code


@_instruction
def store(typing: Any, array: types.Type, offset: types.Type, values: types.Type) -> Any:
    """Write sixteen floats to ``array[offset:]``; no alignment is needed."""

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        pointer = builder.bitcast(_address(context, builder, signature, given), _VECTOR.as_pointer())
        builder.store(given[2], pointer, align=4)
        return context.get_dummy_value()

    return types.void(array, offset, values), code


@_instruction
def load_scalar(typing: Any, array: types.Type, offset: types.Type) -> Any:
    """``array[offset]`` in all lanes."""

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        return _splat(builder, builder.load(_address(context, builder, signature, given)))

    return float32x16(array, offset), code


@_instruction
def broadcast(typing: Any, scalar: types.Type) -> Any:
    """Return a number, as float32, in all lanes."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return _splat(builder, given[0])

    return float32x16(types.float32), code


@_instruction
def fma(typing: Any, a: types.Type, b: types.Type, c: types.Type) -> Any:
    """Return ``a * b + c``: rounded once where the processor can, else twice (and never by a
    library call).
    """

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return _call(builder, "llvm.fmuladd.v16f32", given)

    return _signature(a, b, c), code


@_instruction
def fnma(typing: Any, a: types.Type, b: types.Type, c: types.Type) -> Any:
    """``c - a * b``, rounded as :func:`fma` is."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return _call(builder, "llvm.fmuladd.v16f32", [builder.fneg(given[0]), given[1], given[2]])

    return _signature(a, b, c), code


@_instruction
def square_root(typing: Any, values: types.Type) -> Any:
    """Return rounded as IEEE 754 has it; NaN of negative numbers."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return _call(builder, "llvm.sqrt.v16f32", given)

    return _signature(values), code


@_instruction
def exp2(typing: Any, exponent: types.Type) -> Any:
    """``2 ** exponent`` with a relative error below ``EXP2_ERROR``, arguments clamped to ``EXP2_RANGE``.

    The exponent splits into an integer, which goes into the exponent bits, and a rest of at most one
    half, for which a polynomial stands. No NaN may come.
    """

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        clamped = _larger(builder, _smaller(builder, given[0], _constant(EXP2_RANGE)), _constant(-EXP2_RANGE))
        whole = _call(builder, "llvm.rint.v16f32", [clamped])
        rest = builder.fsub(clamped, whole)
        power = _constant(_EXP2_COEFFICIENTS[-1])
        for coefficient in _EXP2_COEFFICIENTS[-2::-1]:
            power = _call(builder, "llvm.fmuladd.v16f32", [power, rest, _constant(coefficient)])
        shift = builder.shl(builder.fptosi(whole, _INT_VECTOR), ir.Constant(_INT_VECTOR, [23] * LANES))
        return builder.bitcast(builder.add(builder.bitcast(power, _INT_VECTOR), shift), _VECTOR)

    return _signature(exponent), code


@_instruction
def largest_lane(typing: Any, values: types.Type) -> Any:
    """Return the largest of the sixteen, a float32. No NaN may come."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return _call(builder, "llvm.vector.reduce.fmax.v16f32", given, _FLOAT)

    _signature(values)
    return types.float32(values), code


def _fold_pair(builder: ir.IRBuilder, x: Any, y: Any, half: int) -> Any:
    """Halve the lanes per sum: x's sums go to the lower halves of groups of ``2 * half`` lanes, y's above."""
    kept: list[int] = []
    for start in range(0, LANES, 2 * half):
        kept += [*range(start, start + half), *range(LANES + start, LANES + start + half)]
    low = builder.shuffle_vector(x, y, ir.Constant(_INT_VECTOR, kept))
    high = builder.shuffle_vector(x, y, ir.Constant(_INT_VECTOR, [lane + half for lane in kept]))
    return builder.fadd(low, high)


@_instruction
def lane_sums(typing: Any, vectors: types.Type) -> Any:
    """Return a tuple of sixteen vectors to one vector: lane i is the sum of the lanes of vector i.

    A tree of 15 additions and 30 shuffles in a fixed order, where sixteen sums one by one take 64 of each.
    """
    if not isinstance(vectors, types.UniTuple) or (vectors.dtype, vectors.count) != (float32x16, LANES):
        raise TypingError(f"expected a tuple of {LANES} float32x16, got {vectors}")

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        partial = [builder.extract_value(given[0], index) for index in range(LANES)]
        while len(partial) > 1:
            half = len(partial) // 2
            pairs = zip(partial[:half], partial[half:], strict=True)
            partial = [_fold_pair(builder, x, y, half) for x, y in pairs]
        return partial[0]

    return float32x16(vectors), code


def _define_operator(symbol: Callable[..., Any], instruction: str) -> None:
    """Teach Numba what an operator of Python means between two vectors."""

    @type_callable(symbol)
    def _typer(_context: Any) -> Callable[..., types.Type | None]:
        def typer(a: types.Type, b: types.Type) -> types.Type | None:
            return float32x16 if a == float32x16 and b == float32x16 else None

        return typer

    @lower_builtin(symbol, float32x16, float32x16)
    def _code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return getattr(builder, instruction)(*given)


_define_operator(operator.add, "fadd")
_define_operator(operator.sub, "fsub")
_define_operator(operator.mul, "fmul")
_define_operator(operator.truediv, "fdiv")
