# SPDX-License-Identifier: Apache-2.0
"""One prediction by every published protocol: how far apart the numbers are that the rules alone make."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from graycard.records import JobResult
from graycard.reports._format import format_value
from graycard.reports.tables._cells import mean_over_scenes
from graycard.reports.tables._intervals import axis_of


@dataclass(frozen=True, slots=True)
class Dot:
    """One protocol in a strip."""

    place: float
    """Percent of the width."""
    label: str


@dataclass(frozen=True, slots=True)
class Strip:
    """One method's numbers by all protocols of one unit."""

    method: str
    dots: tuple[Dot, ...]
    spread: str
    """Highest less lowest."""


@dataclass(frozen=True, slots=True)
class Spread:
    """The protocols of one unit: a strip for each method on a common axis, and the same as a table."""

    unit: str
    direction: str
    ends: tuple[str, str]
    strips: tuple[Strip, ...]
    methods: tuple[str, ...]
    rows: tuple[tuple[str, tuple[str, ...]], ...]
    """Protocol, and the value of each method; a dash where there is none."""


def protocol_spreads(results: Sequence[JobResult], methods: Sequence[str]) -> tuple[Spread, ...]:
    """Return the spread of each method's prediction of one scene over protocols; of several seeds the mean.

    Numbers of different units stand on axes of their own. A protocol without a finite value is in the
    table alone.
    """
    found = {name: _values([r for r in results if r.job.method == name]) for name in methods}
    scores = [s for r in results if r.sheet for s in r.sheet.protocols]
    kinds = dict.fromkeys((s.unit, s.higher_is_better) for s in scores)
    spreads = []
    for unit, up in kinds:
        protocols = dict.fromkeys(s.protocol for s in scores if s.unit == unit)
        spread = _spread(found, list(protocols), unit, "higher is better" if up else "lower is better")
        spreads += [spread] if spread else []
    return tuple(spreads)


def _spread(
    found: Mapping[str, Mapping[str, float]], protocols: Sequence[str], unit: str, direction: str
) -> Spread | None:
    here = {name: {p: values[p] for p in protocols if p in values} for name, values in found.items()}
    here = {name: values for name, values in here.items() if values}
    axis = axis_of((v for values in here.values() for v in values.values()), unit)
    if axis is None:
        return None
    strips = []
    for name, values in here.items():
        dots = [Dot(axis.place(v), f"{p}: {format_value(v, unit)}") for p, v in values.items()]
        width = max(values.values()) - min(values.values()) if len(set(values.values())) > 1 else 0.0
        strips.append(Strip(name, tuple(dots), format_value(width, unit)))
    rows = [(p, tuple(_text(values.get(p), unit) for values in here.values())) for p in protocols]
    return Spread("" if unit == "1" else unit, direction, axis.ends, tuple(strips), tuple(here), tuple(rows))


def _values(results: Sequence[JobResult]) -> dict[str, float]:
    """Value by protocol, the mean over the results that have one."""
    scored = [
        (s.protocol, s.value)
        for r in results
        for s in (r.sheet.protocols if r.sheet else ())
        if s.status == "scored" and s.value is not None
    ]
    names = dict.fromkeys(p for p, _ in scored)
    return {n: mean_over_scenes((n, v) for p, v in scored if p == n) for n in names}


def _text(value: float | None, unit: str) -> str:
    return "–" if value is None else format_value(value, unit)
