# SPDX-License-Identifier: Apache-2.0
"""Units of the knobs that scenes are made with, for all that shows them."""

from collections.abc import Mapping

KNOB_UNITS: Mapping[str, str] = {"light_offset": "m", "light_cutoff": "°", "ambient": "W/m²/sr"}
"""By knob, of all families; other numbers are counts, factors or shares."""


def knob_text(name: str, value: str) -> str:
    """Return the value of a knob with its unit; as it is where it has none."""
    unit = KNOB_UNITS.get(name)
    return f"{value} {unit}" if unit else value
