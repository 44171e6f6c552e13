# SPDX-License-Identifier: Apache-2.0
"""A kit for methods: a skeleton to begin with, and a check of the contract on tiny scenes."""

from graycard.benchmarks.kit._check import Findings as Findings
from graycard.benchmarks.kit._check import check_method as check_method
from graycard.benchmarks.kit._commands import check_command as check_command
from graycard.benchmarks.kit._faults import KINDS as KINDS
from graycard.benchmarks.kit._faults import Fault as Fault
from graycard.benchmarks.kit._new import class_of as class_of
from graycard.benchmarks.kit._new import new_method as new_method
