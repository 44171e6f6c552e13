# SPDX-License-Identifier: Apache-2.0
"""The vector of sixteen float32, for kernels outside of the engine."""

from graycard.methods.splat.simd._vector import LANES as LANES
from graycard.methods.splat.simd._vector import broadcast as broadcast
from graycard.methods.splat.simd._vector import fma as fma
from graycard.methods.splat.simd._vector import load as load
from graycard.methods.splat.simd._vector import store as store
