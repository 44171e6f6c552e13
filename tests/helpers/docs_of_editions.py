# SPDX-License-Identifier: Apache-2.0
"""Tables of the docs that hold the ledger's second edition against the first."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from statistics import fmean

from docs_of_reference import cell, table
from graycard import RecordError
from graycard.benchmarks.claims._sizes import scale_in
from graycard.io import from_builtins, read_json
from graycard.records import CLAIMS, ClaimResult, Ledger, RunRecord, Scale, read_run
from graycard.reports.history._explain import NOT_TESTED
from graycard.reports.history._keep import OWN

SEALED = "-sealed"
"""Part of the name of a folder of the second edition, behind that of the first; a number may follow."""
HELD_BACK = ("undecided", "open")
AGREE = 0.9
"""Share of refits from which a verdict is stable."""


COLUMNS = {
    "novel views, dB": "novel_view.psnr",
    "training views, dB": "training_view.psnr",
    "SSIM": "novel_view.ssim",
    "LPIPS": "novel_view.lpips",
    "albedo, dB": "albedo.psnr.channel",
    "leakage": "albedo.leakage",
    "normals, °": "normal.mean_angle",
    "depth": "depth.abs_rel",
    "relit, dB": "relighting.psnr",
    "moved lamp, dB": "relighting.psnr.moved",
    "put in, dB": "composition.psnr",
    "without the object, dB": "counterfactual.psnr",
    "in the hole, dB": "counterfactual.psnr.footprint",
    "outside, dB": "counterfactual.psnr.rest",
    "mirror image left": "counterfactual.residual.mirror",
}
"""Metrics of the table of means, by the head of their column; one that no row has is left out."""


def claims_in(folder: Path) -> dict[str, ClaimResult]:
    """Return the claims of a published ledger by their names; papers' own tables are left out."""
    path = folder / CLAIMS
    ledger = from_builtins(Ledger, read_json(path), RecordError, str(path))
    found = (claim for paper in ledger.papers for claim in paper.claims)
    return {claim.id: claim for claim in found if claim.verdict not in ("consistent", "inconsistent")}


def is_decided(claim: ClaimResult) -> bool:
    """Tell whether a claim has a verdict that nine refits in ten would give."""
    testable = claim.verdict != NOT_TESTED
    return testable and claim.verdict not in HELD_BACK and (claim.stability or 0) >= AGREE


def newest_claims(folders: Iterable[Path]) -> dict[str, ClaimResult]:
    """Return each claim as the newest run has it that can test it, or else as the newest has it."""
    return {name: claim for name, (claim, _) in _newest(folders).items()}


def _newest(folders: Iterable[Path]) -> dict[str, tuple[ClaimResult, str]]:
    """Return the same with the name of the run."""
    found: dict[str, tuple[ClaimResult, str]] = {}
    for folder in sorted(folders, key=lambda folder: read_run(folder).started):
        for name, claim in claims_in(folder).items():
            if name not in found or claim.verdict != NOT_TESTED:
                found[name] = claim, folder.name
    return found


def whole_block(folders: Iterable[Path]) -> str:
    """Return how many claims are decided, and the verdict of each that can be tested."""
    newest = _newest(folders)
    names = sorted(newest, key=lambda name: ("SRG".index(name[0]), int(name[1:])))
    claims = {name: newest[name][0] for name in names}
    tested = [name for name in names if claims[name].verdict != NOT_TESTED]
    rows = [
        (name, cell(claims[name].sentence), _word(claims[name]), _share(claims[name]), f"`{newest[name][1]}`")
        for name in tested
    ]
    head = ("claim", "it says", "verdict", "refits that agree", "run")
    rest = ", ".join(name for name in names if name not in tested)
    words = decided_words(claims, "these runs")
    return f"{words}\n\n{table(head, rows)}\nNot testable on these runs: {rest}.\n"


def decided_words(claims: Mapping[str, ClaimResult], runs: str = "this run") -> str:
    """Return how many claims are decided, in a sentence."""
    testable = [claim for claim in claims.values() if claim.verdict != NOT_TESTED]
    decided = [claim for claim in testable if is_decided(claim)]
    words = Counter(claim.verdict for claim in decided)
    told = ", ".join(f"{number} {word}" for word, number in words.most_common())
    share = f"{len(decided)} of {len(testable)} claims and questions that {runs} can test are decided"
    them = "it" if runs == "this run" else "them"
    untested = len(claims) - len(testable)
    rest = f" {untested} more cannot be tested on {them}." if untested else ""
    return f"{share} ({100 * len(decided) / len(testable):.0f} %)" + (f": {told}." if told else ".") + rest


def edition_block(second: Path) -> str:
    """Return the tables of one run: each claim before and in it, and what decides or holds it back."""
    track = second.name.partition(SEALED)[0]
    before = {"first edition": claims_in(OWN / track)}
    if (earlier := second.with_name(track + SEALED)) != second:
        before["second edition, earlier scenes"] = claims_in(earlier)
    return _block(second, before, "second edition", claims_in(second))


def size_block(large: Path, small: Path) -> str:
    """Return the tables of a run of larger pictures: each claim that it can test, at both sizes."""
    sizes = picture_size(small), picture_size(large)
    if sizes[0] == sizes[1]:
        raise ValueError(f"expected runs of two sizes of pictures, got {sizes[0]} in {small} and {large}")
    claims = {name: claim for name, claim in claims_in(large).items() if claim.verdict != NOT_TESTED}
    return _block(large, {sizes[0]: claims_in(small)}, sizes[1], claims)


def picture_size(folder: Path) -> str:
    """Return the size of the pictures of a published run, as in "112 x 112"."""
    scale = scale_in_folder(folder)
    return f"{scale.width} x {scale.height}"


def scale_in_folder(folder: Path) -> Scale:
    """Return pixels, views and surfels of a published run."""
    scale = scale_in(folder, read_run(folder).size)
    assert scale is not None, f"expected {folder}/suite.json that tells pixels and views"
    return scale


def _block(
    folder: Path,
    before: Mapping[str, Mapping[str, ClaimResult]],
    head: str,
    claims: Mapping[str, ClaimResult],
) -> str:
    """Return the means of a run, its claims beside those of other runs, and what decides them."""
    rows = [
        (name, *(_word(run.get(name)) for run in before.values()), _word(claim), _share(claim))
        for name, claim in claims.items()
    ]
    reasons = [f"- **{name}** {cell(claim.sentence)} {cell(_why(claim))}\n" for name, claim in claims.items()]
    means = f"Means over the scenes that have such a score:\n\n{means_table(read_run(folder))}"
    verdicts = table(("claim", *before, head, "refits that agree"), rows)
    return f"\n{means}\n{decided_words(claims)}\n\n{verdicts}\n{''.join(reasons)}\n"


def means_table(run: RunRecord) -> str:
    """Return the means of each row over all scenes that have a metric; empty where the row lacks one."""
    found = values_of(run)
    names = [method.name for method in run.methods if method.name != "truth"]
    most = {metric: max(len(v) for k, v in found.items() if k[1] == metric) for _, metric in found}
    columns = {
        head: [_mean(found.get((name, metric), []), most[metric]) for name in names]
        for head, metric in COLUMNS.items()
        if metric in most
    }
    told = {head: cells for head, cells in columns.items() if any(cells)}
    rows = [(f"`{name}`", *cells) for name, *cells in zip(names, *told.values(), strict=True)]
    return table(("row", *told), rows)


def values_of(run: RunRecord) -> dict[tuple[str, str], list[float]]:
    """Return the finite values over scenes, by row and metric."""
    found: dict[tuple[str, str], list[float]] = {}
    for result in run.results:
        for score in result.sheet.scores if result.sheet else ():
            if score.value is not None and math.isfinite(score.value):
                found.setdefault((result.job.method, score.metric), []).append(score.value)
    return found


def _mean(values: list[float], scenes: int) -> str:
    """Return a mean with three digits; empty where scenes lack."""
    return f"{fmean(values):#.3g}" if len(values) == scenes else ""


def _word(claim: ClaimResult | None) -> str:
    if claim is None:
        return "not asked"
    return f"{claim.verdict} (by the checks: {claim.before})" if claim.before else claim.verdict


def _share(claim: ClaimResult) -> str:
    return "" if claim.stability is None else f"{100 * claim.stability:.0f} %"


def _why(claim: ClaimResult) -> str:
    """Return what decides a claim, what holds it back, and what would decide it."""
    return " ".join(f"{part[0].upper()}{part[1:]}." for part in _parts(claim))


def _parts(claim: ClaimResult) -> Iterator[str]:
    yield claim.text.partition("; upper bound")[0]
    if claim.suspended:
        yield f"held back: {claim.suspended}"
    if claim.needs:
        yield f"needs {claim.needs}"
