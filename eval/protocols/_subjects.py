# SPDX-License-Identifier: Apache-2.0
"""What the numbers of a subject are called."""

from collections.abc import Mapping

from graycard.eval.protocols._base import Subject

GROUPS: Mapping[Subject, tuple[str, str]] = {
    "base_color": ("albedo", "Albedo"),
    "radiance": ("novel_view", "Novel view"),
    "relit": ("relighting", "Relighting"),
    "normal": ("normal", "Normal"),
    "depth": ("depth", "Depth"),
    "roughness": ("roughness", "Roughness"),
}
"""By subject: where the ids of its metrics begin, and their titles."""
