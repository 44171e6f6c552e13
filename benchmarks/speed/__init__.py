# SPDX-License-Identifier: Apache-2.0
"""Speed: costs of the machinery, always beside a peer in the same run: these are ratios, not records."""

from graycard.benchmarks.speed._records import RecordCost as RecordCost
from graycard.benchmarks.speed._records import made_up_run as made_up_run
from graycard.benchmarks.speed._records import measure_records as measure_records
from graycard.benchmarks.speed._score import ScoreCost as ScoreCost
from graycard.benchmarks.speed._score import measure_scoring as measure_scoring
from graycard.benchmarks.speed._second_stages import StageCost as StageCost
from graycard.benchmarks.speed._second_stages import growth as growth
from graycard.benchmarks.speed._second_stages import measure_second_stages as measure_second_stages
from graycard.benchmarks.speed._truth import TruthCost as TruthCost
from graycard.benchmarks.speed._truth import measure_truth as measure_truth
from graycard.benchmarks.speed.engine._measure import PARTS as PARTS
from graycard.benchmarks.speed.engine._measure import QUICK_PLAN as QUICK_PLAN
from graycard.benchmarks.speed.engine._measure import Part as Part
from graycard.benchmarks.speed.engine._measure import SpeedPlan as SpeedPlan
from graycard.benchmarks.speed.engine._measure import measure_engine as measure_engine
from graycard.benchmarks.speed.engine._measure import speed_plan as speed_plan
from graycard.benchmarks.speed.engine._plot import engine_plot as engine_plot
from graycard.benchmarks.speed.engine._records import EngineSpeed as EngineSpeed
from graycard.benchmarks.speed.engine._tables import SpeedTable as SpeedTable
from graycard.benchmarks.speed.engine._tables import disturbed_note as disturbed_note
from graycard.benchmarks.speed.engine._tables import engine_tables as engine_tables
