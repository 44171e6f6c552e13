# SPDX-License-Identifier: Apache-2.0
"""The table of what undecided claims need."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.table import Table

from graycard.cli._terminal import new_table

if TYPE_CHECKING:
    from graycard.benchmarks.claims import CheckPower, Need


def power_table(needs: Sequence[CheckPower]) -> Table:
    """Return a table with a row for each check: its effect, and the scenes for 80 % power."""
    heads = "as seen", "as claimed", "none at all"
    table = new_table("claim", "check", "effect", "n", "sd", *(f"if the effect is {h}" for h in heads))
    for need in needs:
        table.add_row(
            need.claim,
            f"{need.check}: {need.effect_of}",
            _effect(need),
            str(need.count),
            f"{need.sd:.3g}",
            *(_need(found) for found in (need.seen, need.claimed, need.none)),
        )
    return table


def _effect(need: CheckPower) -> str:
    unit = "" if need.unit == "1" else f" {need.unit}"
    span = "" if need.interval is None else f" ({need.interval[0]:.3g} to {need.interval[1]:.3g})"
    return f"{need.estimate:.3g}{unit}{span}"


def _need(need: Need | None) -> str:
    """Say what one effect would take, with the number for normal effects in brackets."""
    from graycard.benchmarks.claims import MOST

    if need is None:
        return ""
    if need.scenes is None:
        return f"no reasonable number (more than {MOST} scenes)"
    normal = "" if need.normal is None else f" ({need.normal})"
    hours = "" if need.hours is None else f", {need.hours:.1f} h"
    seeds = "" if need.seeds is None else f", or {need.seeds} seeds"
    return f"{need.scenes}{normal} scenes{hours}{seeds}"
