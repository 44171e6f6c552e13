# SPDX-License-Identifier: Apache-2.0
"""Claims of a paper as data: a TOML file says what was claimed, of which rows, and what would show it."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from graycard import TRACKS, RecordError, UnknownNameError
from graycard.io import Label, Name, from_builtins, read_toml
from graycard.records import Asker

FOLDER = Path(__file__).parent

Rule = Literal["better", "within", "monotone"]
Expects = Literal["higher", "lower"]
Scale = Literal["difference", "ratio"]
Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Quantity:
    """Compared quantity: one number of a row on a scene."""

    metric: str
    """Id of a metric; or ``cost.wall_s``, ``cost.peak_memory_mib``, or ``count.<name>`` for what a method
    counts itself. Whether views are held out or trained on is part of the metric."""
    less: str = ""
    """A second metric in the same unit, subtracted from it."""
    part: str = ""
    """Part of the score's breakdown to read in its place."""
    protocol: str = ""
    """A published protocol, whose score is read in place of a metric's; ``metric`` is then its title."""

    @property
    def is_plain(self) -> bool:
        """Return whether it is the metric itself, of which the best row is known to be the best."""
        return not self.less


@dataclass(frozen=True, slots=True)
class Scenes:
    """Scenes of the track; all, where nothing is said."""

    families: tuple[str, ...] = ()
    knobs: Mapping[str, Span] = field(default_factory=dict)
    """Least and greatest value of knobs."""


@dataclass(frozen=True, slots=True)
class Along:
    """A knob that scenes differ in; an effect is then its change between two values of it."""

    knob: str
    low: float
    high: float

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"expected low below high along {self.knob}, got {self.low}, {self.high}")


@dataclass(frozen=True, slots=True)
class Check:
    """One comparison: rows of a suite, a quantity, a rule."""

    id: Label
    says: str
    """Expected observation, in words."""
    rule: Rule
    quantity: Quantity
    rows: tuple[str, ...]
    """One row, judged against ``against``; two, the first against the second; or one for each level."""
    expects: Expects
    """Claimed direction: whether the first row is claimed to have the higher or the lower value, or
    whether values rise or fall with the levels: effects in this sense are positive."""
    minus: tuple[str, ...] = ()
    """Rows that are subtracted from those of the levels, one for each."""
    levels: tuple[float, ...] = ()
    """Levels of ``monotone``, rising; 0, 1, 2, ... if left out."""
    against: float = 0.0
    """Number that a single row is judged against."""
    scale: Scale = "difference"
    """``ratio``: how many times as large, which is what costs are compared by."""
    paper: float | None = None
    """The effect in the paper, in the unit of the quantity and the claimed sense."""
    accepted: Span | None = None
    """``better``: effects of the claimed size, half to twice the paper's if left out. ``within``: what the
    interval has to lie in."""
    along: Along | None = None
    scenes: Scenes = field(default_factory=Scenes)
    negligible: float = 0.0
    """An interval no further from no effect than this is called none, however certain; in the unit of the
    quantity, or, of a ratio, as a part of 1. Not for ``within``, which has bounds."""
    decides: bool = True
    """False for a check that is shown beside the others, as that of a stand-in for the paper's metric."""

    def __post_init__(self) -> None:
        for found in (_rows_fault(self), _size_fault(self)):
            if found:
                raise ValueError(f"expected {found} of check {self.id!r}")

    @property
    def neutral(self) -> float:
        """The effect that is none."""
        return 1.0 if self.scale == "ratio" else 0.0

    @property
    def range(self) -> Span | None:
        """Effects of the claimed size; None where any will do that has the claimed sign."""
        if self.accepted is not None or self.paper is None:
            return self.accepted
        return self.paper / 2, self.paper * 2

    @property
    def statements(self) -> int:
        """Number of intervals that may refute it: one of the effect, and of a course one of each step."""
        return len(self.rows) if self.rule == "monotone" else 1

    @property
    def places(self) -> tuple[float, ...]:
        """The levels of the rows."""
        return self.levels or tuple(map(float, range(len(self.rows))))


@dataclass(frozen=True, slots=True)
class Nested:
    """Two rows of which one model contains the other: fitted to the end, it explains photographs no worse."""

    inner: str
    outer: str
    """The row with more freedom. Worse on its own training views, it has not converged."""

    def __post_init__(self) -> None:
        if self.inner == self.outer:
            raise ValueError(f"expected two rows in nested, got {self.inner!r} twice")


@dataclass(frozen=True, slots=True)
class Claim:
    """Statements of a paper, and the comparisons that it comes down to."""

    id: Label
    sentence: str
    source: str
    """Table or section."""
    checks: tuple[Check, ...] = ()
    verdict_by: Literal["all", "any"] = "all"
    """``all``: the claim is as good as its worst deciding check; ``any``: as its best."""
    asked_by: Asker = "paper"
    """``graycard``: a question that no paper answers. It has words of its own and contradicts nobody."""
    unavailable: str = ""
    """Reason that it cannot be tested here at all; empty if it can."""
    bound: str = ""
    """The row that shows what is possible; that of the paper's file if empty."""
    trivial: str = ""
    """The row that costs nothing; that of the paper's file if empty."""
    figures: Mapping[str, str] = field(default_factory=dict)
    """Figures of the paper, by name."""
    notes: tuple[str, ...] = ()
    """Differences from the paper."""

    def __post_init__(self) -> None:
        check_unique("checks", (check.id for check in self.checks), self.id)
        if not self.unavailable and not any(check.decides for check in self.checks):
            raise ValueError(f"expected a check that decides, or unavailable, in claim {self.id!r}, got none")

    @property
    def statements(self) -> int:
        """Number of intervals of its deciding checks that may refute it."""
        return sum(check.statements for check in self.checks if check.decides)


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """Entries of a paper's own table that have to fit each other."""

    id: str
    sentence: str
    source: str
    entries: Mapping[str, tuple[float, ...]]
    """By the name of a row: what its mean is said to be of; or rows that should not be the same."""
    stated: Mapping[str, float] = field(default_factory=dict)
    """By row: the mean as the paper prints it. Empty: all rows should differ from each other."""
    decimals: int = 2
    """Unit of the printed figures."""
    unit: str = "1"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.stated and self.stated.keys() != self.entries.keys():
            raise ValueError(f"expected a stated mean for each row of {self.id!r}, got {sorted(self.stated)}")
        if not all(self.entries.values()) or len(self.entries) < (1 if self.stated else 2):
            raise ValueError(f"expected rows with entries in {self.id!r}, got {dict(self.entries)}")


@dataclass(frozen=True, slots=True)
class Paper:
    """All claims of one paper."""

    name: Name
    version: int
    title: str
    track: Name = ""
    suite: Name = ""
    """Whose runs have the rows that are compared."""
    bound: str = ""
    trivial: str = ""
    budget: Mapping[str, str] = field(default_factory=dict)
    """Means of the paper by what is counted: ``steps``, ``pixels``, ``views``, ``primitives``, ``priors``."""
    nested: tuple[Nested, ...] = ()
    claims: tuple[Claim, ...] = ()
    arithmetic: tuple[Arithmetic, ...] = ()

    def __post_init__(self) -> None:
        check_unique("claims", (c.id for c in (*self.claims, *self.arithmetic)), self.name)
        if self.claims and self.track not in TRACKS:
            raise UnknownNameError("track", self.track, TRACKS)
        for claim in self.claims:
            if not (claim.bound or self.bound) or not (claim.trivial or self.trivial):
                raise ValueError(
                    f"expected the rows of the upper bound and of what is trivial for {claim.id!r}, got none"
                )


def claims_names() -> list[str]:
    """Names of the files of claims that come with graycard."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def claims_path(name: str) -> Path:
    """Return the file of a name, or the path itself if it ends in ``.toml``.

    Raises:
        UnknownNameError: There is no such file.
    """
    path = Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    if len(path.name) > 200 or not path.is_file():
        own = "Claims of your own: a path that ends in .toml"
        raise UnknownNameError("file of claims", name, claims_names(), own)
    return path


def load_claims(name: str) -> Paper:
    """Return the claims of a name, or of a path that ends in ``.toml``.

    Raises:
        UnknownNameError: There are none of this name, or they name a track that does not exist.
        RecordError: The file is no TOML, has an unknown or missing key, or a check that cannot be made.
    """
    path = claims_path(name)
    data = read_toml(path)
    return from_builtins(Paper, data, RecordError, str(path))


def claims_of_suite(suite: str) -> list[str]:
    """Names of the files of claims that the runs of a suite are made for."""
    return [name for name in claims_names() if load_claims(name).suite == suite]


def claims_of_tracks(tracks: Iterable[str]) -> list[str]:
    """Names of the files of claims about scenes of some tracks; all where there are none."""
    wanted = set(tracks)
    return [name for name in claims_names() if load_claims(name).track in wanted] or claims_names()


def check_unique(what: str, names: Iterable[str], where: str) -> None:
    """Refuse names that stand twice.

    Raises:
        ValueError: One does.
    """
    twice = sorted(name for name, times in Counter(names).items() if times > 1)
    if twice:
        raise ValueError(f"expected {what} of {where!r} with ids of their own, got {twice} more than once")


def _rows_fault(check: Check) -> str:
    """Return what is wrong with the rows, as the end of ``expected ...``; empty if nothing."""
    count = len(check.rows)
    if len(set(check.rows)) < count:
        return f"rows that differ, got {list(check.rows)}"
    if check.rule != "monotone":
        stray = check.minus or check.levels
        return "one or two rows, without levels" if stray or count not in (1, 2) else ""
    if count < 3 or check.along is not None:
        return f"three or more rows and no knob for a monotone course, got {count}"
    if check.minus and len(check.minus) != count:
        return f"as many rows in minus as in rows, got {len(check.minus)} for {count}"
    if len(check.places) != count or sorted(set(check.places)) != list(check.places):
        return f"a level for each row, rising, got {list(check.places)}"
    return ""


def _size_fault(check: Check) -> str:
    """Return what is wrong with the sizes, as the end of ``expected ...``; empty if nothing."""
    neutral = check.neutral
    if not 0 <= check.negligible < math.inf or (check.negligible and check.rule == "within"):
        return f"negligible of 0 or more, and none for within, got {check.negligible}"
    if check.negligible and check.range and check.range[1] <= neutral + check.negligible:
        return f"negligible below the claimed size {list(check.range)}, got {check.negligible}"
    if check.accepted is not None and not check.accepted[0] < check.accepted[1]:
        return f"accepted from low to high, got {list(check.accepted)}"
    if check.scale == "ratio" and len(check.rows) == 1 and check.against <= 0:
        return f"a number above 0 that the row is a multiple of (against), got {check.against}"
    if check.rule == "within" and check.accepted is None:
        return "what the interval has to lie in (accepted)"
    if check.paper is None or check.rule == "within":
        return ""
    if not neutral < check.paper < math.inf:
        return f"the paper's effect above {neutral:g}, as it is in the claimed sense, got {check.paper}"
    return ""
