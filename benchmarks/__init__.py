# SPDX-License-Identifier: Apache-2.0
"""Suites, the runner, the gate."""

from graycard.benchmarks._doctor import Finding as Finding
from graycard.benchmarks._doctor import findings as findings
from graycard.benchmarks._edition import find_edition as find_edition
from graycard.benchmarks._edition import refuse_sealed as refuse_sealed
from graycard.benchmarks._fit import FitSpec as FitSpec
from graycard.benchmarks._fit import fit_scene as fit_scene
from graycard.benchmarks._fit import load_for as load_for
from graycard.benchmarks._gate import Baseline as Baseline
from graycard.benchmarks._gate import Expected as Expected
from graycard.benchmarks._gate import GateVerdict as GateVerdict
from graycard.benchmarks._gate import judge as judge
from graycard.benchmarks._gate import make_baseline as make_baseline
from graycard.benchmarks._gate import read_baseline as read_baseline
from graycard.benchmarks._gate import write_baseline as write_baseline
from graycard.benchmarks._plotting import check_plotting as check_plotting
from graycard.benchmarks._run_record import RunError as RunError
from graycard.benchmarks._runner import Terms as Terms
from graycard.benchmarks._runner import run_bench as run_bench
from graycard.benchmarks._sources import environment as environment
from graycard.benchmarks._sources import usable_cores as usable_cores
from graycard.benchmarks._suites import Suite as Suite
from graycard.benchmarks._suites import SuiteMethod as SuiteMethod
from graycard.benchmarks._suites import load_suite as load_suite
from graycard.benchmarks._suites import narrow as narrow
from graycard.benchmarks._suites import opened as opened
from graycard.benchmarks._suites import suite_names as suite_names
from graycard.benchmarks._suites import with_predictions as with_predictions
from graycard.benchmarks._until_decided import Plan as Plan
from graycard.benchmarks._until_decided import run_until_decided as run_until_decided
from graycard.benchmarks._workers import run_all as run_all
from graycard.benchmarks.validity._check import RULES as RULES
from graycard.benchmarks.validity._check import Validity as Validity
from graycard.benchmarks.validity._check import check_result as check_result
from graycard.benchmarks.validity._record import Breach as Breach
