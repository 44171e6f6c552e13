# SPDX-License-Identifier: Apache-2.0
"""What the machinery itself costs, always beside a peer in the same run: these are ratios, not records."""

from graycard.benchmarks.speed._truth import TruthCost as TruthCost
from graycard.benchmarks.speed._truth import measure_truth as measure_truth
