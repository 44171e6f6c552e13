# SPDX-License-Identifier: Apache-2.0
"""Tables, verdicts and intervals of a report."""
