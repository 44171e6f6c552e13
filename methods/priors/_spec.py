# SPDX-License-Identifier: Apache-2.0
"""Specification of priors: part of what addresses a job, of a suite, of a run record."""

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from graycard import RecordError, UnknownNameError
from graycard.io import dumps, from_builtins, read_toml
from graycard.methods._priors import KINDS, SOURCES, PriorKind, PriorSource
from graycard.methods.priors import _colour, _depth, _filling, _inpainting, _light, _mask, _material, _normal

WORST = 5
OWN = "own"
"""Path that stands for graycard's own weights; a folder of that name is ``./own``."""
OWN_WEIGHTS = Path(__file__).with_name("own.safetensors")
"""File of graycard's own weights, which comes with the package."""
OWN_KINDS: frozenset[PriorKind] = frozenset({"depth", "normal", "base_color", "roughness", "metallic"})
"""Kinds that graycard's own network tells of."""
LEVELS: Mapping[PriorKind, tuple[Any, ...]] = {
    "depth": _depth.LEVELS,
    "normal": _normal.LEVELS,
    "base_color": _colour.LEVELS,
    "roughness": _material.ROUGHNESS_LEVELS,
    "metallic": _material.METALLIC_LEVELS,
    "mask": _mask.LEVELS,
    "inpainting": _inpainting.LEVELS,
    "light": _light.LEVELS,
}
"""Errors of the oracle, by kind and severity."""
ALGORITHMS: Mapping[tuple[PriorSource, PriorKind], tuple[str, ...]] = {
    ("oracle", "normal"): _normal.ALGORITHMS,
    ("classical", "inpainting"): _filling.ALGORITHMS,
}
"""Algorithms between which a source has a choice for a kind; the first is the default."""


@dataclass(frozen=True, slots=True)
class Override:
    """Overrides of one kind; what is None is as in the spec."""

    source: PriorSource | None = None
    severity: int | None = None
    path: str | None = None
    """Place of the weights; ``own`` for graycard's own."""
    errors: Mapping[str, float] = field(default_factory=dict)
    """Single parameters of the oracle's errors, in place of those of the severity."""
    algorithm: str | None = None
    """Name in :data:`ALGORITHMS`, where a source has a choice for this kind."""


@dataclass(frozen=True, slots=True)
class PriorSpec:
    """Priors that a method is given.

    ``oracle`` answers with the truth, made wrong as networks are wrong; ``classical`` with algorithms that
    need no weights; ``pretrained`` with networks on disk.

    Raises:
        ValueError: A severity, a seed, a parameter, a path or an algorithm that cannot be.
        UnknownNameError: A source, a kind, a parameter or an algorithm that does not exist.
    """

    source: PriorSource = "none"
    severity: int = 0
    """Severity of the oracle's errors: 0 is the truth itself, 5 the worst."""
    seed: int = 0
    """Seed of the oracle's errors."""
    path: str = ""
    """Folder of weights: ``<path>/<kind>`` (transformers) or ``<path>/<kind>.pt`` (TorchScript); ``own`` for
    graycard's own weights; or a file of such weights that ends in ``.safetensors``."""
    overrides: Mapping[str, Override] = field(default_factory=dict)
    """By kind."""

    def __post_init__(self) -> None:
        _check(self.source, self.severity)
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or self.seed < 0:
            raise ValueError(f"expected a seed >= 0 of the priors, got {self.seed!r}")
        for kind in self.overrides:
            if kind not in KINDS:
                raise UnknownNameError("kind of prior", kind, KINDS)
            of_kind(self, kind)

    def __hash__(self) -> int:
        return hash(dumps(self))

    def __str__(self) -> str:
        """For the summary of a row, as in ``oracle, severity 2; depth: severity 4, kappa 0.3``."""
        parts = [_words(self.source, self.severity)]
        for kind in sorted(self.overrides):
            found = of_kind(self, kind)
            override = self.overrides[kind]
            more = [] if override.algorithm is None else [override.algorithm]
            more += [f"{name} {value:g}" for name, value in override.errors.items()]
            parts.append(f"{kind}: {', '.join([_words(found.source, found.severity), *more])}")
        return "; ".join(parts)


@dataclass(frozen=True, slots=True)
class KindSpec:
    """Source of answers about one kind."""

    kind: PriorKind
    source: PriorSource
    severity: int
    seed: int
    weights: Path | None
    """Weights of a pretrained source: the folder or file; None for others, and where no path is given."""
    errors: Any
    """Errors of the oracle: the dataclass of its kind; that of depth for normals that are its slopes."""
    algorithm: str
    """Name in :data:`ALGORITHMS`; empty where a source has no choice for the kind."""


_LONGEST = 4096
"""Characters of a word or path, the longest that a path has on Linux."""


def parse_priors(text: str) -> PriorSpec:
    """Return a spec in a word, as on a command line.

    Args:
        text: ``none``, ``classical``, ``oracle`` or ``oracle:3`` (severity), ``pretrained:own`` (graycard's
            own weights), ``pretrained:FOLDER``, or a path to a TOML file with the fields of a spec.

    Raises:
        RecordError: It is none of these, or the file is broken.
        UnknownNameError: A source, a kind or a parameter that does not exist.
    """
    if len(text) > _LONGEST:
        raise RecordError(f"expected priors in a word or a path to a TOML file, got {len(text)} characters")
    if text.endswith(".toml"):
        return from_builtins(PriorSpec, read_toml(Path(text)), RecordError, text)
    source, _, more = text.partition(":")
    if source not in SOURCES:
        raise UnknownNameError("source of priors", source, SOURCES)
    data: dict[str, Any] = {"source": source}
    if more and source == "oracle" and more.isdecimal():
        data["severity"] = int(more)
    elif more and source == "pretrained":
        data["path"] = more
    elif more:
        raise RecordError(
            f"expected priors as in oracle:3, pretrained:own or pretrained:FOLDER, got {text!r}"
        )
    return from_builtins(PriorSpec, data, RecordError, text)


def of_kind(spec: PriorSpec, kind: PriorKind | str) -> KindSpec:
    """Return where the answers about one kind come from.

    Raises:
        ValueError: A severity, a parameter or an algorithm that cannot be; or normals that are the slopes of
            a depth of another source, or with errors of their own.
        UnknownNameError: A source, a parameter or an algorithm that does not exist.
    """
    override = spec.overrides.get(kind, Override())
    source = spec.source if override.source is None else override.source
    severity = spec.severity if override.severity is None else override.severity
    _check(source, severity)
    if override.errors and source != "oracle":
        raise ValueError(f"expected errors of {kind} with source oracle only, got them with {source}")
    name: PriorKind = KINDS[KINDS.index(kind)]  # pyright: ignore[reportArgumentType]
    weights = _weights(spec, override, name) if source == "pretrained" else None
    algorithm = _algorithm(name, source, override.algorithm)
    if algorithm == _normal.SLOPES_OF_DEPTH:
        return _sloped(spec, override)
    errors = _errors(name, severity, override.errors)
    return KindSpec(name, source, severity, spec.seed, weights, errors, algorithm)


def told_exactly(spec: PriorSpec, kinds: Iterable[PriorKind]) -> tuple[PriorKind, ...]:
    """Return the kinds of prior, of those asked, that a spec answers with the truth as it is.

    Raises:
        ValueError, UnknownNameError: As :func:`of_kind`.
    """
    exact = [levels[0] for levels in LEVELS.values()]
    answers = [of_kind(spec, kind) for kind in kinds]
    return tuple(found.kind for found in answers if found.source == "oracle" and found.errors in exact)


def _weights(spec: PriorSpec, override: Override, kind: PriorKind) -> Path | None:
    path = override.path or spec.path
    if path == OWN or path.endswith(".safetensors"):
        weights = OWN_WEIGHTS if path == OWN else Path(path)
        return weights if kind in OWN_KINDS else None
    if override.path:
        return Path(override.path)
    if not spec.path:
        return None
    folder = Path(spec.path) / kind
    return folder if os.path.isdir(folder) else folder.with_suffix(".pt")


def is_there(path: Path | None) -> bool:
    """Tell whether a file or folder is there; a name that no file can have is none."""
    return path is not None and os.path.exists(path)  # pathlib's raises for names that are too long


def _sloped(spec: PriorSpec, override: Override) -> KindSpec:
    """Return normals that are the slopes of the depth that the same spec tells."""
    depth = of_kind(spec, "depth")
    if depth.source != "oracle":
        raise ValueError(
            f"expected depth of source oracle for normals that are its slopes, got {depth.source}. Leave out "
            "the algorithm of normal, or the source of depth"
        )
    if override.severity is not None or override.errors:
        raise ValueError(
            "expected normals that are slopes of depth to have the errors of depth, got a severity or errors "
            "of normal. Give them to depth"
        )
    return replace(depth, kind="normal", algorithm=_normal.SLOPES_OF_DEPTH)


def _algorithm(kind: PriorKind, source: PriorSource, wanted: str | None) -> str:
    known = ALGORITHMS.get((source, kind), ())
    if wanted is None:
        return next(iter(known), "")
    if not known:
        choices = " or ".join(f"an algorithm of {of} with source {by} only" for by, of in ALGORITHMS)
        raise ValueError(f"expected {choices}, got {wanted!r} of {kind} with {source}")
    if wanted not in known:
        raise UnknownNameError(f"algorithm of {kind}", wanted, known)
    return wanted


def _errors(kind: PriorKind, severity: int, changes: Mapping[str, float]) -> Any:
    errors = LEVELS[kind][severity]
    known = [f.name for f in fields(errors)]
    for name, value in changes.items():
        if name not in known:
            raise UnknownNameError(f"error of {kind}", name, known)
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"expected {name} of {kind} to be finite and >= 0, got {value}")
    return replace(errors, **changes)


def _check(source: str, severity: int) -> None:
    if source not in SOURCES:
        raise UnknownNameError("source of priors", source, SOURCES)
    if isinstance(severity, bool) or not isinstance(severity, int) or not 0 <= severity <= WORST:
        raise ValueError(f"expected a severity of 0 to {WORST}, got {severity!r}")


def _words(source: str, severity: int) -> str:
    return f"{source}, severity {severity}" if source == "oracle" else source
