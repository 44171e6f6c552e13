# SPDX-License-Identifier: Apache-2.0
"""The engine on lesser processors, in other processes and with other numbers of threads."""

import importlib.util
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numba
import pytest
import torch
from llvmlite import binding

SCRIPT = Path(__file__).with_name("engine_checks.py")


@pytest.fixture(scope="module")
def checks() -> ModuleType:
    spec = importlib.util.spec_from_file_location("engine_checks", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run(**variables: str) -> str:
    """Return the output of the script in a process with these environment variables."""
    done = subprocess.run(
        [sys.executable, SCRIPT], env=os.environ | variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def threads() -> Iterator[None]:
    """Put the numbers of threads back afterwards."""
    before, torch_before = numba.get_num_threads(), torch.get_num_threads()
    yield
    numba.set_num_threads(before)
    torch.set_num_threads(torch_before)


@pytest.mark.parametrize("elsewhere", ["2", pytest.param("1", marks=pytest.mark.slow)])
def test_the_same_bits_from_any_process_and_any_number_of_threads(
    checks: ModuleType, threads: None, elsewhere: str
):
    digests = {run(NUMBA_NUM_THREADS=elsewhere, OMP_NUM_THREADS=elsewhere, PYTHONHASHSEED=elsewhere)}
    many = min(2, numba.get_num_threads())
    for count in (1, many, many):
        numba.set_num_threads(count)
        torch.set_num_threads(count)
        digests.add(checks.digest(checks.drawn("cpu")))
    assert len(digests) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("processor", "beyond", "fuses"),
    [
        ("x86-64-v3", "avx512f", True),  # AVX2 and FMA, no AVX-512
        ("x86-64", "avx2", False),  # without AVX, without FMA
    ],
)
def test_lesser_processors_draw_the_same(processor: str, beyond: str, fuses: bool, tmp_path: Path):
    """A cache of its own, or Numba would take what it compiled for this one.

    On a processor that has no more than they the test above runs the same script, with the same checks.
    """
    if platform.machine() not in ("x86_64", "AMD64") or not binding.get_host_cpu_features().get(beyond):
        pytest.skip(f"this processor has no {beyond}: it is no better, and all tests draw on it")
    lesser = run(NUMBA_CPU_NAME=processor, NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=str(tmp_path))
    assert list(tmp_path.rglob("*.nbc")), "nothing was compiled"
    assert (lesser == run()) == fuses, "without a fused multiply-add the last bits differ, else none may"
