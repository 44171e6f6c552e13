# SPDX-License-Identifier: Apache-2.0
"""Outcomes of cases, and their table."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Outcome:
    """Outcome of one case."""

    kind: str
    number: int
    fault: str = ""
    """Fault that was found; empty for none."""
    refused: bool = False
    """True if graycard refused the input in words."""
    steps: tuple[str, ...] = ()
    """Change that was made to the input."""
    detail: str = ""
    """A traceback, or what was written outside."""
    cpu_s: float = 0.0
    kept: str = ""
    """Folder with the input of a fault."""


@dataclass
class Report:
    """All that a run of the fuzzer found."""

    seed: int
    tries: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    cpu_s: Counter[str] = field(default_factory=Counter)
    faults: list[Outcome] = field(default_factory=list)

    def add(self, outcome: Outcome) -> None:
        """Count a case."""
        self.tries[outcome.kind] += 1
        self.refused[outcome.kind] += outcome.refused
        self.cpu_s[outcome.kind] += outcome.cpu_s  # pyright: ignore[reportArgumentType]
        if outcome.fault:
            self.faults.append(outcome)


def table(report: Report) -> str:
    """Return a row for each kind, then a line for each fault that differs from the others."""
    failed = Counter(outcome.kind for outcome in report.faults)
    rows: list[tuple[str, ...]] = [("kind", "tries", "refused", "failures", "CPU s")]
    rows += [
        (kind, str(tries), str(report.refused[kind]), str(failed[kind]), f"{report.cpu_s[kind]:.0f}")
        for kind, tries in sorted(report.tries.items())
    ]
    sums = report.tries.total(), report.refused.total(), failed.total()
    rows.append(("all", *map(str, sums), f"{sum(report.cpu_s.values()):.0f}"))
    return "\n".join([f"seed {report.seed}", *_columns(rows), *_fault_lines(report.faults)])


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    ]


def _fault_lines(faults: Sequence[Outcome]) -> list[str]:
    lines = []
    for fault, times in Counter(outcome.fault for outcome in faults).most_common():
        first = next(outcome for outcome in faults if outcome.fault == fault)
        lines.append(f"{times} x {fault}")
        lines.append(f"    first: {first.kind} {first.number}: {'; '.join(first.steps)}")
        lines.append(f"    input: {first.kept}")
    return lines
