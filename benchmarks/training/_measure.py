# SPDX-License-Identifier: Apache-2.0
"""True errors of priors on rendered scenes: any source beside the oracle's severities, by one code."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard import MethodError, View, open_capture, open_truth
from graycard.benchmarks.training._errors import UNITS, best_constant, errors_of
from graycard.io import Progress
from graycard.methods import Ask, PriorKind, Priors
from graycard.methods.priors import PriorSpec, make_priors, parse_priors

FLAT = "flat"
"""Stands for an answer that looks at nothing: normals that face the camera, one depth, one grey, roughness of
a half, no metal."""
CONSTANT = "constant"
"""Stands for the best answer that is one value all over a view: it knows the truth, but tells no shape."""
SOURCES = (FLAT, CONSTANT, "classical", "pretrained:own", *(f"oracle:{severity}" for severity in range(6)))
"""Sources that are measured unless others are named."""
PAINT = "base_color"
"""True layer that is shown in place of the photograph where a method asks anew."""
_MARKS = (FLAT, CONSTANT)
_TRUTH = (*UNITS, "object_id")


@dataclass(frozen=True, slots=True)
class PriorErrors:
    """Errors of one source on the views of one track."""

    track: str
    source: str
    """Source as on a command line, or :data:`FLAT` or :data:`CONSTANT`."""
    shown: str
    """``photograph``, or ``base_color``: the true paint in its place."""
    views: int
    errors: Mapping[str, tuple[float, ...]]
    """Errors by kind, in the units of :func:`errors_of`; means over views."""


def measure_priors(
    scenes: Sequence[Path], sources: Sequence[str], views: int, progress: Progress
) -> list[PriorErrors]:
    """Return the errors of sources of priors about the training views of scenes, by track.

    Args:
        scenes: Folders with ``capture`` and ``truth``.
        sources: Each as on a command line, or :data:`FLAT` or :data:`CONSTANT`; what a source does not
            answer is left out.
        views: How many of each scene, evenly along its walk.
        progress: Told about each scene.

    Raises:
        DatasetError: A folder holds no scene.
        RecordError: A source is none.
    """
    found: dict[tuple[str, str, str], list[Mapping[str, tuple[float, ...]]]] = {}
    for number, scene in enumerate(scenes):
        progress(number / len(scenes), scene.name)
        for source in sources:
            for track, shown, errors in _of_scene(scene, source, views):
                found.setdefault((track, source, shown), []).append(errors)
    return [
        PriorErrors(track, source, shown, len(rows), {kind: _mean(rows, kind) for kind in rows[0]})
        for (track, source, shown), rows in sorted(found.items(), key=lambda f: (f[0][0], f[0][2] == PAINT))
    ]


def _mean(rows: Sequence[Mapping[str, tuple[float, ...]]], kind: str) -> tuple[float, ...]:
    return tuple(float(x) for x in np.mean([row[kind] for row in rows], axis=0))


def _of_scene(
    scene: Path, source: str, views: int
) -> Iterable[tuple[str, str, Mapping[str, tuple[float, ...]]]]:
    """Track, what is shown and errors, for some views of a scene."""
    capture, truth = open_capture(scene / "capture"), open_truth(scene / "truth")
    steps = np.linspace(0, len(capture.train) - 1, min(views, len(capture.train))).round().astype(int)
    chosen = [capture.train[step] for step in steps]
    known = {view.name: {n: v for n, v in truth.layers(view).items() if n in _TRUTH} for view in chosen}
    kinds: list[PriorKind] = [kind for kind in UNITS if all(kind in true for true in known.values())]
    asks = [Ask(kind, ("photograph", PAINT), optional=True) for kind in kinds]
    told = source if source in _MARKS else make_priors(parse_priors(source), asks, capture, known)
    for view in chosen:
        true = known[view.name]
        photograph = np.asarray(capture.photograph(view), np.float64) * capture.exposure
        yield capture.track, "photograph", _of_view(told, photograph, view, true)
        if source != "classical":  # it looks at the photographs of other views
            yield capture.track, PAINT, _of_view(told, true[PAINT].astype(np.float64), view, true)


def _of_view(
    told: Priors | str, image: np.ndarray, view: View, true: Mapping[str, np.ndarray]
) -> Mapping[str, tuple[float, ...]]:
    """Errors of the answers about one image, by kind; ``told`` may be a word of :data:`_MARKS`."""
    seen = true["object_id"] > 0
    kinds = [kind for kind in UNITS if kind in true and (isinstance(told, str) or kind in told.kinds)]

    def answer(kind: str) -> np.ndarray:
        if isinstance(told, str):
            return _flat(kind, view) if told == FLAT else best_constant(kind, true[kind], seen)
        return getattr(told, kind)(image, view)

    return {kind: errors_of(kind, answer(kind), true[kind], seen) for kind in kinds}


def _flat(kind: str, view: View) -> np.ndarray:
    """Return an answer that looks at nothing."""
    toward = -view.camera.rays()
    values = {"normal": toward, "depth": np.ones(toward.shape[:2]), "base_color": np.full(toward.shape, 0.5)}
    return values.get(kind, np.full(toward.shape[:2], 0.0 if kind == "metallic" else 0.5))


def check_sources(sources: Sequence[str]) -> None:
    """Refuse what is no source of priors that answers about images.

    Raises:
        MethodError: It answers nothing.
        RecordError: It is none.
    """
    for source in sources:
        if source not in _MARKS and parse_priors(source) == PriorSpec():
            raise MethodError(f"expected sources of priors that answer something, got {source}")
