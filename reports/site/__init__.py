# SPDX-License-Identifier: Apache-2.0
"""The site of a ledger: static pages of published runs, with claims and their history, tables and scenes."""
