# SPDX-License-Identifier: Apache-2.0
"""Mitsuba: the variant in use, scenes as Mitsuba's own, and plugins for materials and lights."""
