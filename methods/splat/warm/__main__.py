# SPDX-License-Identifier: Apache-2.0
"""Compile all kernels into the cache on disk, or the jobs that are named, in this process."""

import sys

from graycard.methods.splat.warm._jobs import PARTS
from graycard.methods.splat.warm._processes import compile_here, warmed

if sys.argv[1:]:
    compile_here(sys.argv[1:])
else:
    warmed(list(PARTS))
