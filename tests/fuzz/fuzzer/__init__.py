# SPDX-License-Identifier: Apache-2.0
"""A fuzzer: hostile files of every kind that graycard reads, and the watch over what comes of them."""

from fuzzer.engine import Budget as Budget
from fuzzer.engine import fuzz as fuzz
from fuzzer.outcome import table as table
