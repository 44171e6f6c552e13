# SPDX-License-Identifier: Apache-2.0
"""The verb that runs a suite, on this machine or on many."""
