# SPDX-License-Identifier: Apache-2.0
"""Verdicts of a run on the claims of papers: a verdict for each, with everything that it follows from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from graycard._errors import RecordError
from graycard.io import Label, Name, read_json
from graycard.records._looks import Edition
from graycard.records._run import read_record

CLAIMS = "claims.json"
"""Beside ``run.json``; made from it and from the files of claims alone."""
CLAIMS_VERSION = 2
_ANEW = "Judge the run again: graycard claims RUN"

ClaimVerdict = Literal[
    "reproduced", "larger than claimed", "smaller than claimed", "no effect", "contradicted",
    "undecided", "not testable here",
    "holds", "does not hold", "open",
    "consistent", "inconsistent",
]  # fmt: skip
"""Words for claims of papers; then those for graycard's own questions, which share ``not testable here``;
then those for the figures of a paper's table held against each other."""

Asker = Literal["paper", "graycard"]


@dataclass(frozen=True, slots=True)
class RowMean:
    """A row of the run by the quantity of a check."""

    row: Label
    value: float | None
    """Mean over the scenes of the check; None where the row lacks one."""
    reason: str = ""
    """Why there is none, or what stands in its place."""


@dataclass(frozen=True, slots=True)
class CheckResult:
    """One comparison that a claim comes down to."""

    id: str
    says: str
    """Expected observation, in words."""
    quantity: str
    """In words, as in ``Novel view PSNR``."""
    unit: str
    """Unit of the effect; ``×`` where it is a ratio."""
    effect_of: str
    """Making of the effect from rows, in words."""
    rule: str
    """Condition for "reproduced", in words; empty where the rule of the claim says all."""
    verdict: ClaimVerdict
    reason: str
    """Basis of the verdict, in words."""
    decides: bool
    """True if it counts for the verdict of its claim, or is told beside it."""
    scenes: Mapping[str, float] = field(default_factory=dict)
    """Effect by scene, the mean over seeds: above 0 (of a ratio: 1) as claimed, or by ``effect_of``."""
    estimate: float | None = None
    """Hodges-Lehmann estimate of the effect over scenes; along a knob the change of the fitted line."""
    interval: tuple[float, float] | None = None
    """Its interval at the ledger's level for scenes and fits like these; ends may be infinite."""
    p_rank: float | None = None
    """Exact Wilcoxon signed-rank test against no effect."""
    scene_sd: float | None = None
    """Standard deviation of the effect between scenes, fits apart; of ratios, of their logarithm."""
    seed_sd: float | None = None
    """Standard deviation of the effect between fits of one scene; None where nobody measured it."""
    noise_from: str = ""
    """Source of ``seed_sd``, in words."""
    stability: float | None = None
    """Share of simulated refits of the same scenes with the same verdict; None where ``seed_sd`` is."""
    at_budgets: Mapping[str, float] = field(default_factory=dict)
    """The estimate in runs with other budgets of steps, by their factor, as ``0.5``."""
    at_sizes: Mapping[str, float] = field(default_factory=dict)
    """The estimate on the scenes of runs that differ in size alone, by their size in words."""
    neutral: float = 0.0
    """The effect that is none: 0, of a ratio 1."""
    paper: float | None = None
    """The effect in the paper, in the same unit and sense; None where it names none."""
    accepted: tuple[float, float] | None = None
    """Effects of the claimed size, or differences small enough; ends may be infinite."""
    rows: tuple[RowMean, ...] = ()
    """Those compared."""
    bound: RowMean | None = None
    """Best possible row: the row that is handed truth."""
    trivial: RowMean | None = None
    """Trivial row, which costs nothing."""


@dataclass(frozen=True, slots=True)
class RowFit:
    """A fitted row of the run, for the reader who asks if it was fitted to the end."""

    row: Label
    steps: int | None
    """Steps of each fit; None where the method has no such setting."""
    training: float | None
    """Mean PSNR of training views over the scenes of the claim, dB."""
    held_out: float | None
    """Mean PSNR of held-out views over the same scenes, dB."""


@dataclass(frozen=True, slots=True)
class Budget:
    """The means of a verdict beside those of the paper."""

    paper: Mapping[str, str] = field(default_factory=dict)
    """By what is counted, as ``steps`` or ``pixels``."""
    here: Mapping[str, str] = field(default_factory=dict)
    fits: tuple[RowFit, ...] = ()


@dataclass(frozen=True, slots=True)
class ClaimResult:
    """One claim of a paper, judged."""

    id: str
    sentence: str
    source: str
    """Paper, table or section."""
    verdict: ClaimVerdict
    text: str
    """The verdict in a sentence or two."""
    rule: str
    """Rule from checks to the verdict, in words."""
    checks: tuple[CheckResult, ...] = ()
    asked_by: Asker = "paper"
    """``graycard``: a question of ours, which no paper claims; it has words of its own."""
    stability: float | None = None
    """Share of simulated refits of the same scenes with the same verdict; None where nobody knows."""
    suspended: str = ""
    """Reasons to hold the verdict back; empty if it stands."""
    before: ClaimVerdict | None = None
    """The verdict of the rule, where it is held back."""
    needs: str = ""
    """Needs that would decide it, in words; empty for what is decided."""
    budget: Budget = field(default_factory=Budget)
    figures: Mapping[str, str] = field(default_factory=dict)
    """Figures of the paper, by name."""
    notes: tuple[str, ...] = ()
    """Differences from the paper."""
    turns: str = ""
    """Sizes of pictures, views or surfels at which estimates alone would give another verdict, in words."""

    @property
    def sizes_compared(self) -> tuple[str, ...]:
        """Sizes at which each check that decides has an estimate, from small to large; none if below two."""
        found = [check.at_sizes for check in self.checks if check.decides]
        common = [size for size in found[0] if all(size in sizes for sizes in found)] if found else []
        return tuple(common) if len(common) > 1 else ()


@dataclass(frozen=True, slots=True)
class PaperResult:
    """All claims of one paper."""

    name: Name
    version: int
    title: str
    claims_sha256: str
    """Hash of the file that the claims were read from."""
    claims: tuple[ClaimResult, ...]


@dataclass(frozen=True, slots=True)
class Ledger:
    """Verdicts of a run on the claims of papers: ``claims.json``."""

    suite: str
    """Empty where no run was judged but papers' tables against themselves."""
    suite_version: int
    run_sha256: str
    """Hash of ``run.json``; empty without a run."""
    level: float
    """Level of all intervals, as in 0.95."""
    rules: Mapping[str, str]
    """Meaning of each rule, by its name."""
    methods: Mapping[str, str]
    """Method and settings of each row, by its label."""
    papers: tuple[PaperResult, ...]
    edition: Edition | None = None
    """Tag of the code and of these claims, for a run on sealed scenes."""
    format: str = "graycard-claims"
    format_version: int = CLAIMS_VERSION


def read_ledger(run: Path) -> Ledger | None:
    """Return the ledger in a run folder; None where claims were not judged.

    Raises:
        RecordError: It is damaged, misspelt, or of an older or a newer format.
    """
    path = Path(run) / CLAIMS
    if not path.is_file():
        return None
    try:
        data = read_json(path)
    except RecordError as cause:
        raise RecordError(f"{cause}. {_ANEW}") from cause
    if isinstance(data, dict) and data.get("format_version") == 1:
        raise RecordError(
            f"expected claims of format version {CLAIMS_VERSION} in {path}, got version 1, whose verdicts "
            f"mean something else. {_ANEW}"
        )
    return read_record(Ledger, path, "graycard-claims", CLAIMS_VERSION)


def find_claim(ledger: Ledger, claim: str) -> ClaimResult:
    """Return the result of a claim by its id.

    Raises:
        RecordError: The ledger has none of this id.
    """
    found = [c for paper in ledger.papers for c in paper.claims if c.id == claim]
    if not found:
        raise RecordError(f"expected a claim of this ledger, got {claim!r}")
    return found[0]
