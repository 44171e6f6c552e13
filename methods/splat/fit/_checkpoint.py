# SPDX-License-Identifier: Apache-2.0
"""A fit that was cut off goes on where it stopped, and ends with the same bits."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from graycard import MethodError
from graycard.io import parse_json, write_bytes
from graycard.methods.splat.fit._optimise import AdamMoments, FitState, ScreenStatistics
from graycard.methods.splat.fit._parameters import Parameters

FORMAT = {"format": "graycard-fit", "version": "1"}


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """Checkpoints: where a fit is saved, and how often.

    Raises:
        ValueError: The interval is not positive.
    """

    path: Path
    every: int
    """Steps."""
    identity: str
    """Says what the fit depends on: method, settings, seed, photographs. A state of another is refused."""
    shared: bool = False
    """True if the path is a folder of fits, each in a file that its identity names: whoever has the same
    goes on from it."""
    anew: bool = False
    """True if a file that is damaged or of another fit is written anew instead of refused; so is one that
    is ``shared``."""

    def __post_init__(self) -> None:
        if self.every < 1:
            raise ValueError(f"expected a checkpoint every 1 or more steps, got {self.every}")

    @property
    def file(self) -> Path:
        """File of the state."""
        if not self.shared:
            return self.path
        return self.path / f"{hashlib.sha256(self.identity.encode()).hexdigest()[:20]}.safetensors"

    def beside(self, stage: str, looked_at: Iterable[torch.Tensor] = (), chosen: str = "") -> "Checkpoint":
        """File where another stage of the same fit is saved: a file of its own, next to this one.

        The stage is begun anew where the file is of another one: the first file has shown whose it is.

        Args:
            stage: Its name, which ends that of the file.
            looked_at: What it depends on besides.
            chosen: The same of settings, in words.
        """
        digest = hashlib.sha256()
        for values in looked_at:
            digest.update(values.contiguous().numpy().tobytes())
        digest.update(chosen.encode())
        path = self.path if self.shared else self.path.with_name(f"{self.path.name}.{stage}")
        return replace(self, path=path, identity=f"{self.identity} {stage} {digest.hexdigest()}", anew=True)


class Spent(NamedTuple):
    """Cost of a fit up to some step."""

    seconds: float = 0.0
    peak_mib: float = 0.0
    """The most memory that its process held."""


NOTHING_SPENT = Spent()


def save_state(checkpoint: Checkpoint, state: FitState, spent: Spent = NOTHING_SPENT) -> None:
    """Write the whole state as one safetensors file with JSON in its header, whole or not at all.

    Args:
        checkpoint: Where to.
        state: After some step.
        spent: What the fit took up to there.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    facts = json.dumps({"step": state.step, "identity": checkpoint.identity, "spent": spent})
    tensors = {name: values.contiguous() for name, values in _flat(state).items()}
    write_bytes(checkpoint.file, save(tensors, metadata={**FORMAT, "fit": facts}))


def load_state(checkpoint: Checkpoint) -> FitState | None:
    """Return the state that was saved last; None if there is no file.

    Raises:
        MethodError: The file is damaged, or is of another fit.
    """
    saved = load_saved(checkpoint)
    return None if saved is None else saved.state


class Saved(NamedTuple):
    """Contents of a checkpoint."""

    state: FitState
    spent: Spent


def load_saved(checkpoint: Checkpoint) -> Saved | None:
    """Return the same as :func:`load_state`, with what it took."""
    path = checkpoint.file
    if not path.exists():
        return None
    try:
        return _read(path, checkpoint.identity)
    except MethodError:
        if checkpoint.shared or checkpoint.anew:
            return None
        raise


def _read(path: Path, identity: str) -> Saved:
    try:
        with safe_open(path, framework="pt") as file:
            facts = _facts(file.metadata())
            # Copies: kernels may round differently on memory that is aligned differently.
            tensors = {name: file.get_tensor(name).clone() for name in file.keys()}  # noqa: SIM118
        saved = Saved(_unflat(facts["step"], tensors), Spent(*facts["spent"]))
        mine = facts["identity"] == identity
    except _BROKEN as cause:
        raise _broken(path, cause) from cause
    if not mine:
        raise _of_another(path)
    return saved


def check_saved(path: Path, begins: str) -> None:
    """Refuse a file that no fit could go on from, without reading what it holds.

    Args:
        path: Of a checkpoint; there need not be a file.
        begins: With what identities of such fits begin.

    Raises:
        MethodError: The file is damaged, or is of another fit.
    """
    if not path.exists():
        return
    try:
        with safe_open(path, framework="pt") as file:
            identity = str(_facts(file.metadata())["identity"])
    except _BROKEN as cause:
        raise _broken(path, cause) from cause
    if not identity.startswith(begins):
        raise _of_another(path)


_BROKEN = (OSError, SafetensorError, KeyError, TypeError, ValueError)


def _facts(metadata: Mapping[str, str] | None) -> dict[str, Any]:
    """Facts about the fit in the header.

    Raises:
        ValueError: It is no header of a saved fit.
    """
    rest = dict(metadata or {})
    facts = parse_json(rest.pop("fit", "{}"))
    if rest != FORMAT:
        raise ValueError(f"metadata {json.dumps(rest)}")
    return facts


def _broken(path: Path, cause: Exception) -> MethodError:
    return MethodError(f"the saved fit in {path} cannot be read: {cause}. Delete it to begin anew")


def _of_another(path: Path) -> MethodError:
    return MethodError(
        f"expected {path} to hold a fit of these photographs with these settings and seed, "
        "got one of others. Delete it to begin anew, or name another file"
    )


def _flat(state: FitState) -> dict[str, torch.Tensor]:
    parameters = state.parameters
    found = {f"surfels/{name}": values for name, values in parameters.surfels.items()}
    found |= {f"shared/{name}": values for name, values in parameters.shared.items()}
    for name, moments in state.moments.items():
        found |= {f"{part.name}/{name}": getattr(moments, part.name) for part in fields(AdamMoments)}
    found |= {f"screen/{part.name}": getattr(state.screen, part.name) for part in fields(ScreenStatistics)}
    return found | {"random/state": state.random}


def _unflat(step: int, tensors: Mapping[str, torch.Tensor]) -> FitState:
    parts: dict[str, dict[str, Any]] = {}
    for key, values in tensors.items():
        part, _, name = key.partition("/")
        parts.setdefault(part, {})[name] = values
    moments = {
        name: AdamMoments(first, parts["second"][name], parts["steps"][name])
        for name, first in parts["first"].items()
    }
    parameters = Parameters(parts["surfels"], parts.get("shared", {}))
    return FitState(step, parameters, moments, ScreenStatistics(**parts["screen"]), parts["random"]["state"])
