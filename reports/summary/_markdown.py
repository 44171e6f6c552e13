# SPDX-License-Identifier: Apache-2.0
"""A summary as Markdown that fits a comment of a pull request, without any link."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import get_args

from graycard.records import ClaimVerdict
from graycard.reports._format import (
    count,
    format_date,
    format_number,
    format_seconds,
    format_value,
    format_with_unit,
)
from graycard.reports.summary._escape import code, prose
from graycard.reports.summary._gate import GateCheck, GateSummary
from graycard.reports.summary._summary import ClaimSummary, JobSummary, PartSummary, RunSummary

LIMIT = 60_000
"""Characters of the whole text: GitHub refuses a comment of more than 65,536."""
MOST_LINES = 20
"""Lines of failures and of scores against a baseline; more are counted."""
Table = Iterable[Sequence[str]]


def markdown_of(summary: RunSummary) -> str:
    """Return the summary as Markdown; sections that would make it too long are named and left out."""
    text = "\n\n".join(_head(summary))
    left: list[str] = []
    for title, section in _sections(summary):
        if len(text) + len(section) > LIMIT:
            left.append(title)
        else:
            text += f"\n\n### {title}\n\n{section}"
    if left:
        text += f"\n\nLeft out, as this text would be too long: {', '.join(left)}. The report has all."
    return text + "\n"


def _head(summary: RunSummary) -> Iterator[str]:
    yield f"## graycard: {code(summary.suite)}, version {summary.suite_version}"
    yield f"**{'Passed' if summary.passed else 'Failed'}:** {_outcome(summary)}."
    facts = [
        count(len(summary.tracks), "track"),
        count(summary.scenes, "scene"),
        count(len(summary.methods), "row"),
        count(len(summary.jobs), "job"),
        format_seconds(summary.wall_s),
        prose(format_date(summary.started)),
        *([f"code {code(summary.commit)}"] if summary.commit else []),
    ]
    yield ", ".join(facts) + "."
    if summary.submitted:
        yield f"Made by other code, which nobody watched: {', '.join(map(code, summary.submitted))}."
    yield from (prose(warning) for warning in summary.warnings)


def _outcome(summary: RunSummary) -> str:
    dead = sum(job.status == "failed" for job in summary.jobs)
    scores = sum(len(job.failed_scores) for job in summary.jobs)
    of_jobs = f"{dead} of {count(len(summary.jobs), 'job')} failed" if dead else "no job failed"
    found = [
        of_jobs if summary.jobs else "the run has no jobs, so nothing was measured",
        f"{count(scores, 'score')} failed" if scores else "",
        _gate_outcome(summary.gate) if summary.gate else "",
    ]
    return "; ".join(filter(None, found))


def _gate_outcome(gate: GateSummary) -> str:
    if not gate.checks:
        return "the baseline expects no score"
    counted = ((gate.of(status), status) for status in ("worse", "missing", "better"))
    words = ", ".join(f"{len(checks)} {status}" for checks, status in counted if checks)
    return (
        f"{count(len(gate.checks), 'score')} held against {code(gate.baseline)}: {words or 'none is worse'}"
    )


def _sections(summary: RunSummary) -> Iterator[tuple[str, str]]:
    """Yield the title and the text of each section that has something to say, the most urgent first."""
    if failed := summary.failed_jobs:
        yield "Failures", _listed([_failure(job) for job in failed], "failure")
    if summary.gate and (changed := [*summary.gate.of("worse"), *summary.gate.of("missing")]):
        yield "Against the baseline", _gate_table(changed)
    if summary.leaks:
        title = "Better than the noise of the truth allows: truth has leaked"
        yield title, _listed([code(leak) for leak in summary.leaks], "score")
    if any(part.kind != "nobody" for track in summary.tracks for part in track.parts):
        yield "Who is best", _best_table(summary)
    if summary.claims:
        yield "What papers claim", _claims(summary.claims)


def _failure(job: JobSummary) -> str:
    which = f"{code(f'{job.track}/{job.scene}')} {code(job.method)}, seed {job.seed}"
    if job.status == "failed":
        return f"{which}: {code(job.reason or 'no reason is known')}"
    reasons = dict.fromkeys(f"{score.metric}: {score.reason}" for score in job.failed_scores)
    first, more = next(iter(reasons)), len(job.failed_scores) - 1
    return f"{which}: {code(first)}" + (f", and {count(more, 'score')} more" if more else "")


def _listed(lines: Sequence[str], noun: str) -> str:
    shown = [f"- {line}" for line in lines[:MOST_LINES]]
    more = len(lines) - len(shown)
    return "\n".join([*shown, *([f"- {count(more, f'more {noun}')}"] if more else [])])


def _gate_table(changed: Sequence[GateCheck]) -> str:
    heads = ("", "Score", "Expected", "Got", "Worse by", "Allowed")
    rows = [_gate_row(check) for check in changed[:MOST_LINES]]
    more = len(changed) - len(rows)
    note = f"\n\n{count(more, 'more score')}." if more else ""
    return _table(heads, rows, numbers=range(2, 6)) + note


def _gate_row(check: GateCheck) -> tuple[str, ...]:
    seed = f", seed {check.seed}" if check.seed else ""
    which = f"{code(f'{check.track}/{check.scene}')} {code(check.method)} {code(check.metric)}{seed}"
    expected = format_with_unit(check.expected, check.unit)
    if check.found is None:
        return check.status, which, expected, prose(check.reason or "none"), "", ""
    return (
        check.status,
        which,
        expected,
        format_value(check.found, check.unit),
        format_number(check.loss),
        format_number(check.tolerance),
    )


def _best_table(summary: RunSummary) -> str:
    heads = ("Track", "Judged by", "Best", "Mean", "95 % interval", "How surely")
    told = ((track.name, part) for track in summary.tracks for part in track.parts if part.kind != "nobody")
    return _table(heads, [_best_row(track, part) for track, part in told], numbers=(3, 4))


def _best_row(track: str, part: PartSummary) -> tuple[str, ...]:
    better = "higher" if part.higher_is_better else "lower"
    unit = "" if part.unit == "1" else f", {part.unit}"
    mean = "" if part.mean is None else format_value(part.mean, part.unit)
    ends = [format_value(end, part.unit) for end in part.interval or ()]
    sure = "; ".join(filter(None, (part.verdict, part.lead, part.evidence)))
    return (
        code(track),
        prose(f"{part.title}{unit}, {better} is better"),
        code(part.best) if part.best else "nobody",
        mean,
        " to ".join(ends) or "none",
        prose(sure),
    )


def _claims(claims: Sequence[ClaimSummary]) -> str:
    counted = Counter(claim.verdict for claim in claims)
    words = ", ".join(
        f"{counted[verdict]} {verdict}" for verdict in get_args(ClaimVerdict) if counted[verdict]
    )
    heads = ("Claim", "Verdict", "Refits that agree", "Says")
    rows = [
        (
            code(claim.id),
            claim.verdict,
            "" if claim.stability is None else f"{claim.stability:.0%}",
            prose(claim.sentence),
        )
        for claim in claims
    ]
    whole = _table(heads, rows, numbers=(2,))
    return f"{words}.\n\n<details><summary>Each claim</summary>\n\n{whole}\n\n</details>"


def _table(heads: Sequence[str], rows: Table, numbers: Iterable[int]) -> str:
    aligned = ["---:" if column in set(numbers) else "---" for column in range(len(heads))]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (heads, aligned, *rows))
