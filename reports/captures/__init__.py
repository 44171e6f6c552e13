# SPDX-License-Identifier: Apache-2.0
"""The page of an imported capture: held-out photographs, what methods made of them, and no truth."""
