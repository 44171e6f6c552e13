# SPDX-License-Identifier: Apache-2.0
"""The command line: one module a group of verbs."""

from graycard.cli._main import main as main
