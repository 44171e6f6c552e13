# SPDX-License-Identifier: Apache-2.0
"""The vector type on this processor, and on lesser ones that Numba is told to compile for."""

import importlib.util
import os
import platform
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numba
import pytest
from llvmlite import binding

from graycard.methods.splat.simd import _doubles as doubles
from graycard.methods.splat.simd import _many as many
from graycard.methods.splat.simd import _vector as simd

SCRIPT = Path(__file__).with_name("simd_checks.py")


def load_checks() -> tuple[Callable[[], None], ...]:
    spec = importlib.util.spec_from_file_location("simd_checks", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.CHECKS


@pytest.mark.parametrize("check", load_checks(), ids=lambda check: check.__name__)
def test_here(check: Callable[[], None]):
    check()


@pytest.mark.parametrize(
    ("processor", "needs", "answer"),
    [
        ("x86-64-v4", "avx512f", None),  # LLVM prefers ymm on some; the values are what counts
        ("x86-64-v3", "avx2", "ymm fma"),
        pytest.param("ivybridge", "avx", "ymm no-fma", marks=pytest.mark.slow),
        ("x86-64", "sse2", "xmm no-fma"),
    ],
)
def test_on_lesser_processors(processor: str, needs: str, answer: str | None):
    if platform.machine() not in ("x86_64", "AMD64") or not binding.get_host_cpu_features().get(needs):
        pytest.skip(f"this processor has no {needs}")
    told = {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
    run = subprocess.run(
        [sys.executable, SCRIPT], env=os.environ | told, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert answer is None or run.stdout.strip() == answer


def test_other_types_are_refused():
    @numba.njit
    def wrong(x: float) -> None:
        simd.minimum(x, x)

    with pytest.raises(numba.TypingError, match="expected float32x16 in every place"):
        wrong(1.0)


def test_numbers_alone_are_refused():
    @numba.njit
    def wrong(x: float) -> None:
        doubles.minimum(x, x)

    with pytest.raises(numba.TypingError, match="at least one vector among them"):
        wrong(1.0)


@pytest.mark.parametrize("counts", [(2, 3), (9, 1)])
def test_halves_of_other_lengths_are_refused(counts: tuple[int, int]):
    @numba.njit
    def wrong(low: tuple[int, ...], high: tuple[int, ...]) -> None:
        v = simd.broadcast(1.0)
        many.lane_sums_of_halves(many.repeat(v, low), many.repeat(v, high))

    with pytest.raises(numba.TypingError, match="expected up to 8 float32x16 and no more of the second"):
        wrong((0,) * counts[0], (0,) * counts[1])


def test_a_tuple_of_other_length_is_refused():
    @numba.njit
    def wrong() -> None:
        v = simd.broadcast(1.0)
        simd.lane_sums((v, v))

    with pytest.raises(numba.TypingError, match="expected a tuple of 16 float32x16"):
        wrong()
