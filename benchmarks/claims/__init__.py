# SPDX-License-Identifier: Apache-2.0
"""Claims of papers as data, and verdicts on them that come from runs, never by hand."""

from graycard.benchmarks.claims._budgets import check_budgets as check_budgets
from graycard.benchmarks.claims._claim import Along as Along
from graycard.benchmarks.claims._claim import Arithmetic as Arithmetic
from graycard.benchmarks.claims._claim import Check as Check
from graycard.benchmarks.claims._claim import Claim as Claim
from graycard.benchmarks.claims._claim import Paper as Paper
from graycard.benchmarks.claims._claim import Quantity as Quantity
from graycard.benchmarks.claims._claim import Scenes as Scenes
from graycard.benchmarks.claims._claim import claims_names as claims_names
from graycard.benchmarks.claims._claim import claims_of_suite as claims_of_suite
from graycard.benchmarks.claims._claim import claims_of_tracks as claims_of_tracks
from graycard.benchmarks.claims._claim import claims_path as claims_path
from graycard.benchmarks.claims._claim import load_claims as load_claims
from graycard.benchmarks.claims._judge import judge_claims as judge_claims
from graycard.benchmarks.claims._judge import judge_paper as judge_paper
from graycard.benchmarks.claims._judge import judge_tables as judge_tables
from graycard.benchmarks.claims._judge import made_for_others as made_for_others
from graycard.benchmarks.claims._looks import Pursued as Pursued
from graycard.benchmarks.claims._looks import judge_run as judge_run
from graycard.benchmarks.claims._looks import pursue as pursue
from graycard.benchmarks.claims._power import MOST as MOST
from graycard.benchmarks.claims._power import CheckPower as CheckPower
from graycard.benchmarks.claims._power import Need as Need
from graycard.benchmarks.claims._power import claims_power as claims_power
from graycard.benchmarks.claims._rules import OPEN as OPEN
from graycard.benchmarks.claims._rules import RULES as RULES
from graycard.benchmarks.claims._sizes import Sized as Sized
from graycard.benchmarks.claims._sizes import read_sizes as read_sizes
