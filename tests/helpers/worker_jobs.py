# SPDX-License-Identifier: Apache-2.0
"""Work that a fresh process can import."""

import os

from graycard.benchmarks._jobs import Outcome


def tell_process(number: int) -> Outcome:
    return Outcome(value=os.getpid())


def die_at_one(number: int) -> Outcome:
    if number == 1:
        os._exit(9)
    return Outcome(value=number)
