# SPDX-License-Identifier: Apache-2.0
"""The history of verdicts: entries from ledgers, why verdicts changed, and the page that shows it."""
