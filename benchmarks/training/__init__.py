# SPDX-License-Identifier: Apache-2.0
"""Train graycard's own network on scenes of its own seeds, and measure how wrong priors are."""

from graycard.benchmarks.training._errors import UNITS as UNITS
from graycard.benchmarks.training._errors import best_constant as best_constant
from graycard.benchmarks.training._errors import errors_of as errors_of
from graycard.benchmarks.training._looks import Look as Look
from graycard.benchmarks.training._measure import CONSTANT as CONSTANT
from graycard.benchmarks.training._measure import FLAT as FLAT
from graycard.benchmarks.training._measure import SOURCES as SOURCES
from graycard.benchmarks.training._measure import PriorErrors as PriorErrors
from graycard.benchmarks.training._measure import check_sources as check_sources
from graycard.benchmarks.training._measure import measure_priors as measure_priors
from graycard.benchmarks.training._plot import training_plot as training_plot
from graycard.benchmarks.training._scenes import TRAINING as TRAINING
from graycard.benchmarks.training._scenes import VALIDATION as VALIDATION
from graycard.benchmarks.training._scenes import check_seeds as check_seeds
from graycard.benchmarks.training._scenes import training_scene as training_scene
from graycard.benchmarks.training._train import TrainRecord as TrainRecord
from graycard.benchmarks.training._train import TrainSettings as TrainSettings
from graycard.benchmarks.training._train import train as train
from graycard.benchmarks.training._views import ViewSettings as ViewSettings
from graycard.benchmarks.training._views import read_views as read_views
from graycard.benchmarks.training._views import render_views as render_views
