# SPDX-License-Identifier: Apache-2.0
"""Tables of the docs that show how effects move with the size of pictures."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import fmean

from docs_of_editions import claims_in, scale_in_folder, values_of
from docs_of_reference import table
from graycard.benchmarks.claims._claim import Claim, load_claims
from graycard.benchmarks.claims._effects import Levels
from graycard.benchmarks.claims._rules import levels_for
from graycard.benchmarks.claims._sizes import Sized, estimates_at, read_sizes, turned_by_size
from graycard.eval.statistics import LEVEL
from graycard.records import CheckResult, RunRecord, read_run
from graycard.reports._format import format_with_unit
from graycard.reports.history._explain import NOT_TESTED

HEAD = ("claim", "difference", "decides")
MEANS = {
    "photographs": ("training_view.psnr", "dB"),
    "held-out views": ("novel_view.psnr", "dB"),
    "SSIM": ("novel_view.ssim", "1"),
    "LPIPS": ("novel_view.lpips", "1"),
}
"""Metrics and their units, by their words."""


def effects_block(paper: str, sealed: Path, runs: Sequence[Path]) -> str:
    """Return the effect of each check at each size, that on sealed scenes, and verdicts that would turn.

    Args:
        paper: Name of its claims.
        sealed: Folder of the run that judges.
        runs: Folders of runs that differ in size alone.
    """
    sizes = read_sizes(runs)
    scale = scale_in_folder(sealed)
    claims, judged = load_claims(paper), claims_in(sealed)
    rows: list[tuple[str, ...]] = []
    turned: list[str] = []
    compared: list[str] = []
    for claim in claims.claims:
        checks = {check.id: check for check in judged[claim.id].checks} if claim.id in judged else {}
        rows += list(_rows(claim, sizes, claims.track, checks))
        if claim.unavailable:
            continue
        if words := turned_by_size(claim, sizes, scale.words, claims.track, _levels(claim)):
            turned.append(f"- **{claim.id}** {words}.\n")
        if _is_compared(claim, sizes, claims.track):
            compared.append(claim.id)
    heads = [size.words.replace(f" pixels, {scale.train_views} views", "") for size in sizes]
    told = "".join(turned) or "No verdict by these estimates differs between these sizes.\n"
    missing = [name for name, claim in judged.items() if claim.verdict != NOT_TESTED and name not in compared]
    which = f"Compared: {', '.join(compared)}."
    if missing:
        which += f" Not compared, as rows or scenes are lacking: {', '.join(missing)}."
    return f"\n{table((*HEAD, *heads, f'`{sealed.name}`'), rows)}\n{which}\n\n{told}"


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


def effects_of(paper: str, runs: Sequence[Path]) -> dict[tuple[str, str], dict[str, float]]:
    """Return estimates by size, by claim and check."""
    sizes, claims = read_sizes(runs), load_claims(paper)
    return {
        (claim.id, check.id): estimates_at(sizes, check, claims.track, _levels(claim))
        for claim in claims.claims
        for check in claim.checks
    }


def _is_compared(claim: Claim, sizes: Sequence[Sized], track: str) -> bool:
    """Tell whether two sizes have an estimate of each check that decides a claim."""
    found = [estimates_at(sizes, c, track, _levels(claim)).keys() for c in claim.checks if c.decides]
    return bool(found) and len(set.intersection(*map(set, found))) > 1


def _levels(claim: Claim) -> Levels:
    """Return levels as a verdict has them; estimates do not depend on them."""
    return Levels(LEVEL, levels_for(claim.statements, LEVEL))


def means_block(folders: Mapping[str, Path]) -> str:
    """Return means of the rows of dark rooms in several runs, and how often their fits see each photograph.

    Args:
        folders: By the head of their column.
    """
    runs = {head: read_run(folder) for head, folder in folders.items()}
    means = {head: values_of(run) for head, run in runs.items()}
    lines = [
        (f"`{row}`, {words}", *(_mean(found.get((row, metric), []), unit) for found in means.values()))
        for row in ("appearance", "darkgs", "sunfaded")
        for words, (metric, unit) in MEANS.items()
    ]
    steps = [steps_of(run) for run in runs.values()]
    seen = [count / views_of(folder) for count, folder in zip(steps, folders.values(), strict=True)]
    first = ("steps", *(f"{count:,}" for count in steps))
    second = ("how often a fit sees each photograph", *(f"{times:.0f}" for times in seen))
    return f"\n{table(('', *folders), [first, second, *lines])}\n"


def steps_of(run: RunRecord) -> int:
    """Return the steps of each fit of a run."""
    found = {r.job.settings["iterations"] for r in run.results if "iterations" in r.job.settings}
    assert len(found) == 1, f"expected fits of as many steps, got {found}"
    return found.pop()


def views_of(folder: Path) -> int:
    """Return the number of training views of each scene of a published run."""
    return scale_in_folder(folder).train_views


def _mean(values: Sequence[float], unit: str) -> str:
    """Return a mean in its unit; empty where the run lacks the row."""
    return format_with_unit(fmean(values), unit) if values else ""
