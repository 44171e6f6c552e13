# SPDX-License-Identifier: Apache-2.0
"""Needs of the claims that a ledger leaves undecided, in words."""

from collections.abc import Sequence
from dataclasses import replace

from graycard.benchmarks.claims._claim import Paper
from graycard.benchmarks.claims._power import MOST, WANTED, CheckPower, claims_power
from graycard.benchmarks.claims._rules import OPEN
from graycard.records import ClaimResult, Ledger, RunRecord


def with_needs(ledger: Ledger, record: RunRecord, papers: Sequence[Paper]) -> Ledger:
    """Return a ledger whose undecided claims say what would decide them.

    Args:
        ledger: Verdicts with the effect on each scene.
        record: The run, for what fits cost.
        papers: The claims of the ledger.
    """
    needs = claims_power(ledger, record, papers)
    judged = (
        replace(
            paper,
            claims=tuple(
                replace(
                    c, needs=needs_words(c, [n for n in needs if (n.paper, n.claim) == (paper.name, c.id)])
                )
                for c in paper.claims
            ),
        )
        for paper in ledger.papers
    )
    return replace(ledger, papers=tuple(judged))


def needs_words(claim: ClaimResult, needs: Sequence[CheckPower]) -> str:
    """Say what would decide a claim; empty for one that is decided.

    Args:
        claim: As it was judged; one that is held back says itself what it needs.
        needs: What each of its undecided checks takes.
    """
    if claim.verdict not in OPEN or claim.needs:
        return claim.needs
    if not needs:
        return "scenes that differ more in the knob" if any(check.scenes for check in claim.checks) else ""
    hardest = max(needs, key=lambda need: need.seen.scenes or MOST + 1)
    seen = hardest.seen
    if seen.scenes is None:
        return f"more than {MOST} scenes, if the effect is as small as seen ({hardest.check})"
    words = f"about {seen.scenes} scenes for {WANTED:.0%} power, if the effect is as seen ({hardest.check})"
    return f"{words}, or {seen.seeds} seeds a scene" if seen.seeds else words
