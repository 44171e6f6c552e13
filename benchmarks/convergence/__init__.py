# SPDX-License-Identifier: Apache-2.0
"""Convergence: what more steps and more surfels do to the scores of a method.

A method counts as converged where one more doubling gains less than :data:`ENOUGH` in views and in albedo.
Suites ``convergence-<track>`` vary one budget at a time on scenes that judge nothing.
"""

from graycard.benchmarks.convergence._curves import AXES as AXES
from graycard.benchmarks.convergence._curves import ENOUGH as ENOUGH
from graycard.benchmarks.convergence._curves import WATCHED as WATCHED
from graycard.benchmarks.convergence._curves import Curve as Curve
from graycard.benchmarks.convergence._curves import Gain as Gain
from graycard.benchmarks.convergence._curves import Point as Point
from graycard.benchmarks.convergence._curves import curves_of as curves_of
from graycard.benchmarks.convergence._plot import convergence_plot as convergence_plot
from graycard.benchmarks.convergence._sweep import swept as swept
