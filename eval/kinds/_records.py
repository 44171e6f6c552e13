# SPDX-License-Identifier: Apache-2.0
"""Records of metrics, by the scale that their numbers are on."""

import math

from graycard.records import Invariance, MetricRecord

GLOBAL: tuple[Invariance, ...] = ("global gain",)
CHANNEL: tuple[Invariance, ...] = ("global gain", "channel gain")
ANY: tuple[Invariance, ...] = ("global gain", "channel gain", "sign")
IGNORED: dict[str, tuple[Invariance, ...]] = {"raw": (), "scalar": GLOBAL, "channel": CHANNEL}
"""Invariances of metrics by kind of gauge."""


def decibels(
    group: str,
    name: str,
    title: str,
    formula: str,
    *,
    headline: bool = False,
    tolerance: float = 0.3,
    ignores: tuple[Invariance, ...] = (),
) -> MetricRecord:
    """Return the record of a PSNR: dB, more is better, without a bound.

    Args:
        group: Part of the decomposition that is judged; the id begins with it.
        name: Rest of the id.
        title: Short, for a table head.
        formula: In words and symbols.
        headline: Show it in the leaderboard.
        tolerance: By how much it may get worse before the gate fails.
        ignores: The gauge groups under which it does not change.
    """
    return MetricRecord(
        id=f"{group}.{name}",
        title=title,
        group=group,
        unit="dB",
        higher_is_better=True,
        optimum=math.inf,
        formula=formula,
        headline=headline,
        tolerance=tolerance,
        ignores=ignores,
    )


def share(
    group: str,
    name: str,
    title: str,
    formula: str,
    *,
    percent: bool = False,
    tolerance: float | None = None,
    ignores: tuple[Invariance, ...] = (),
) -> MetricRecord:
    """Return the record of a share or likeness: more is better, at most 1, or 100 %.

    Args:
        group: As of :func:`decibels`.
        name: As of :func:`decibels`.
        title: As of :func:`decibels`.
        formula: As of :func:`decibels`.
        percent: State it in per cent.
        tolerance: As of :func:`decibels`; without, a hundredth of the optimum.
        ignores: As of :func:`decibels`.
    """
    best = 100.0 if percent else 1.0
    return MetricRecord(
        id=f"{group}.{name}",
        title=title,
        group=group,
        unit="%" if percent else "1",
        higher_is_better=True,
        optimum=best,
        formula=formula,
        headline=False,
        tolerance=best / 100 if tolerance is None else tolerance,
        ignores=ignores,
    )


def error(
    group: str,
    name: str,
    title: str,
    formula: str,
    *,
    unit: str = "1",
    headline: bool = False,
    tolerance: float,
    ignores: tuple[Invariance, ...] = (),
) -> MetricRecord:
    """Return the record of an error: less is better, 0 is perfect; arguments as of :func:`decibels`."""
    return MetricRecord(
        id=f"{group}.{name}",
        title=title,
        group=group,
        unit=unit,
        higher_is_better=False,
        optimum=0.0,
        formula=formula,
        headline=headline,
        tolerance=tolerance,
        ignores=ignores,
    )
