# SPDX-License-Identifier: Apache-2.0
"""The verb that holds a run against a baseline."""
