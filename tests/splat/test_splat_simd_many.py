# SPDX-License-Identifier: Apache-2.0
"""Operations on many vectors at once, each against numpy: tuples of one, of odd lengths, of all sixteen."""

from typing import Any

import numba
import numpy as np
import pytest

from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _pixels as pixels
from graycard.methods.splat.simd import _vector as simd
from graycard.methods.splat.simd import _words as words

LANES = simd.LANES
SIZES = [1, 3, 7, 16]
EPS = float(np.finfo(np.float32).eps)


def numbers(*shape: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def assert_within(got: np.ndarray, expected: np.ndarray, scale: np.ndarray, steps: int) -> None:
    """Within as many roundings of the largest thing that was added."""
    np.testing.assert_array_less(np.abs(got - expected), steps * EPS * scale + 1e-30)


@numba.njit
def copied(a: Any, template: Any, out: Any) -> None:
    many.store_many(out, 3, many.load_many(a, 5, template))


@numba.njit
def repeated(a: Any, template: Any, out: Any) -> None:
    many.store_many(out, 0, many.repeat(simd.load(a, 2), template))


@numba.njit
def products(sums: Any, by: Any, vectors: Any, array: Any, template: Any, out: Any) -> None:
    """Both kinds of sums of products, one after the other."""
    start, factor = many.load_many(sums, 0, template), simd.load(by, 0)
    many.store_many(out, 0, many.add_scaled(start, factor, array, 2))
    place = len(template) * LANES
    many.store_many(out, place, many.add_products(start, factor, many.load_many(vectors, 0, template)))


@numba.njit
def dots(start: Any, array: Any, vectors: Any, others: Any, template: Any, out: Any) -> None:
    a, b = many.load_many(vectors, 0, template), many.load_many(others, 0, template)
    simd.store(out, 0, many.add_dot(simd.load(start, 0), array, 3, a))
    simd.store(out, LANES, many.add_pairs(simd.load(start, 0), a, b))


@numba.njit
def rows_added(sums: Any, factors: Any, rows: Any, stride: int, template: Any, out: Any) -> None:
    total = many.load_many(sums, 0, template)
    many.store_many(out, 0, many.add_rows(total, factors, 1, rows, 4, stride))


@numba.njit
def summed(vectors: Any, template: Any, out: Any) -> None:
    simd.store(out, 0, many.lane_sums(many.load_many(vectors, 0, template)))


@numba.njit
def turned_over(square: Any, template: Any, out: Any) -> None:
    many.store_many(out, 0, pixels.transpose(many.load_many(square, 0, template)))


@numba.njit
def squares(array: Any, out: Any) -> None:
    pixels.store_square(out, 2, 19, 100, pixels.load_square(array, 1, 17, 90))


@numba.njit
def decayed(exponents: Any, out: Any) -> None:
    for place in range(0, exponents.size, 16):
        simd.store(out, place, many.decay(simd.load(exponents, place)))


@numba.njit
def above(a: Any, b: Any) -> int:
    return words.any_above(simd.load(a, 0), simd.load(b, 0))


@numba.njit
def bits_of(word: Any) -> tuple[int, int]:
    return words.lowest_bit(word), words.bit_count(word)


@numba.njit
def fetched(a: Any, at: int) -> None:
    words.prefetch(a, at)
    words.prefetch_to_write(a, at)


@pytest.mark.parametrize("dtype", [np.float32, np.int32, np.int64])
def test_what_is_fetched_stays_as_it_is(dtype: Any):
    a = np.arange(100, dtype=dtype).reshape(25, 4)
    for at in (0, 17, 99):
        fetched(a, at)
    np.testing.assert_array_equal(a.ravel(), np.arange(100))


@pytest.mark.parametrize("size", SIZES)
def test_vectors_are_copied_and_repeated(size: int):
    """To places that are no multiples of anything, and nothing else is touched."""
    a, out = numbers(size * LANES + 9), np.full(size * LANES + 8, -1, np.float32)
    copied(a, (0,) * size, out)
    np.testing.assert_array_equal(out[3:-5], a[5 : 5 + size * LANES])
    assert (out[:3] == -1).all()
    assert (out[-5:] == -1).all()
    repeated(a, (0,) * size, out)
    np.testing.assert_array_equal(out[:-8].reshape(size, LANES), np.tile(a[2 : 2 + LANES], (size, 1)))


@pytest.mark.parametrize("size", SIZES)
def test_products_are_added(size: int):
    sums, by, vectors = numbers(size, LANES), numbers(LANES, seed=1), numbers(size, LANES, seed=2)
    array, out = numbers(size + 2, seed=3), np.empty((2, size, LANES), np.float32)
    products(sums.ravel(), by, vectors.ravel(), array, (0,) * size, out.reshape(-1))
    for got, factors in zip(out, (array[2:, None], vectors), strict=True):
        product = factors.astype(np.float64) * by
        assert_within(got, sums + product, np.abs(sums) + np.abs(product), 1)


@pytest.mark.parametrize("size", SIZES)
def test_dot_products_are_added(size: int):
    start, array = numbers(LANES), numbers(size + 3, seed=1)
    a, b, out = numbers(size, LANES, seed=2), numbers(size, LANES, seed=3), np.empty((2, LANES), np.float32)
    dots(start, array, a.ravel(), b.ravel(), (0,) * size, out.reshape(-1))
    for got, factors in zip(out, (array[3:, None], b), strict=True):
        terms = factors.astype(np.float64) * a
        assert_within(got, start + terms.sum(axis=0), np.abs(start) + np.abs(terms).sum(axis=0), size)


@pytest.mark.parametrize("size", SIZES)
def test_rows_are_added_in_turn(size: int):
    """Row p to sum p modulo the number of sums, rows further apart than they are long."""
    sums, factors, rows = numbers(size, LANES), numbers(LANES + 1, seed=1), numbers(4 + LANES * 21, seed=2)
    out, expected, scale = np.empty((size, LANES), np.float32), sums.astype(np.float64), np.abs(sums)
    rows_added(sums.ravel(), factors, rows, 21, (0,) * size, out.reshape(-1))
    for p in range(LANES):
        term = np.float64(factors[1 + p]) * rows[4 + p * 21 :][:LANES]
        expected[p % size] += term
        scale[p % size] += np.abs(term)
    assert_within(out, expected, scale, LANES)


@pytest.mark.parametrize("size", SIZES)
def test_lanes_are_summed_and_the_rest_is_zero(size: int):
    vectors, out = numbers(size, LANES), np.empty(LANES, np.float32)
    summed(vectors.ravel(), (0,) * size, out)
    exact = vectors.astype(np.float64).sum(axis=1)
    assert_within(out[:size], exact, np.abs(vectors).sum(axis=1), 4)
    assert (out[size:] == 0).all()


def test_a_square_is_turned_over():
    square, out = numbers(LANES, LANES), np.empty((LANES, LANES), np.float32)
    turned_over(square.ravel(), (0,) * LANES, out.reshape(-1))
    np.testing.assert_array_equal(out, square.T)


def test_squares_are_read_and_written_where_they_lie():
    array, out = numbers(1 + 3 * 90 + 3 * 17 + LANES), np.zeros(2 + 3 * 100 + 3 * 19 + LANES, np.float32)
    squares(array, out)
    expected = np.zeros_like(out)
    for row in range(4):
        for column in range(4):
            vector = array[1 + row * 90 + column * 17 :][:LANES]
            expected[2 + row * 100 + column * 19 :][:LANES] = vector
    np.testing.assert_array_equal(out, expected)


def test_powers_decay():
    exponents = np.concatenate([np.linspace(-126, 0, 1 << 16), -np.arange(112)]).astype(np.float32)
    out = np.empty_like(exponents)
    decayed(exponents, out)
    assert np.abs(out / np.exp2(exponents.astype(np.float64)) - 1).max() < simd.EXP2_ERROR


@pytest.mark.parametrize("lane", [0, 5, 15])
def test_one_lane_above_is_enough(lane: int):
    """Equal is not above, nor is NaN."""
    a = numbers(LANES)
    b = a.copy()
    a[(lane + 1) % LANES] = np.nan
    assert above(a, b) == 0
    b[lane] = np.nextafter(a[lane], np.float32(-9), dtype=np.float32)
    assert above(a, b) == 1


@pytest.mark.parametrize("word", [1, 0x8000_0000_0000_0000, 0xFFFF_FFFF_FFFF_FFFF, 0b1011 << 33])
def test_bits_are_found_and_counted(word: int):
    lowest = (word & -word).bit_length() - 1
    given = np.uint64(word)
    assert bits_of(given) == (lowest, word.bit_count())  # pyright: ignore[reportArgumentType]


@numba.njit
def of_unequal_lengths(a: Any) -> Any:
    return many.add_pairs(simd.load(a, 0), many.load_many(a, 0, (0, 0)), many.load_many(a, 0, (0, 0, 0)))


@numba.njit
def sums_of_unequal_lengths(a: Any) -> Any:
    pair, three = many.load_many(a, 0, (0, 0)), many.load_many(a, 0, (0, 0, 0))
    return many.add_products(pair, simd.load(a, 0), three)


@numba.njit
def no_square(a: Any) -> Any:
    return pixels.transpose(many.load_many(a, 0, (0, 0)))


@numba.njit
def no_square_to_write(a: Any) -> None:
    pixels.store_square(a, 0, 16, 64, many.load_many(a, 0, (0, 0)))


@numba.njit
def of_numbers(a: Any) -> Any:
    return many.lane_sums((1.0, 2.0))


@numba.njit
def of_no_template(a: Any) -> Any:
    return many.load_many(a, 0, 3)


@numba.njit
def number_above(a: Any) -> Any:
    return words.any_above(1.0, simd.load(a, 0))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (of_unequal_lengths, "expected 2 vectors"),
        (sums_of_unequal_lengths, "expected 2 vectors"),
        (no_square, "expected 16 vectors"),
        (no_square_to_write, "expected 16 vectors"),
        (of_numbers, "expected a tuple of float32x16"),
        (of_no_template, "expected a tuple of one or more"),
        (number_above, "expected two float32x16"),
    ],
)
def test_other_types_are_refused(wrong: Any, message: str):
    with pytest.raises(numba.TypingError, match=message):
        wrong(np.zeros(256, np.float32))
