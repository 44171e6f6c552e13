# SPDX-License-Identifier: Apache-2.0
"""The same scenes at several sizes: how effects move, and which verdicts their estimates alone would turn."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from graycard import RecordError
from graycard.benchmarks.claims._claim import Check, Claim
from graycard.benchmarks.claims._effects import Effect, Levels, effect_in
from graycard.benchmarks.claims._readings import Readings
from graycard.benchmarks.claims._rules import combined, verdict_of, words_of
from graycard.io import read_json
from graycard.records import SUITE_FILE, ClaimVerdict, RunRecord, Scale, Size, read_run, scale_of


@dataclass(frozen=True, slots=True)
class Sized:
    """A run at one size of pictures, with one number of views, and with one number of surfels."""

    words: str
    """Its size, as in ``256 x 256 pixels, 20 views, 2 times the surfels``."""
    readings: Readings


def read_sizes(runs: Sequence[Path]) -> tuple[Sized, ...]:
    """Return runs of one suite that differ in size alone; from small to large.

    Args:
        runs: Folders of runs, as of ``graycard bench SUITE --pixels 256``; none for no sizes.

    Raises:
        RecordError: There is one alone, a folder keeps no suite, two have one size, or they differ in suite,
            budget, scenes or seeds.
    """
    found = sorted((_scale(run, record), number, record) for number, (run, record) in enumerate(_read(runs)))
    if len(runs) == 1:
        raise RecordError(f"expected runs at two or more sizes, got one, {runs[0]}. Add that of another size")
    sized = [Sized(scale.words, Readings(record)) for scale, _, record in found]
    if twice := next((a.words for a, b in pairwise(sized) if a.words == b.words), ""):
        raise RecordError(f"expected runs that differ in size, got two of {twice}. Leave one out")
    return tuple(sized)


def estimates_at(sizes: Sequence[Sized], check: Check, track: str, levels: Levels) -> dict[str, float]:
    """Return the estimate of a check by size; sizes whose run lacks it are left out."""
    found = {size.words: effect_in(size.readings, check, track, levels) for size in sizes}
    return {words: effect.estimate for words, effect in found.items() if effect}


def turned_by_size(
    claim: Claim, sizes: Sequence[Sized], here: str, track: str, levels: Levels, judged: str = ""
) -> str:
    """Say which verdict estimates alone would give at another size; empty where it is the same at all.

    The few scenes of such runs give no intervals that decide, so this names a verdict and holds none back.

    Args:
        claim: The claim.
        sizes: From small to large.
        here: The size of the run that is judged, as :attr:`Sized.words`; others are compared with it, or with
            the smallest where none has it.
        track: Of the scenes.
        levels: Of the intervals; estimates do not depend on them.
        judged: The verdict of the run itself; a size that gives it, where ``here`` does not, is marked.
    """
    said = {size.words: _alone(claim, size.readings, track, levels) for size in sizes}
    known = {words: verdict for words, verdict in said.items() if verdict is not None}
    if len(known) < 2:
        return ""
    own = here if here in known else next(iter(known))
    turned = [
        f"{verdict} at {words}{' (as in this run)' if verdict == judged else ''}"
        for words, verdict in known.items()
        if verdict != known[own]
    ]
    return f"by estimates alone {known[own]} at {own}, but {', '.join(turned)}" if turned else ""


def _alone(claim: Claim, readings: Readings, track: str, levels: Levels) -> ClaimVerdict | None:
    """Return the verdict of a claim if estimates had no error; None where a check that decides is lacking."""
    checks = [check for check in claim.checks if check.decides]
    effects = [effect_in(readings, check, track, levels) for check in checks]
    verdicts: list[ClaimVerdict] = []
    for check, effect in zip(checks, effects, strict=True):
        if effect is None:
            return None
        point = effect.estimate, effect.estimate
        steps = tuple((middle, middle) for middle, _ in effect.steps)
        verdicts.append(verdict_of(check, Effect(effect.estimate, point, point, steps), claim.verdict_by))
    verdict = combined(verdicts, claim.verdict_by)
    return words_of(claim).get(verdict, verdict)


def scale_in(run: Path, size: Size) -> Scale | None:
    """Return the scale of a run from the suite that its folder keeps; None where it keeps none that tells.

    Args:
        run: The folder.
        size: Differences of the run from its suite.

    Raises:
        RecordError: The suite is no JSON.
    """
    path = Path(run) / SUITE_FILE
    return scale_of(read_json(path), size) if path.is_file() else None


def _read(runs: Sequence[Path]) -> list[tuple[Path, RunRecord]]:
    """Return the records of runs with their folders.

    Raises:
        RecordError: They differ in more than their size.
    """
    found = [(run, read_run(run)) for run in runs]
    for run, record in found[1:]:
        wanted, facts = _facts(found[0][1]), _facts(record)
        if what := next((what for what in wanted if wanted[what] != facts[what]), ""):
            raise RecordError(
                f"expected a run with {what} {wanted[what]} in {run}, as in {runs[0]}, got {facts[what]}. "
                "Make both by one suite, as with `graycard bench SUITE --pixels 256`"
            )
    return found


def _facts(run: RunRecord) -> dict[str, object]:
    """Return what runs have in common that differ in their size alone."""
    return {
        "suite": f"{run.suite} version {run.suite_version}",
        "budget": run.budget,
        "scenes": sorted(f"{scene.track}/{scene.scene}" for scene in run.scenes),
        "seeds": sorted({result.job.seed for result in run.results}),
    }


def _scale(run: Path, record: RunRecord) -> Scale:
    """Return the scale of a run.

    Raises:
        RecordError: Its folder does not tell.
    """
    scale = scale_in(run, record.size)
    if scale is None:
        raise RecordError(
            f"expected a run with {SUITE_FILE} that tells pixels and views, got none in {run}. Copy it from "
            "where run.json comes from, or run `graycard bench` again"
        )
    return scale
