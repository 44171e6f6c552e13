# SPDX-License-Identifier: Apache-2.0
"""The vector of sixteen float32, for kernels outside of the engine."""

from graycard.methods.splat.simd._pixels import load_line as load_line
from graycard.methods.splat.simd._pixels import store_line as store_line
from graycard.methods.splat.simd._vector import LANES as LANES
from graycard.methods.splat.simd._vector import broadcast as broadcast
from graycard.methods.splat.simd._vector import exp2 as exp2
from graycard.methods.splat.simd._vector import fma as fma
from graycard.methods.splat.simd._vector import fnma as fnma
from graycard.methods.splat.simd._vector import load as load
from graycard.methods.splat.simd._vector import load_scalar as load_scalar
from graycard.methods.splat.simd._vector import maximum as maximum
from graycard.methods.splat.simd._vector import minimum as minimum
from graycard.methods.splat.simd._vector import square_root as square_root
from graycard.methods.splat.simd._vector import store as store
from graycard.methods.splat.simd._vector import where_less as where_less
