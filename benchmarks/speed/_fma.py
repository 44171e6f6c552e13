# SPDX-License-Identifier: Apache-2.0
"""Kernels limited by nothing but how many multiply-adds a core starts: chains that wait for no other.

A core starts up to two a cycle and each takes about four: eight chains keep it busy. Processors with sixteen
short registers hold no more than six chains of sixteen lanes.
"""

from numba import njit, prange

from graycard.methods.splat import vectors as simd

LANES = simd.LANES
FEW, MANY = 6, 10
"""Chains."""


@njit(parallel=True, cache=True)
def few_chains(state, threads, rounds):
    """Go on with ``FEW`` chains a thread, which ``state`` holds one after the other."""
    for thread in prange(threads):
        at = thread * FEW * LANES
        half, a, b = simd.broadcast(0.5), simd.load(state, at), simd.load(state, at + LANES)
        c, d = simd.load(state, at + 2 * LANES), simd.load(state, at + 3 * LANES)
        e, f = simd.load(state, at + 4 * LANES), simd.load(state, at + 5 * LANES)
        for _ in range(rounds):
            a, b, c = simd.fma(a, half, half), simd.fma(b, half, half), simd.fma(c, half, half)
            d, e, f = simd.fma(d, half, half), simd.fma(e, half, half), simd.fma(f, half, half)
        simd.store(state, at, (a + b) + (c + d) + (e + f))


@njit(parallel=True, cache=True)
def many_chains(state, threads, rounds):
    """Go on with ``MANY`` chains a thread, which ``state`` holds one after the other."""
    for thread in prange(threads):
        at = thread * MANY * LANES
        half, a, b = simd.broadcast(0.5), simd.load(state, at), simd.load(state, at + LANES)
        c, d = simd.load(state, at + 2 * LANES), simd.load(state, at + 3 * LANES)
        e, f = simd.load(state, at + 4 * LANES), simd.load(state, at + 5 * LANES)
        g, h = simd.load(state, at + 6 * LANES), simd.load(state, at + 7 * LANES)
        i, j = simd.load(state, at + 8 * LANES), simd.load(state, at + 9 * LANES)
        for _ in range(rounds):
            a, b, c = simd.fma(a, half, half), simd.fma(b, half, half), simd.fma(c, half, half)
            d, e, f = simd.fma(d, half, half), simd.fma(e, half, half), simd.fma(f, half, half)
            g, h = simd.fma(g, half, half), simd.fma(h, half, half)
            i, j = simd.fma(i, half, half), simd.fma(j, half, half)
        simd.store(state, at, (a + b) + (c + d) + (e + f) + (g + h) + (i + j))


KERNELS = ((few_chains, FEW), (many_chains, MANY))
"""Each with its number of chains."""
