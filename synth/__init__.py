# SPDX-License-Identifier: Apache-2.0
"""Ground truth: seeded procedural scenes, rendered by Mitsuba 3."""
