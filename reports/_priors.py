# SPDX-License-Identifier: Apache-2.0
"""Badges beside the names of rows that priors told more than the photographs."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from graycard.records import RunRecord

_SHOWN = 2
"""So many kinds that differ are named in a badge; its help names all."""
_ANSWERS = {
    "classical": "from algorithms that need no weights",
    "pretrained": "from pretrained networks",
    "none": "not given",
}


@dataclass(frozen=True, slots=True)
class PriorBadge:
    """The priors of a row in a few words, and in a sentence."""

    text: str
    """Text as in ``oracle 2``."""
    answers: str
    """Text as in ``answers are the truth made wrong by severity 2 of 1 to 5``."""

    @property
    def help(self) -> str:
        """Return the sentence that explains the text."""
        return f"Told more than the photographs by priors: {self.answers}"


def prior_badges(record: RunRecord) -> dict[str, PriorBadge]:
    """Return the badge of each row that priors have told something; rows without priors have none."""
    found: dict[str, PriorBadge] = {}
    for result in record.results:
        badge = prior_badge(result.job.priors)
        if badge is not None:
            found.setdefault(result.job.method, badge)
    return found


def prior_badge(priors: Mapping[str, Any]) -> PriorBadge | None:
    """Return the badge of priors as a job records them; None where no kind has a source.

    Args:
        priors: Source, severity, path and ``overrides`` by kind; an override has None for what is as in all
            other kinds.
    """
    own = {kind: _merged(priors, override) for kind, override in (priors.get("overrides") or {}).items()}
    sources = [priors.get("source", "none"), *(spec.get("source", "none") for spec in own.values())]
    if set(sources) == {"none"}:
        return None
    short = [f"{kind.replace('_', ' ')} {_short(spec, priors)}" for kind, spec in own.items()]
    main = [] if sources[0] == "none" else [_short(priors, {})]
    more = ["…"] if len(short) > _SHOWN else []
    answers = [f"answers are {_answers(priors)}"]
    answers += [f"those about {kind.replace('_', ' ')} are {_answers(spec)}" for kind, spec in own.items()]
    return PriorBadge(
        ", ".join([*main, *short[:_SHOWN], *more]),
        "; ".join(answers),
    )


def _merged(priors: Mapping[str, Any], override: Mapping[str, Any]) -> dict[str, Any]:
    return {**priors, "overrides": {}, **{k: v for k, v in override.items() if v is not None}}


def _short(spec: Mapping[str, Any], usual: Mapping[str, Any]) -> str:
    """Return a source with what it depends on; of an override what differs, as in ``5`` or ``kappa 0.3``."""
    source, parts = spec.get("source", "none"), []
    if source != usual.get("source"):
        parts.append(source)
    if source == "oracle" and (parts or spec.get("severity") != usual.get("severity")):
        parts.append(str(spec.get("severity", 0)))
    if source == "pretrained" and spec.get("path") and spec.get("path") != usual.get("path"):
        parts.append(_name(spec))
    return " ".join([*parts, *_details(spec)])


def _answers(spec: Mapping[str, Any]) -> str:
    source, severity = spec.get("source", "none"), spec.get("severity", 0)
    if source == "oracle":
        wrong = f"made wrong by severity {severity} of 1 to 5" if severity else "itself (severity 0)"
        found = f"the truth {wrong}"
    else:
        found = _ANSWERS.get(source, f"from {source}")
    details = _details(spec) + ([_name(spec)] if source == "pretrained" and spec.get("path") else [])
    return f"{found} ({', '.join(details)})" if details else found


def _details(spec: Mapping[str, Any]) -> list[str]:
    """Single parameters of an override, and its algorithm."""
    found = [spec["algorithm"]] if spec.get("algorithm") else []
    return found + [
        f"{name.replace('_', ' ')} {value:g}" for name, value in (spec.get("errors") or {}).items()
    ]


def _name(spec: Mapping[str, Any]) -> str:
    """Return the name of the weights, without the folders of somebody's machine."""
    return PurePath(spec["path"]).name
