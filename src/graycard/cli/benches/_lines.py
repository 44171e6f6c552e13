# SPDX-License-Identifier: Apache-2.0
"""Lines that say how a bench ended."""

from __future__ import annotations

from collections.abc import Iterable

from graycard.cli._terminal import Terminal
from graycard.records import JobResult, Looks, RunRecord


def left_out(name: str, record: RunRecord) -> str:
    """Return advice where a suite has secret scenes that a run has not; empty else."""
    from graycard.benchmarks import load_suite

    secret = load_suite(name).secret
    if secret is None or record.commitment or record.edition:
        return ""
    scenes = f"{secret.count} secret scene{'s' * (secret.count != 1)} of the suite"
    holder = f"whoever holds the salt of {secret.commitment[:12]}… adds them by --salt FILE"
    return f"{scenes} were left out: {holder}"


def show_looks(looks: Looks, scenes: int, terminal: Terminal) -> bool:
    """Say how a run that adds scenes ended; return true if it lost a claim on the way."""
    for name, why in looks.untestable.items():
        told = "can no longer be tested" if name in looks.lost else "cannot be tested"
        terminal.err.print(f"{told}: {name}: {why}")
    left = ", ".join(looks.made[-1].undecided) or "none"
    terminal.out.print(
        f"looks: {len(looks.made)} at {100 * looks.level:.2f} % each, {scenes} of at most {looks.most} "
        f"scenes; {looks.stopped}; undecided: {left}"
    )
    return bool(looks.lost)


def failures(results: Iterable[JobResult]) -> list[str]:
    """Return a line for each job that failed, and for each score that failed."""
    lines = []
    for result in results:
        where = f"{result.job.track}/{result.job.scene} {result.job.method}"
        if result.status == "failed":
            lines.append(f"{where}: {result.reason}")
        for score in result.sheet.scores if result.sheet else ():
            if score.status == "failed":
                lines.append(f"{where} {score.metric}: {score.reason}")
    return lines
