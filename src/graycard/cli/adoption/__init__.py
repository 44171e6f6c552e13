# SPDX-License-Identifier: Apache-2.0
"""The verb that adopts outputs of other code, and what `score` and `report` do with imported captures."""
