# SPDX-License-Identifier: Apache-2.0
"""Every operation of the vector type against NumPy; run as a script, on the processor that Numba is told."""

import re
import sys
from typing import Any, cast

import numba
import numpy as np

from graycard.methods.splat.simd import _doubles as doubles
from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _pixels as pixels
from graycard.methods.splat.simd import _vector as simd

FLOATS = np.finfo(np.float32)


@numba.njit
def arithmetic(a: Any, b: Any, c: Any, out: Any) -> None:
    x, y, z = simd.load(a, 0), simd.load(b, 0), simd.load(c, 0)
    simd.store(out, 0, x + y)
    simd.store(out, 16, x - y)
    simd.store(out, 32, x * y)
    simd.store(out, 48, x / y)
    simd.store(out, 64, simd.fma(x, y, z))
    simd.store(out, 80, simd.fnma(x, y, z))


@numba.njit
def choices(a: Any, b: Any, out: Any) -> None:
    x, y = simd.load(a, 0), simd.load(b, 0)
    one, two = simd.broadcast(1.0), simd.broadcast(np.float32(2))
    simd.store(out, 0, simd.minimum(x, y))
    simd.store(out, 16, simd.maximum(x, y))
    simd.store(out, 32, simd.where_less(x, y, one, two))
    simd.store(out, 48, simd.where_at_least(x, y, one, two))


@numba.njit
def memory(a: Any, out: Any) -> float:
    simd.store(out, 3, simd.load(a, 5))
    simd.store(out, 19, simd.load_scalar(a, 7))
    return simd.largest_lane(simd.load(a, 5))


@numba.njit
def powers(x: Any, out: Any) -> None:
    for offset in range(0, x.size, 16):
        simd.store(out, offset, simd.exp2(simd.load(x, offset)))


@numba.njit
def sums(a: Any, out: Any) -> None:
    v = simd.load(a, 0)
    w = simd.load(a, 16)
    x = simd.load(a, 240)
    simd.store(out, 0, simd.lane_sums((v, w, v, v, v, v, v, v, v, w, v, v, v, v, w, x)))


@numba.njit
def halves(a: Any, out: Any) -> None:
    low, high = many.load_many(a, 0, (0,) * 5), many.load_many(a, 80, (0,) * 3)
    simd.store(out, 0, many.lane_sums_of_halves(low, high))


@numba.njit
def roots(a: Any, out: Any) -> None:
    simd.store(out, 0, simd.square_root(simd.load(a, 0)))


@numba.njit
def block(image: Any, at: int, jump: int, template: Any, out: Any, copy: Any) -> None:
    vectors = pixels.load_pixels(image, at, jump, template)
    many.store_many(out, 0, vectors)
    pixels.store_pixels(copy, at, jump, vectors)


@numba.njit
def line(image: Any, at: int, template: Any, out: Any, copy: Any) -> None:
    vectors = pixels.load_line(image, at, template)
    many.store_many(out, 0, vectors)
    pixels.store_line(copy, at, vectors)


@numba.njit
def eights(a: Any, b: Any, number: float, out: Any) -> None:
    x, y = doubles.load(a, 1), doubles.load(b, 0)
    made = (
        x + y, x - y, x * y, x / y, -x,
        number + x, x - number, 3 * x, number / x,
        doubles.square_root(x), doubles.floor(x), doubles.ceil(x), doubles.rounded_to_float32(x),
        doubles.minimum(x, y), doubles.maximum(x, number),
        doubles.where_less(x, y, 1.0, y), doubles.where_less(number, x, x, 0),
    )  # fmt: skip
    for index, values in enumerate(made):
        doubles.store(out, 8 * index + 1, values)
    doubles.store(out, 8 * len(made) + 1, number)


def random(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=count).astype(np.float32)


def check_arithmetic() -> None:
    a, b, c, out = random(16), random(16, 1), random(16, 2), np.zeros(96, np.float32)
    arithmetic(a, b, c, out)
    np.testing.assert_array_equal(out[:64], np.concatenate([a + b, a - b, a * b, a / b]))
    exact = a.astype(np.float64) * b
    scale = np.abs(exact) + np.abs(c)
    assert (np.abs(out[64:80] - (exact + c)) <= FLOATS.eps * scale).all()
    assert (np.abs(out[80:] - (c - exact)) <= FLOATS.eps * scale).all()


def check_choices() -> None:
    a, b, out = random(16), random(16, 1), np.zeros(64, np.float32)
    a[3] = b[3]
    a[4], b[5] = np.nan, np.nan
    a[6], b[7] = np.inf, -np.inf
    choices(a, b, out)
    with np.errstate(invalid="ignore"):
        expected = [
            np.where(a < b, a, b),
            np.where(a > b, a, b),
            np.where(a < b, 1, 2),
            np.where(a >= b, 1, 2),
        ]
    np.testing.assert_array_equal(out, np.concatenate(expected))


def check_memory() -> None:
    a, out = random(40), np.zeros(40, np.float32)
    assert memory(a, out) == a[5:21].max()
    np.testing.assert_array_equal(out, np.concatenate([[0] * 3, a[5:21], [a[7]] * 16, [0] * 5]))


def check_powers() -> None:
    x = np.concatenate([np.linspace(-126, 126, 1 << 20), np.linspace(-12, 0, 1 << 20)]).astype(np.float32)
    out = np.empty_like(x)
    powers(x, out)
    error = np.abs(out / np.exp2(x.astype(np.float64)) - 1).max()
    assert error < simd.EXP2_ERROR, error
    edges = np.array([-np.inf, -1e30, -127, 127, 1e30, np.inf, 0, 1] * 2, np.float32)
    powers(edges, out)
    np.testing.assert_allclose(
        out[:8], np.exp2(np.clip(edges[:8].astype(float), -126, 126)), rtol=simd.EXP2_ERROR
    )


def check_sums() -> None:
    a, out = random(256), np.zeros(16, np.float32)
    sums(a, out)
    v, w, x = (a[i : i + 16].sum(dtype=np.float64) for i in (0, 16, 240))
    np.testing.assert_allclose(out, [v, w, *[v] * 7, w, *[v] * 4, w, x], rtol=1e-5, atol=1e-6)


def check_halves() -> None:
    a, out = random(128), np.ones(16, np.float32)
    halves(a, out)
    sums = a.reshape(8, 16).sum(axis=1, dtype=np.float64)
    expected = [*sums[:5], 0, 0, 0, *sums[5:], 0, 0, 0, 0, 0]
    np.testing.assert_allclose(out, expected, rtol=1e-5, atol=1e-6)


def check_roots() -> None:
    a, out = random(16) ** 2, np.zeros(16, np.float32)
    roots(a, out)
    np.testing.assert_array_equal(out, np.sqrt(a))


def check_pixels() -> None:
    """Only the block, or the piece of a line, is read and written."""
    for channels in (1, 2, 3, 8):
        image, out = random(6 * 21 * channels).reshape(6, 21, channels), np.zeros(16 * channels, np.float32)
        places = {(1, 2, 4, 4), (3, 5, 1, 16)}
        for top, left, rows, columns in places:
            copy, at = np.full_like(image, np.nan), (top * 21 + left) * channels
            flat, template = (image.reshape(-1), copy.reshape(-1)), (0,) * channels
            if rows > 1:
                block(flat[0], at, 21 * channels, template, out, flat[1])
            else:
                line(flat[0], at, template, out, flat[1])
            inside = (slice(top, top + rows), slice(left, left + columns))
            expected = np.full_like(image, np.nan)
            expected[inside] = image[inside]
            np.testing.assert_array_equal(
                out.reshape(channels, rows, columns), np.moveaxis(image[inside], 2, 0)
            )
            np.testing.assert_array_equal(copy, expected)


def check_eights() -> None:
    """Check that vectors give the bits of numbers one by one, and that nothing beside them is written."""
    draws, number = np.random.default_rng(0).normal(size=(2, 9)), 0.25
    a, b, out = draws[0], draws[1, :8], np.full(8 * 18 + 2, -7.0)
    a[2], a[3], b[4], a[6], b[7] = np.nan, b[2], np.nan, np.inf, -np.inf
    eights(a, b, number, out)
    x, y = a[1:], b
    with np.errstate(invalid="ignore"):
        expected = [
            x + y, x - y, x * y, x / y, -x,
            number + x, x - number, 3 * x, number / x,
            np.sqrt(x), np.floor(x), np.ceil(x), x.astype(np.float32).astype(np.float64),
            np.where(x < y, x, y), np.where(x > number, x, number),
            np.where(x < y, 1, y), np.where(number < x, x, 0),
            np.full(8, number),
        ]  # fmt: skip
    np.testing.assert_array_equal(out, [-7, *np.concatenate(expected), -7])


CHECKS = (
    check_arithmetic,
    check_choices,
    check_memory,
    check_powers,
    check_sums,
    check_halves,
    check_roots,
    check_eights,
    check_pixels,
)

if __name__ == "__main__":
    for check in CHECKS:
        check()
    code = "".join(cast(Any, arithmetic).inspect_asm().values())
    widest = next(name for name in ("zmm", "ymm", "xmm") if name in code)
    sys.stdout.write(f"{widest} {'fma' if re.search('vfn?m(add|sub)', code) else 'no-fma'}")
