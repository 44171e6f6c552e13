# SPDX-License-Identifier: Apache-2.0
"""Run kernels on all threads: what kernels outside of the engine need of its one parallel loop."""

from graycard.methods.splat.simd._parts import BORROWING as BORROWING
from graycard.methods.splat.simd._parts import INLINED as INLINED
from graycard.methods.splat.simd._parts import UNWRAPPED as UNWRAPPED
from graycard.methods.splat.simd._parts import run as run
from graycard.methods.splat.simd._parts import run_in as run_in
from graycard.methods.splat.simd._parts import share as share
from graycard.methods.splat.simd._parts import task as task
