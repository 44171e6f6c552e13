# SPDX-License-Identifier: Apache-2.0
"""The verbs for who writes a method: begin one, and check its contract."""

from graycard.cli.kit._verbs import NewMethodCommand as NewMethodCommand
from graycard.cli.kit._verbs import TestMethodCommand as TestMethodCommand
