# SPDX-License-Identifier: Apache-2.0
"""Many vectors at once: tuples of :mod:`_simd` vectors whose number the compiler knows.

A tuple of sums that a loop carries stays in registers, whatever the number of channels: Numba compiles a
kernel once for each length. The length comes from the tuple itself or from a ``template``, a tuple of
integers of which only the length counts.
"""

from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError

from graycard.methods.splat.simd._vector import (
    LANES,
    _address,
    _call,
    _constant,
    _fold_pair,
    _instruction,
    _splat,
    float32x16,
)

_INT, _WORD = ir.IntType(32), ir.IntType(64)
_VECTOR, _INT_VECTOR = ir.VectorType(ir.FloatType(), LANES), ir.VectorType(_INT, LANES)
_ROUNDER = 1.5 * 2**23
"""Added to a float32 of less than 2^22, it leaves the nearest integer in the lowest bits."""
_EXP2 = (1.000000072, 0.6931469671, 0.2402211972, 0.05550713274, 0.009675541334, 0.001327647187)
"""Return the same as in :func:`_simd.exp2`."""


def _count(given: types.Type) -> int:
    """Length of a tuple.

    Raises:
        TypingError: It is none, or empty.
    """
    if not isinstance(given, types.UniTuple) or given.count < 1:
        raise TypingError(f"expected a tuple of one or more, got {given}")
    return given.count


def _vectors(given: types.Type) -> types.UniTuple:
    """Return the type of a tuple of vectors.

    Raises:
        TypingError: It is none.
    """
    if not isinstance(given, types.UniTuple) or given.dtype != float32x16:
        raise TypingError(f"expected a tuple of float32x16, got {given}")
    return given


def _pack(builder: ir.IRBuilder, values: Sequence[Any]) -> Any:
    return cgutils.pack_array(builder, list(values))


def _unpack(builder: ir.IRBuilder, values: Any, count: int) -> list[Any]:
    return [builder.extract_value(values, index) for index in range(count)]


def _element(builder: ir.IRBuilder, first: Any, index: int) -> Any:
    return builder.gep(first, [ir.Constant(_WORD, index)], inbounds=True)


def _load(builder: ir.IRBuilder, pointer: Any) -> Any:
    return builder.load(builder.bitcast(pointer, _VECTOR.as_pointer()), align=4)


def _fused(builder: ir.IRBuilder, a: Any, b: Any, c: Any) -> Any:
    return _call(builder, "llvm.fmuladd.v16f32", [a, b, c])


@_instruction
def repeat(typing: Any, vector: types.Type, template: types.Type) -> Any:
    """Return the same vector in every place."""
    result = types.UniTuple(float32x16, _count(template))

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return _pack(builder, [given[0]] * result.count)

    return result(vector, template), code


@_instruction
def load_many(typing: Any, array: types.Type, offset: types.Type, template: types.Type) -> Any:
    """Consecutive vectors from ``array[offset:]``."""
    result = types.UniTuple(float32x16, _count(template))

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        first = _address(context, builder, signature, given)
        places = [_element(builder, first, index * LANES) for index in range(result.count)]
        return _pack(builder, [_load(builder, place) for place in places])

    return result(array, offset, template), code


@_instruction
def store_many(typing: Any, array: types.Type, offset: types.Type, vectors: types.Type) -> Any:
    """Write consecutive vectors to ``array[offset:]``."""
    count = _vectors(vectors).count

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        first = _address(context, builder, signature, given)
        for index, vector in enumerate(_unpack(builder, given[2], count)):
            place = builder.bitcast(_element(builder, first, index * LANES), _VECTOR.as_pointer())
            builder.store(vector, place, align=4)
        return context.get_dummy_value()

    return types.void(array, offset, vectors), code


@_instruction
def add_scaled(typing: Any, sums: types.Type, by: types.Type, array: types.Type, offset: types.Type) -> Any:
    """Sum i plus the vector ``by`` times the number ``array[offset + i]``."""
    result = _vectors(sums)

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        pair = types.void(*signature.args[2:])
        first = _address(context, builder, pair, given[2:])
        numbers = [builder.load(_element(builder, first, index)) for index in range(result.count)]
        olds = _unpack(builder, given[0], result.count)
        return _pack(
            builder,
            [
                _fused(builder, _splat(builder, number), given[1], old)
                for number, old in zip(numbers, olds, strict=True)
            ],
        )

    return result(sums, by, array, offset), code


@_instruction
def add_products(typing: Any, sums: types.Type, by: types.Type, vectors: types.Type) -> Any:
    """Sum i plus the vector ``by`` times vector i."""
    result = _vectors(sums)

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        olds, factors = _unpack(builder, given[0], result.count), _unpack(builder, given[2], result.count)
        return _pack(
            builder, [_fused(builder, given[1], f, old) for f, old in zip(factors, olds, strict=True)]
        )

    if _vectors(vectors).count != result.count:
        raise TypingError(f"expected {result.count} vectors, got {vectors}")
    return result(sums, by, vectors), code


@_instruction
def add_dot(
    typing: Any, start: types.Type, array: types.Type, offset: types.Type, vectors: types.Type
) -> Any:
    """Return the vector ``start`` plus the sum over i of ``array[offset + i]`` times vector i.

    Two partial sums, for one would have to wait for itself.
    """
    count = _vectors(vectors).count

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        pair = types.void(*signature.args[1:3])
        first = _address(context, builder, pair, given[1:3])
        partial = [given[0], _constant(0.0)]
        for index, vector in enumerate(_unpack(builder, given[3], count)):
            number = _splat(builder, builder.load(_element(builder, first, index)))
            partial[index % 2] = _fused(builder, number, vector, partial[index % 2])
        return builder.fadd(*partial) if count > 1 else partial[0]

    return float32x16(start, array, offset, vectors), code


@_instruction
def add_pairs(typing: Any, start: types.Type, a: types.Type, b: types.Type) -> Any:
    """Return the vector ``start`` plus the sum over i of vector i of a times vector i of b."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        total = given[0]
        for x, y in zip(*(_unpack(builder, values, count) for values in given[1:]), strict=True):
            total = _fused(builder, x, y, total)
        return total

    count = _vectors(a).count
    if _vectors(b).count != count:
        raise TypingError(f"expected {count} vectors, got {b}")
    return float32x16(start, a, b), code


@_instruction
def add_rows(typing: Any, sums: types.Type, array: types.Type, offset: types.Type, rows: types.Type,
             first_row: types.Type, stride: types.Type) -> Any:  # fmt: skip
    """Add sixteen rows of sixteen, each times a number, to the sums in turn.

    Row p is ``rows[first_row + p * stride:]``, its factor ``array[offset + p]``.
    """
    result = _vectors(sums)

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        def address(places: slice) -> Any:
            pair = types.void(*signature.args[places])
            return _address(context, builder, pair, given[places])

        factor, row = address(slice(1, 3)), address(slice(3, 5))
        step = context.cast(builder, given[5], signature.args[5], types.intp)
        partial = _unpack(builder, given[0], result.count)
        for pixel in range(LANES):
            number = _splat(builder, builder.load(_element(builder, factor, pixel)))
            place = pixel % result.count
            partial[place] = _fused(builder, number, _load(builder, row), partial[place])
            row = builder.gep(row, [step], inbounds=True)
        return _pack(builder, partial)

    return result(sums, array, offset, rows, first_row, stride), code


@_instruction
def lane_sums(typing: Any, vectors: types.Type) -> Any:
    """Return a tuple of up to sixteen vectors to one: lane i is the sum of the lanes of vector i, the rest
    zero.

    A tree in a fixed order, see :func:`_simd.lane_sums`.
    """
    count = _vectors(vectors).count

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        return _lane_sums(builder, [*_unpack(builder, given[0], count), *[None] * (LANES - count)])

    return float32x16(vectors), code


@_instruction
def lane_sums_of_halves(typing: Any, low: types.Type, high: types.Type) -> Any:
    """Return the same as :func:`lane_sums` of two tuples of up to eight: the sums of the second begin at lane
    eight.

    The second tuple may not be the longer one.
    """
    counts, half = (_vectors(low).count, _vectors(high).count), LANES // 2
    if not counts[1] <= counts[0] <= half:
        raise TypingError(f"expected up to {half} float32x16 and no more of the second, got {counts}")

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        both = [_unpack(builder, values, count) for values, count in zip(given, counts, strict=True)]
        return _lane_sums(
            builder, [one for values in both for one in (*values, *[None] * (half - len(values)))]
        )

    return float32x16(low, high), code


def _lane_sums(builder: ir.IRBuilder, partial: list[Any]) -> Any:
    """Return the sums of sixteen vectors, some of them None, none of which faces another half of the list
    alone.
    """
    while len(partial) > 1:
        half = len(partial) // 2
        pairs = zip(partial[:half], partial[half:], strict=True)
        partial = [_fold(builder, x, y, half) for x, y in pairs]
    return partial[0]


def _fold(builder: ir.IRBuilder, x: Any, y: Any, half: int) -> Any:
    """Halve the lanes per sum, as the vector type does; None is a vector of zeros."""
    if x is None:
        return None
    return _fold_pair(builder, x, _constant(0.0) if y is None else y, half)


@_instruction
def decay(typing: Any, exponent: types.Type) -> Any:
    """``2 ** exponent`` as :func:`_simd.exp2`, for exponents from -126 to 0; elsewhere anything may come."""

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        shifted = builder.fadd(given[0], _constant(_ROUNDER))
        rest = builder.fsub(given[0], builder.fsub(shifted, _constant(_ROUNDER)))
        power = _constant(_EXP2[-1])
        for coefficient in _EXP2[-2::-1]:
            power = _fused(builder, power, rest, _constant(coefficient))
        shift = builder.shl(builder.bitcast(shifted, _INT_VECTOR), ir.Constant(_INT_VECTOR, [23] * LANES))
        return builder.bitcast(builder.add(builder.bitcast(power, _INT_VECTOR), shift), _VECTOR)

    return float32x16(exponent), code
