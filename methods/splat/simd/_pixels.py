# SPDX-License-Identifier: Apache-2.0
"""Pixels of interleaved images as vectors: one a channel, with a lane a pixel.

Sixteen pixels are a block of 4 x 4, row-major, or a piece of a line. What is contiguous is loaded whole and
its floats are dealt out to the channels: pixel by pixel and channel by channel the same takes longer than
drawing what the pixels show. Sixteen channels are a vector of each pixel, to be transposed.
"""

from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError

from graycard.methods.splat.simd._many import _count, _element, _pack, _unpack, _vectors
from graycard.methods.splat.simd._vector import LANES, _address, _instruction, float32x16

SIDE = 4
"""Pixels on the side of a block."""

_FLOAT, _INT = ir.FloatType(), ir.IntType(32)


@_instruction
def load_pixels(
    typing: Any, array: types.Type, offset: types.Type, jump: types.Type, template: types.Type
) -> Any:
    """Return the channels of a block whose rows begin ``jump`` floats apart, from ``array[offset:]`` on.

    A pixel has as many channels as the template is long, side by side.
    """
    channels = _count(template)

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        return _dealt(builder, _rows(context, builder, signature, given[:2], given[2]), channels)

    return types.UniTuple(float32x16, channels)(array, offset, types.int64, template), code


@_instruction
def load_line(typing: Any, array: types.Type, offset: types.Type, template: types.Type) -> Any:
    """Return the channels of sixteen pixels side by side, from ``array[offset:]`` on."""
    channels = _count(template)

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        return _dealt(builder, _rows(context, builder, signature, given[:2]), channels)

    return types.UniTuple(float32x16, channels)(array, offset, template), code


@_instruction
def store_pixels(
    typing: Any, array: types.Type, offset: types.Type, jump: types.Type, vectors: types.Type
) -> Any:
    """Write the channels of a block to where :func:`load_pixels` reads them."""
    channels = _vectors(vectors).count

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        rows = _rows(context, builder, signature, given[:2], given[2])
        _gather(builder, _unpack(builder, given[3], channels), rows)
        return context.get_dummy_value()

    return types.void(array, offset, types.int64, vectors), code


@_instruction
def store_line(typing: Any, array: types.Type, offset: types.Type, vectors: types.Type) -> Any:
    """Write the channels of sixteen pixels to where :func:`load_line` reads them."""
    channels = _vectors(vectors).count

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        rows = _rows(context, builder, signature, given[:2])
        _gather(builder, _unpack(builder, given[2], channels), rows)
        return context.get_dummy_value()

    return types.void(array, offset, vectors), code


def _rows(
    context: Any, builder: ir.IRBuilder, signature: Any, place: Sequence[Any], jump: Any = None
) -> list[Any]:
    """Addresses of the first floats of the rows of a block; without a jump, of the one row of a line."""
    rows = [_address(context, builder, types.void(*signature.args[:2]), place)]
    while jump is not None and len(rows) < SIDE:
        rows.append(builder.gep(rows[-1], [jump], inbounds=True))
    return rows


def _dealt(builder: ir.IRBuilder, rows: Sequence[Any], channels: int) -> Any:
    """From rows of pixels to a vector a channel."""
    pixels = LANES // len(rows)
    pieces = [_load(builder, row, *piece) for row in rows for piece in _pieces(pixels * channels)]
    each, vectors = len(pieces) // len(rows), []
    for channel in range(channels):
        places = [divmod(pixel * channels + channel, LANES) for pixel in range(pixels)]
        wanted = [(row * each + piece, lane) for row in range(len(rows)) for piece, lane in places]
        vectors.append(_picked(builder, pieces, wanted))
    return _pack(builder, vectors)


def _gather(builder: ir.IRBuilder, vectors: Sequence[Any], rows: Sequence[Any]) -> None:
    """From a vector a channel to rows of pixels."""
    pixels, channels = LANES // len(rows), len(vectors)
    for number, row in enumerate(rows):
        for first, length in _pieces(pixels * channels):
            places = [divmod(first + lane, channels) for lane in range(length)]
            wanted = [(channel, number * pixels + pixel) for pixel, channel in places]
            piece = _picked(builder, vectors, wanted)
            pointer = builder.bitcast(_element(builder, row, first), piece.type.as_pointer())
            builder.store(piece, pointer, align=4)


def _pieces(floats: int) -> list[tuple[int, int]]:
    """First float and length of the vectors that so many floats make; the last may be short."""
    return [(first, min(LANES, floats - first)) for first in range(0, floats, LANES)]


def _load(builder: ir.IRBuilder, row: Any, first: int, length: int) -> Any:
    """So many floats and nothing after them, in the first lanes of a vector."""
    pointer = ir.VectorType(_FLOAT, length).as_pointer()
    short = builder.load(builder.bitcast(_element(builder, row, first), pointer), align=4)
    return _shuffled(builder, short, short, [min(lane, length - 1) for lane in range(LANES)])


def _picked(builder: ir.IRBuilder, sources: Sequence[Any], wanted: Sequence[tuple[int, int]]) -> Any:
    """Lanes by source and place, at most sixteen of them."""
    used = sorted({source for source, _ in wanted})
    filled = [*wanted, *[wanted[-1]] * (LANES - len(wanted))]
    picked = _shuffled(builder, sources[used[0]], sources[used[0]], [lane for _, lane in filled])
    for source in used[1:]:
        lanes = [LANES + lane if of == source else place for place, (of, lane) in enumerate(filled)]
        picked = _shuffled(builder, picked, sources[source], lanes)
    return _shuffled(builder, picked, picked, range(len(wanted))) if len(wanted) < LANES else picked


def _shuffled(builder: ir.IRBuilder, a: Any, b: Any, lanes: Sequence[int]) -> Any:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_INT, len(lanes)), list(lanes)))


@_instruction
def transpose(typing: Any, vectors: types.Type) -> Any:
    """Sixteen vectors of sixteen: lane j of vector i goes to lane i of vector j."""
    if _vectors(vectors).count != LANES:
        raise TypingError(f"expected {LANES} vectors, got {vectors}")

    def code(_context: Any, builder: ir.IRBuilder, _types: Any, given: Sequence[Any]) -> Any:
        rows = _unpack(builder, given[0], LANES)
        for half in (8, 4, 2, 1):  # swap the off-diagonal quarters of squares of 2 half x 2 half
            low = [i if i & half == 0 else LANES + i - half for i in range(LANES)]
            high = [i + half if i & half == 0 else LANES + i for i in range(LANES)]
            for i in (i for i in range(LANES) if i & half == 0):
                pair = (rows[i], rows[i + half])
                rows[i] = builder.shuffle_vector(*pair, ir.Constant(ir.VectorType(_INT, LANES), low))
                rows[i + half] = builder.shuffle_vector(*pair, ir.Constant(ir.VectorType(_INT, LANES), high))
        return _pack(builder, rows)

    return vectors(vectors), code


def _square(builder: ir.IRBuilder, first: Any, step: Any, jump: Any) -> list[Any]:
    """Addresses of 4 x 4 vectors: ``step`` floats apart within a row, rows ``jump`` floats apart."""
    places = []
    for row in range(4):
        place = builder.gep(first, [builder.mul(jump, ir.Constant(ir.IntType(64), row))], inbounds=True)
        for _column in range(4):
            places.append(place)
            place = builder.gep(place, [step], inbounds=True)
    return places


@_instruction
def load_square(
    typing: Any, array: types.Type, offset: types.Type, step: types.Type, jump: types.Type
) -> Any:
    """Sixteen vectors from ``array[offset:]``, four by four: ``step`` apart in a row, rows ``jump`` apart."""

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        first = _address(context, builder, signature, given)
        return _pack(
            builder, [_load(builder, place, 0, LANES) for place in _square(builder, first, *given[2:])]
        )

    return types.UniTuple(float32x16, LANES)(array, offset, types.int64, types.int64), code


@_instruction
def store_square(
    typing: Any,
    array: types.Type,
    offset: types.Type,
    step: types.Type,
    jump: types.Type,
    vectors: types.Type,
) -> Any:
    """Write sixteen vectors to where :func:`load_square` reads them."""
    if _vectors(vectors).count != LANES:
        raise TypingError(f"expected {LANES} vectors, got {vectors}")

    def code(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[Any]) -> Any:
        first = _address(context, builder, signature, given)
        places = _square(builder, first, given[2], given[3])
        for place, vector in zip(places, _unpack(builder, given[4], LANES), strict=True):
            builder.store(vector, builder.bitcast(place, ir.VectorType(_FLOAT, LANES).as_pointer()), align=4)
        return context.get_dummy_value()

    return types.void(array, offset, types.int64, types.int64, vectors), code
