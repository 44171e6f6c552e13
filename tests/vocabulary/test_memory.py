# SPDX-License-Identifier: Apache-2.0
"""Freed memory is kept for later."""

import platform
import subprocess
import sys

import pytest

FAULTS = """
import resource
import numpy as np
from graycard.io._memory import keep_freed_memory

{call}

def faults_of_an_image():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.ones(3_000_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

faults_of_an_image()
print(faults_of_an_image())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's allocator is set")
def test_the_next_image_takes_the_memory_of_the_last() -> None:
    kept, given_back = (_faults(call) for call in ("assert keep_freed_memory()", ""))
    assert kept < 5 < given_back, "24 MB are 6,000 pages, or 12 large ones"


def _faults(call: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", FAULTS.format(call=call)], capture_output=True, text=True, check=True
    )
    return int(done.stdout)
