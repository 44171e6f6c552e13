# SPDX-License-Identifier: Apache-2.0
"""Jobs in processes of their own: what ends there ends no other job, and leaves nothing behind."""

from graycard.benchmarks.workers._outcome import Outcome as Outcome
from graycard.benchmarks.workers._pool import USUAL as USUAL
from graycard.benchmarks.workers._pool import Limits as Limits
from graycard.benchmarks.workers._pool import run_all as run_all
from graycard.benchmarks.workers._worker import worker_progress as worker_progress
