# SPDX-License-Identifier: Apache-2.0
"""From a spec to priors that a method can ask; what is missing is met before any time is spent."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from graycard import Capture, Light, MethodError
from graycard.io import sha256
from graycard.methods._priors import (
    KINDS,
    Ask,
    ImageKind,
    PriorKind,
    PriorModel,
    Priors,
    PriorSource,
    Question,
)
from graycard.methods.priors._draws import seed_in
from graycard.methods.priors._light import calibrated
from graycard.methods.priors._oracle import OraclePrior, truth_for
from graycard.methods.priors._spec import OWN_KINDS, KindSpec, PriorSpec, is_there, of_kind

GIVES: Mapping[PriorSource, frozenset[PriorKind]] = {
    "none": frozenset(),
    "oracle": frozenset(KINDS),
    "classical": frozenset(KINDS) - {"mask", "light"},
    "pretrained": frozenset(KINDS) - {"light"},
}
"""The kinds that each source knows of."""

Truth = Mapping[str, Mapping[str, np.ndarray]]
"""True arrays by view name and layer name."""


@dataclass(frozen=True, slots=True)
class UnloadedNetwork:
    """Weights on disk: a TorchScript file among them is a program."""

    kind: ImageKind
    weights: Path

    def load(self) -> PriorModel:
        """Return the network.

        Raises:
            MethodError: The weights are damaged, or those of no network for this kind.
        """
        from graycard.methods.priors._pretrained import load_pretrained  # PyTorch takes long to import

        return load_pretrained(self.kind, self.weights)

    def answer(self, question: Question) -> np.ndarray:
        """Return the answer, unchecked; the network is loaded for it."""
        return self.load().answer(question)


def check_priors(spec: PriorSpec, asks: Sequence[Ask]) -> None:
    """Refuse priors that a method has no use for, or that do not give what it must have.

    Raises:
        MethodError: They do not go together; weights are missing.
    """
    if spec != PriorSpec() and not asks:
        raise MethodError(f"expected no priors for a method that asks for none, got {spec}. Leave them out")
    asked = {ask.kind for ask in asks}
    for kind in spec.overrides:
        if kind not in asked:
            raise MethodError(
                f"expected overrides of what the method asks for ({', '.join(sorted(asked))}), got {kind}"
            )
    for ask in asks:
        found = of_kind(spec, ask.kind)
        named = ask.kind in spec.overrides and found.source != "none"
        if ask.kind not in GIVES[found.source] and (named or not ask.optional):
            raise MethodError(
                f"expected a source of priors that gives {ask.kind}, got {found.source!r}. One of "
                f"{', '.join(source for source, kinds in GIVES.items() if ask.kind in kinds)} does"
            )
        if _has_weights(found) and (_answers(spec, ask) or named or not ask.optional):
            _weights(found)
    networks = [ask for ask in asks if _has_weights(of_kind(spec, ask.kind))]
    if networks and not any(_answers(spec, ask) for ask in networks):
        kinds = " or ".join(f"{ask.kind}.pt" for ask in networks)
        raise MethodError(
            f"expected weights of what the method asks for ({kinds}) in {spec.path!r}, got none of them"
        )


def unanswered(spec: PriorSpec, asks: Sequence[Ask]) -> tuple[PriorKind, ...]:
    """Return the kinds that a method can ask for and nothing answers: it works without them."""
    return tuple(ask.kind for ask in asks if ask.optional and not _answers(spec, ask))


def truth_of(spec: PriorSpec, asks: Sequence[Ask]) -> frozenset[str]:
    """Names of the true layers that the oracle of a spec is handed, and ``lights`` for the true lights.

    Empty where none is asked.
    """
    found = [(ask, of_kind(spec, ask.kind)) for ask in asks]
    return frozenset().union(*(truth_for(ask, kind) for ask, kind in found if kind.source == "oracle"))


def weights_of(spec: PriorSpec, asks: Sequence[Ask]) -> list[str]:
    """Return a hash for each set of weights that is asked: answers depend on them.

    Raises:
        MethodError: Weights are missing.
    """
    check_priors(spec, asks)
    kinds = [of_kind(spec, ask.kind) for ask in asks if _answers(spec, ask)]
    paths = [_weights(found) for found in kinds if _has_weights(found)]
    return [_hash(path.resolve(), _stamp(path)) for path in paths]


def weights_in(spec: PriorSpec) -> tuple[Path, ...]:
    """Return the files and folders of weights that a spec names, links in them followed."""
    named = {of_kind(spec, kind).weights for kind in KINDS}
    places = [place for place in named if place is not None and is_there(place)]
    return tuple(sorted({real.resolve() for place in places for real in (place, *_files(place))}))


def make_priors(
    spec: PriorSpec,
    asks: Sequence[Ask],
    capture: Capture,
    truth: Truth,
    lights: tuple[Light, ...] = (),
    *,
    load: bool = True,
) -> Priors:
    """Kinds of questions.

    Args:
        spec: Where answers come from.
        asks: What the method will ask for.
        capture: What the method may see of the scene.
        truth: The layers of :func:`truth_of`, for every view.
        lights: The true lights, if :func:`truth_of` names them.
        load: Whether networks are loaded; if not, each is an :class:`UnloadedNetwork`.

    Raises:
        MethodError: Spec, method, scene or weights do not go together.
    """
    check_priors(spec, asks)
    models: dict[str, PriorModel] = {}
    calibration = None
    for ask in asks:
        if not _answers(spec, ask):
            continue
        found = of_kind(spec, ask.kind)
        found = replace(found, seed=seed_in(found.seed, capture.scene))
        if ask.kind == "light":
            calibration = calibrated(lights, found.errors, found.seed)
        else:
            models[ask.kind] = models.get(ask.kind) or _model(ask.kind, found, capture, truth)
    if load:
        models = {
            k: model.load() if isinstance(model, UnloadedNetwork) else model for k, model in models.items()
        }
    return Priors(spec.source, models=models, calibration=calibration)


def _model(kind: ImageKind, spec: KindSpec, capture: Capture, truth: Truth) -> PriorModel:
    """Return the model that answers about one kind; networks are not loaded yet."""
    if spec.source == "oracle":
        return OraclePrior(spec, truth, capture.exposure, capture.target)
    if spec.source == "classical":
        from graycard.methods.priors._classical import Classical

        return Classical(capture, spec.algorithm)
    return UnloadedNetwork(kind, _weights(spec))


def _answers(spec: PriorSpec, ask: Ask) -> bool:
    """Return whether there is an answer: a folder of weights need not hold those of kinds that are
    optional.
    """
    found = of_kind(spec, ask.kind)
    missing = _has_weights(found) and not is_there(found.weights)
    return ask.kind in GIVES[found.source] and not missing


def _has_weights(spec: KindSpec) -> bool:
    return spec.source == "pretrained" and spec.kind in GIVES["pretrained"]


def _weights(spec: KindSpec) -> Path:
    """Return where the weights of a kind are."""
    if spec.weights is None or not is_there(spec.weights):
        raise MethodError(
            f"expected weights for {spec.kind} priors at {spec.weights or 'a path'}, got none. Nothing is "
            f"downloaded: give priors a path to a folder that holds {spec.kind}/ (transformers) or "
            f"{spec.kind}.pt (TorchScript), or one in overrides.{spec.kind}.path; graycard's own network "
            f"tells of {', '.join(sorted(OWN_KINDS))}"
        )
    return spec.weights


def _stamp(path: Path) -> tuple[tuple[str, int, int], ...]:
    """Return the identity of a file; a checkpoint of gigabytes is not read for each job."""
    stats = [(p, p.stat()) for p in _files(path)]
    return tuple((p.relative_to(path).as_posix(), s.st_size, s.st_mtime_ns) for p, s in stats)


@cache
def _hash(path: Path, stamp: tuple[tuple[str, int, int], ...]) -> str:
    return " ".join(sha256(p) for p in _files(path))


def _files(path: Path) -> list[Path]:
    return sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
