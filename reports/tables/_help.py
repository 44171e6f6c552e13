# SPDX-License-Identifier: Apache-2.0
"""Help for the reader of a metric, in words."""

from collections.abc import Iterable
from dataclasses import dataclass

from graycard.records import MetricRecord
from graycard.reports._format import format_name, format_value

_NEIGHBOURS = {
    "interior": "pixels of one surface and colour",
    "boundary": "the other pixels",
    "srgb": "compared in sRGB",
    "linear": "compared in linear light",
    "mean_of_views": "mean of the values of the views",
    "debiased": "the noise of the truth taken off",
}
"""The rules of a breakdown."""

_IGNORED = {
    "global gain": "one factor on the prediction",
    "channel gain": "one factor a channel",
    "sign": "the sign",
}


@dataclass(frozen=True, slots=True)
class MetricHead:
    """A metric as the head of a column or row, with the help that explains it."""

    id: str
    title: str
    group: str
    unit: str
    """Empty where the metric has none."""
    arrow: str
    direction: str
    optimum: str
    formula: str
    ignores: str = ""
    """Changes of a prediction that leave the score as it is; empty for none."""
    tolerance: str = ""
    """A difference that the gate still lets pass."""
    here: str = ""
    """The worst and best value of this table, and whose they are."""
    counts: bool = True
    """True if it counts for the order of a leaderboard: fewer than two methods cannot be compared."""
    scenes: str = ""
    """Words on the scenes that have such a score, as ``7 of 8 scenes``; empty where all have."""


def metric_head(record: MetricRecord) -> MetricHead:
    """Return a metric with its direction in words."""
    up, unit = record.higher_is_better, "" if record.unit == "1" else record.unit
    allowed = f"{format_value(record.tolerance, record.unit)} {unit}".strip()
    return MetricHead(
        record.id,
        record.title,
        record.group,
        unit,
        "↑" if up else "↓",
        "higher is better" if up else "lower is better",
        format_value(record.optimum, record.unit),
        record.formula,
        " and ".join(_IGNORED.get(name, name) for name in record.ignores),
        allowed if record.tolerance else "",
    )


def explain_rules(rules: Iterable[str]) -> str:
    """Return what the rules of a breakdown are, in one line."""
    known = {rule: _NEIGHBOURS[rule] for rule in dict.fromkeys(rules) if rule in _NEIGHBOURS}
    return "; ".join(f"{format_name(rule).lower()}: {meaning}" for rule, meaning in known.items())
