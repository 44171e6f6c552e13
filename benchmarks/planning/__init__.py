# SPDX-License-Identifier: Apache-2.0
"""The plan of a run: its fits with their addresses, parts of it for job arrays, and costs of larger ones."""

from graycard.benchmarks.planning._outlook import Outlook as Outlook
from graycard.benchmarks.planning._outlook import measured_costs as measured_costs
from graycard.benchmarks.planning._outlook import outlook as outlook
from graycard.benchmarks.planning._parts import Part as Part
from graycard.benchmarks.planning._parts import parse_part as parse_part
from graycard.benchmarks.planning._plan import part_of_plan as part_of_plan
from graycard.benchmarks.planning._plan import plan_fits as plan_fits
from graycard.benchmarks.planning._rendering import render_scenes as render_scenes
from graycard.benchmarks.planning._stages import clear_stages as clear_stages
from graycard.benchmarks.planning._stages import staging as staging
