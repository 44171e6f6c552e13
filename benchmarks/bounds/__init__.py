# SPDX-License-Identifier: Apache-2.0
"""The best that a model could do, whatever fits it: found from the truth."""

from graycard.benchmarks.bounds._vectors import VectorBound as VectorBound
from graycard.benchmarks.bounds._vectors import best_vector_errors as best_vector_errors
from graycard.benchmarks.bounds._vectors import vector_bound as vector_bound
