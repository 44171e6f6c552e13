# SPDX-License-Identifier: Apache-2.0
"""Tables of the docs that show how effects move with the size of pictures."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from docs_of_editions import claims_in
from docs_of_reference import table
from graycard.benchmarks.claims._claim import Claim, load_claims
from graycard.benchmarks.claims._effects import Levels
from graycard.benchmarks.claims._rules import levels_for
from graycard.benchmarks.claims._sizes import Sized, estimates_at, read_sizes, scale_in, turned_by_size
from graycard.eval.statistics import LEVEL
from graycard.records import CheckResult, read_run
from graycard.reports._format import format_with_unit

HEAD = ("claim", "difference", "decides")


def effects_block(paper: str, sealed: Path, runs: Sequence[Path]) -> str:
    """Return the effect of each check at each size, that on sealed scenes, and verdicts that would turn.

    Args:
        paper: Name of its claims.
        sealed: Folder of the run that judges.
        runs: Folders of runs that differ in size alone.
    """
    sizes = read_sizes(runs)
    scale = scale_in(sealed, read_run(sealed).size)
    assert scale is not None
    claims, rows, turned = load_claims(paper), [], []
    judged = claims_in(sealed)
    for claim in claims.claims:
        checks = {check.id: check for check in judged[claim.id].checks} if claim.id in judged else {}
        rows += list(_rows(claim, sizes, claims.track, checks))
        if claim.unavailable:
            continue
        if words := turned_by_size(claim, sizes, scale.words, claims.track, _levels(claim)):
            turned.append(f"- **{claim.id}** {words}.\n")
    heads = [size.words.replace(f" pixels, {scale.train_views} views", "") for size in sizes]
    told = "".join(turned) or "No verdict would turn by these estimates.\n"
    return f"\n{table((*HEAD, *heads, f'`{sealed.name}`'), rows)}\n{told}"


def _rows(
    claim: Claim, sizes: Sequence[Sized], track: str, judged: dict[str, CheckResult]
) -> Iterator[tuple[str, ...]]:
    """Yield the line of each check that two sizes have."""
    for check in claim.checks:
        found = estimates_at(sizes, check, track, _levels(claim))
        if len(found) < 2 or check.id not in judged:
            continue
        result = judged[check.id]
        values = [found.get(size.words) for size in sizes]
        cells = ["" if v is None else format_with_unit(v, result.unit) for v in (*values, result.estimate)]
        yield claim.id, f"{result.quantity}, {result.effect_of}", "yes" if check.decides else "", *cells


def _levels(claim: Claim) -> Levels:
    """Return levels as a verdict has them; estimates do not depend on them."""
    return Levels(LEVEL, levels_for(claim.statements, LEVEL))
