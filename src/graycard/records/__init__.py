# SPDX-License-Identifier: Apache-2.0
"""Records: scores, runs, comparisons and verdicts as they are on disk."""

from graycard.records._comparison import COMPARISON as COMPARISON
from graycard.records._comparison import AboveCeiling as AboveCeiling
from graycard.records._comparison import Comparison as Comparison
from graycard.records._comparison import MethodStanding as MethodStanding
from graycard.records._comparison import MetricComparison as MetricComparison
from graycard.records._comparison import PairDifference as PairDifference
from graycard.records._comparison import PairVerdict as PairVerdict
from graycard.records._comparison import read_comparison as read_comparison
from graycard.records._ledger import CLAIMS as CLAIMS
from graycard.records._ledger import CheckResult as CheckResult
from graycard.records._ledger import ClaimResult as ClaimResult
from graycard.records._ledger import ClaimVerdict as ClaimVerdict
from graycard.records._ledger import Ledger as Ledger
from graycard.records._ledger import PaperResult as PaperResult
from graycard.records._ledger import RowMean as RowMean
from graycard.records._ledger import find_claim as find_claim
from graycard.records._ledger import read_ledger as read_ledger
from graycard.records._run import HOLDS_NOISE as HOLDS_NOISE
from graycard.records._run import Access as Access
from graycard.records._run import Cost as Cost
from graycard.records._run import Invariance as Invariance
from graycard.records._run import Job as Job
from graycard.records._run import JobResult as JobResult
from graycard.records._run import MethodRecord as MethodRecord
from graycard.records._run import MetricRecord as MetricRecord
from graycard.records._run import RunRecord as RunRecord
from graycard.records._run import SceneRecord as SceneRecord
from graycard.records._run import Score as Score
from graycard.records._run import ScoreSheet as ScoreSheet
from graycard.records._run import Status as Status
from graycard.records._run import read_run as read_run
from graycard.records._run import read_score_sheet as read_score_sheet
