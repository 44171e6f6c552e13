# SPDX-License-Identifier: Apache-2.0
"""A vector of eight float64 for Numba, used as a number is: formulas on numbers hold for eight at once.

Its data model is LLVM's ``<8 x double>``: one AVX-512 register, two of AVX, four of SSE or NEON. The remarks
of :mod:`_vector` hold here too. The operators ``+ - * /`` and the functions take numbers in the place of
vectors, as long as there is a vector too. Each lane has the bits that scalar code would have.
"""

import operator
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import lower_builtin, models, register_model, type_callable

from graycard.methods.splat.simd._vector import _address, _call, _instruction

LANES = 8

_INT = ir.IntType(32)
_VECTOR, _SINGLES = ir.VectorType(ir.DoubleType(), LANES), ir.VectorType(ir.FloatType(), LANES)


class Float64x8(types.Type):
    """The Numba type."""

    def __init__(self) -> None:
        super().__init__(name="float64x8")


float64x8 = Float64x8()


@register_model(Float64x8)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, numba_type: types.Type) -> None:
        super().__init__(manager, numba_type, _VECTOR)


def _operand(context: Any, builder: ir.IRBuilder, given: types.Type, value: Any) -> Any:
    """Return a vector as it is, a number in all lanes."""
    if given == float64x8:
        return value
    empty = ir.Constant(_VECTOR, ir.Undefined)
    scalar = context.cast(builder, value, given, types.float64)
    first = builder.insert_element(empty, scalar, ir.Constant(_INT, 0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(_INT, LANES), [0] * LANES))


def _on_vectors(generate: Callable[..., Any]) -> Callable[..., Any]:
    """Numba's code for vectors and numbers, from what makes LLVM's code for vectors."""

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        pairs = zip(signature.args, given, strict=True)
        return generate(builder, *(_operand(context, builder, kind, value) for kind, value in pairs))

    return code


def _signature(*given: types.Type) -> Any:
    """From vectors and numbers to a vector.

    Raises:
        TypingError: Something else was given, or no vector.
    """
    if float64x8 not in given or any(not isinstance(one, Float64x8 | types.Number) for one in given):
        raise TypingError(f"expected float64x8 and numbers, at least one vector among them, got {given}")
    return float64x8(*given)


def _lanewise(name: str, summary: str) -> Any:
    """Return an intrinsic that calls one of LLVM's on each lane."""

    def operation(typing: Any, values: types.Type) -> Any:
        def generate(builder: ir.IRBuilder, given: Any) -> Any:
            return _call(builder, f"llvm.{name}.v{LANES}f64", [given], _VECTOR)

        return _signature(values), _on_vectors(generate)

    operation.__doc__ = summary
    return _instruction(operation)


def _extreme(comparison: str, summary: str) -> Any:
    """Return an intrinsic from two vectors to one."""

    def operation(typing: Any, a: types.Type, b: types.Type) -> Any:
        def generate(builder: ir.IRBuilder, x: Any, y: Any) -> Any:
            return builder.select(builder.fcmp_ordered(comparison, x, y), x, y)

        return _signature(a, b), _on_vectors(generate)

    operation.__doc__ = summary
    return _instruction(operation)


square_root = _lanewise("sqrt", "Rounded as IEEE 754 has it; NaN of negative numbers.")
floor = _lanewise("floor", "The whole number at or below each lane.")
ceil = _lanewise("ceil", "The whole number at or above each lane.")
minimum = _extreme("<", "The smaller of each lane; the second where one is NaN.")
maximum = _extreme(">", "The larger of each lane; the second where one is NaN.")


@_instruction
def where_less(typing: Any, a: types.Type, b: types.Type, yes: types.Type, no: types.Type) -> Any:
    """Lanes of ``yes`` where a < b, else of ``no``."""

    def generate(builder: ir.IRBuilder, a: Any, b: Any, yes: Any, no: Any) -> Any:
        return builder.select(builder.fcmp_ordered("<", a, b), yes, no)

    return _signature(a, b, yes, no), _on_vectors(generate)


@_instruction
def rounded_to_float32(typing: Any, values: types.Type) -> Any:
    """Each lane as float32 has it."""

    def generate(builder: ir.IRBuilder, given: Any) -> Any:
        return builder.fpext(builder.fptrunc(given, _SINGLES), _VECTOR)

    return _signature(values), _on_vectors(generate)


@_instruction
def load(typing: Any, array: types.Type, offset: types.Type) -> Any:
    """Eight float64 from ``array[offset:]``; no alignment is needed."""

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        pointer = builder.bitcast(_address(context, builder, signature, given), _VECTOR.as_pointer())
        return builder.load(pointer, align=8)

    return float64x8(array, offset), code


@_instruction
def store(typing: Any, array: types.Type, offset: types.Type, values: types.Type) -> Any:
    """Write eight float64 to ``array[offset:]``; no alignment is needed."""

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        pointer = builder.bitcast(_address(context, builder, signature, given), _VECTOR.as_pointer())
        value = _operand(context, builder, signature.args[2], given[2])
        builder.store(value, pointer, align=8)
        return context.get_dummy_value()

    return types.void(array, offset, values), code


def _define_operator(symbol: Callable[..., Any], instruction: str) -> None:
    """Teach Numba what an operator of Python means between vectors, or a vector and a number."""

    @type_callable(symbol)
    def _typer(_context: Any) -> Callable[..., types.Type | None]:
        def typer(a: types.Type, b: types.Type) -> types.Type | None:
            kinds = [isinstance(one, Float64x8 | types.Number) for one in (a, b)]
            return float64x8 if all(kinds) and float64x8 in (a, b) else None

        return typer

    generate = _on_vectors(lambda builder, a, b: getattr(builder, instruction)(a, b))
    for pair in ((Float64x8, Float64x8), (Float64x8, types.Number), (types.Number, Float64x8)):
        lower_builtin(symbol, *pair)(generate)


_define_operator(operator.add, "fadd")
_define_operator(operator.sub, "fsub")
_define_operator(operator.mul, "fmul")
_define_operator(operator.truediv, "fdiv")


@type_callable(operator.neg)
def _type_of_negative(_context: Any) -> Callable[..., types.Type | None]:
    def typer(a: types.Type) -> types.Type | None:
        return float64x8 if a == float64x8 else None

    return typer


@lower_builtin(operator.neg, Float64x8)
def _negative(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
    return builder.fneg(given[0])
