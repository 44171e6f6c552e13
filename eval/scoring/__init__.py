# SPDX-License-Identifier: Apache-2.0
"""From predictions and truth to a score sheet."""
