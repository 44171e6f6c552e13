# SPDX-License-Identifier: Apache-2.0
"""Freed memory is kept for later."""

import platform
import subprocess
import sys

import pytest

FAULTS = """
import resource
import numpy as np
from graycard.io import keep_freed_memory

def faults_of_an_image():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.ones(3_000_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

{call}
faults_of_an_image()
print(faults_of_an_image())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's allocator is set")
def test_the_next_image_takes_the_memory_of_the_last() -> None:
    kept, given_back = (_faults(call) for call in ("assert keep_freed_memory()", ""))
    assert kept < 5 < given_back, "24 MB are 6,000 pages, or 12 large ones"


READ = """
from graycard.io import Room
assert keep_freed_memory()
with Room(limit=0) as room:
    room.keep(np.ones(300_000))
    inside = faults_of_an_image(), faults_of_an_image()
assert inside[1] > 5, "an image that went into a file leaves no hole"
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's allocator is set")
def test_memory_is_kept_again_when_all_views_are_read() -> None:
    """Else all that a fit does after it would be slow."""
    assert _faults(READ) < 5


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's allocator is set")
def test_a_room_that_does_not_read_leaves_memory_as_it_is() -> None:
    assert (
        _faults("from graycard.io import Room\nkeep_freed_memory()\nRoom(limit=0).keep(np.ones(300_000))") < 5
    )


def _faults(call: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", FAULTS.format(call=call)], capture_output=True, text=True, check=True
    )
    return int(done.stdout)
