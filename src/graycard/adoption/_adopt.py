# SPDX-License-Identifier: Apache-2.0
"""Turn a folder of other code's outputs into a predictions folder, with every convention declared."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from graycard._capture import Capture, View
from graycard._errors import DatasetError, PredictionError
from graycard.adoption._arrays import read_array
from graycard.adoption._declared import DEPTH, LayerMap, parse_map
from graycard.adoption._layouts import Layout, Views
from graycard.adoption._places import (
    Files,
    Place,
    check_pattern,
    filled,
    is_stack,
    number_in,
    one_beyond,
    places_of,
)
from graycard.adoption._values import to_layer
from graycard.dataset import is_in_display_white, open_capture
from graycard.io import Progress, atomic_folder, read_bytes, remove, silent
from graycard.predictions import (
    FOLDERS,
    INDEX,
    Predictions,
    check_room,
    clear_predictions,
    finish_predictions,
    write_view,
)


@dataclass(frozen=True, slots=True)
class AdoptedLayer:
    """One layer that was taken over."""

    layer: str
    declared: str
    """Declaration, as of ``--map``."""
    files: int
    lowest: float
    """Lowest of the finite values, in graycard's unit."""
    highest: float


@dataclass(frozen=True, slots=True)
class Adopted:
    """A predictions folder that was made of other code's outputs."""

    predictions: Path
    views: int
    layers: tuple[AdoptedLayer, ...]
    left_out: tuple[str, ...] = ()
    """Remarks that a reader needs: layers of a layout without files, views that have no prediction."""


@dataclass(frozen=True, slots=True)
class Request:
    """Outputs to adopt, and the way to find their files."""

    folder: Path
    scene: Path
    maps: tuple[LayerMap, ...]
    views: Views = "all"
    order: str = "capture"
    """``capture``, ``name``, or a text file with the name of a view on each line."""
    star: str = ""
    method: str = ""
    optional: frozenset[str] = frozenset()
    """Layers that may have no files at all: those of a layout."""
    notes: tuple[str, ...] = ()
    """Remarks on changes of a layout, for the reader."""


def request_of(
    folder: Path,
    scene: Path,
    maps: Sequence[str],
    layout: Layout | None = None,
    *,
    views: Views | Literal[""] = "",
    order: str = "capture",
    star: str = "",
    method: str = "",
) -> Request:
    """Return a request by texts of ``--map`` and a layout; a map goes before the layout's for its layer.

    Args:
        folder: Of the outputs.
        scene: ``DATASET/<track>/<scene>``.
        maps: As ``LAYER=PATTERN:WORD:…``; an empty pattern stands for that of the layout.
        layout: A known one, or None.
        views: Which were predicted; empty for those of the layout, or all.
        order: As of :class:`Request`.
        star: As of :class:`Request`.
        method: Name in scores; empty for that of the folder.

    Raises:
        PredictionError: There is nothing to adopt, or a map is malformed or double.
        UnknownNameError: There is no such layer or word.
    """
    known, notes = _of_layout(layout, Path(scene))
    notes = (*notes, *_of_program(layout, Path(scene)))
    given = [_completed(parse_map(text), known) for text in maps]
    layers = [declared.layer for declared in given]
    if double := [layer for layer in layers if layers.count(layer) > 1]:
        raise PredictionError(f"expected one --map for {double[0]}, got {layers.count(double[0])}")
    kept = [*given, *(declared for declared in known if declared.layer not in layers)]
    if not kept:
        raise PredictionError(
            "expected --layout or --map, got neither. `graycard adopt --layouts` lists both"
        )
    for declared in kept:
        check_pattern(declared.pattern, str(declared))
    of_layout = frozenset(declared.layer for declared in known) - {*layers}
    chosen = views or (layout.views if layout else "all")
    return Request(Path(folder), Path(scene), tuple(kept), chosen, order, star, method, of_layout, notes)


def adopt(request: Request, out: Path, progress: Progress = silent) -> Adopted:
    """Write a predictions folder from the outputs of other code; what it held before goes when all is read.

    Args:
        request: What, and how.
        out: The predictions folder: free, or with older predictions, which are replaced.
        progress: Called for each view.

    Raises:
        DatasetError: The capture is missing or broken.
        PredictionError: A file is missing, broken, of another size or of other channels, or no value of a
            layer is one.
        OutputError: The folder holds something else, or cannot be written to.
    """
    if not request.folder.is_dir():
        raise PredictionError(f"expected a folder of outputs at {request.folder}, got none. Mend its path")
    capture = open_capture(request.scene / "capture", check=False)
    places = places_of(_ordered(capture, request))
    check_room(out)
    files = Files(request.folder, request.star)
    taken, absent = _taken(request, files, places)
    staging = out.parent / f".{out.name}.adopted"
    remove(staging)
    with atomic_folder(staging) as folder:
        ranges = _write_views(folder, files, taken, places, capture.exposure, progress)
        for declared in taken:
            _check_range(declared, ranges[declared.layer], request.folder)
        method = request.method or request.folder.resolve().name or "adopted"
        finish_predictions(folder, Predictions(method, capture.track, capture.scene))
    _move(staging, out)
    return Adopted(
        out,
        len(places),
        tuple(_adopted(declared, ranges[declared.layer]) for declared in taken),
        (*request.notes, *absent, *_unpredicted(capture, places)),
    )


def _of_layout(layout: Layout | None, scene: Path) -> tuple[list[LayerMap], tuple[str, ...]]:
    """Return the maps of a layout, and what is to be said of them.

    A program that was trained on a user's own photographs knows nothing of the exposure of their capture.
    """
    known = [parse_map(text) for text in layout.maps] if layout else []
    if not any(declared.exposed for declared in known) or not is_in_display_white(scene):
        return known, ()
    plain = [
        replace(declared, exposed=False, words=tuple(word for word in declared.words if word != "exposed"))
        for declared in known
    ]
    return plain, (
        "exposed was left out of the layout, as for code that was trained on the photographs themselves. For "
        "photographs of `graycard export` declare it: --map radiance=:srgb:exposed",
    )


def _of_program(layout: Layout | None, scene: Path) -> tuple[str, ...]:
    """Say of which views a program renders pictures, where these are perhaps not those of the scene."""
    if layout is None or not layout.of_photographs or is_in_display_white(scene):
        return ()
    return (
        f"{layout.title.partition(':')[0]} opens a photograph for each view that it renders, and `graycard "
        "export` writes none of held-out views: make sure that each picture is of the view that its name or "
        "number means",
    )


def _completed(declared: LayerMap, known: Sequence[LayerMap]) -> LayerMap:
    """Return a map with the pattern of the layout where it has none of its own."""
    if declared.pattern:
        return declared
    found = next((other for other in known if other.layer == declared.layer), None)
    if found is None:
        raise PredictionError(f"expected a pattern in '{declared}', got none. Name the files of the layer")
    panel = declared.panel if declared.panel != (1, 1) else found.panel
    return replace(declared, pattern=found.pattern, panel=panel, key=declared.key or found.key)


def _ordered(capture: Capture, request: Request) -> list[View]:
    """Return the views that are adopted, in the order by which other code counts them."""
    chosen = {"all": capture.views, "train": capture.train, "test": capture.test}.get(request.views)
    if chosen is None:
        raise PredictionError(f"expected --views all, train or test, got {request.views}")
    if not chosen:
        raise PredictionError(f"expected {request.views} views in {request.scene}, got none. Mend --views")
    if request.order == "capture":
        return list(chosen)
    if request.order == "name":
        return sorted(chosen, key=lambda view: view.name)
    return _listed(Path(request.order), {view.name: view for view in chosen})


def _listed(path: Path, views: Mapping[str, View]) -> list[View]:
    """Return views in the order of a text file."""
    try:
        lines = read_bytes(path).decode().split("\n")
    except (OSError, UnicodeDecodeError) as cause:
        raise PredictionError(
            f"expected --order capture, name, or a text file with a view on each line, got {path}: {cause}"
        ) from cause
    names = [line.strip() for line in lines if line.strip()]
    if sorted(names) != sorted(views):
        odd = sorted({*names} ^ {*views}) or sorted(n for n in names if names.count(n) > 1)
        raise PredictionError(
            f"expected each of the {len(views)} views once in {path}, got {len(names)} lines. Look at "
            f"{', '.join(odd[:3])}"
        )
    return [views[name] for name in names]


def _taken(request: Request, files: Files, places: Sequence[Place]) -> tuple[list[LayerMap], list[str]]:
    """Return the maps that have files, and what is said of layers without.

    Raises:
        PredictionError: A layer has files for some views and not for others, or for more than there are, or
            none has any.
    """
    taken: dict[str, LayerMap] = {}
    for declared in request.maps:
        if declared.layer in taken:
            continue
        lacking = [p for p in places if files.find(declared.pattern, p) is None]
        if len(lacking) < len(places) or declared.layer not in request.optional:
            _check_none_lacks(request, declared, lacking, places)
            _check_none_is_left(request, files, declared, places)
            taken[declared.layer] = declared
    absent = {m.layer: m.pattern for m in request.maps if m.layer not in taken}
    if not taken:
        patterns = ", ".join(absent.values())
        raise PredictionError(f"expected files as {patterns} in {request.folder}, got none. Mend its path")
    return list(taken.values()), [
        f"{layer} was left out: no file as {pattern}" for layer, pattern in absent.items()
    ]


def _check_none_lacks(
    request: Request, declared: LayerMap, lacking: Sequence[Place], places: Sequence[Place]
) -> None:
    if not lacking:
        return
    first = lacking[0]
    name = filled(declared.pattern.replace("*", request.star or "*"), first)
    only = " and ".join(split for split in ("train", "test") if all(p.view.split != split for p in lacking))
    advice = (
        f"Render them, or adopt one split by --views {only}" if only in ("train", "test") else "Write them"
    )
    raise PredictionError(
        f"expected {declared.layer} of {len(places)} views in {request.folder}, got it of "
        f"{len(places) - len(lacking)}: {name} for view {first.view.name} is missing. {advice}"
    )


def _check_none_is_left(request: Request, files: Files, declared: LayerMap, places: Sequence[Place]) -> None:
    """Refuse numbered files of more views than are adopted: the numbers then mean other views.

    Raises:
        PredictionError: There is a file beyond the last view.
    """
    for place in one_beyond(declared.pattern, places):
        if found := files.find(declared.pattern, place):
            _, count = number_in(place, declared.pattern)
            of = f"{place.view.split} views" if "{split}" in declared.pattern else "views"
            raise PredictionError(
                f"expected {declared.layer} of {count} {of} in {request.folder}, got more: {found.name} is "
                "there, too. Number the views of the scene alone; --views and --order say which they are"
            )


def _write_views(
    folder: Path,
    files: Files,
    taken: Sequence[LayerMap],
    places: Sequence[Place],
    exposure: float,
    progress: Progress,
) -> dict[str, tuple[float, float, set[Path]]]:
    """Write all views; return the range and the files of each layer."""
    ranges: dict[str, tuple[float, float, set[Path]]] = {}
    stacks: dict[tuple[Path, str], np.ndarray] = {}
    for number, place in enumerate(places):
        progress(number / len(places), place.view.name)
        layers = {}
        for declared in taken:
            path = files.find(declared.pattern, place)
            if path is None:
                raise DatasetError(f"expected {declared.pattern} to stay where it was, got none. Try again")
            values = _read(path, declared, place, stacks)
            layers[declared.layer] = to_layer(values, declared, place.view.camera, exposure, str(path))
            ranges[declared.layer] = _range(ranges.get(declared.layer), layers[declared.layer], path)
        write_view(folder, place.view.name, layers)
    return ranges


def _read(
    path: Path, declared: LayerMap, place: Place, stacks: dict[tuple[Path, str], np.ndarray]
) -> np.ndarray:
    """Return the array of one view, from a file of its own or from one that holds several."""
    key = filled(declared.key, place)
    if not is_stack(declared.pattern) or key != declared.key:
        return read_array(path, key)
    if (path, key) not in stacks:
        stacks[path, key] = read_array(path, key)
    stack, (number, count) = stacks[path, key], number_in(place, declared.pattern)
    if stack.ndim < 3 or len(stack) != count:
        raise PredictionError(
            f"expected {count} views of {declared.layer} in {path}, got shape {stack.shape}. Name the views "
            "by {view} or {index}, or choose them by --views"
        )
    return stack[number]


def _range(
    known: tuple[float, float, set[Path]] | None, values: np.ndarray, path: Path
) -> tuple[float, float, set[Path]]:
    low, high, files = known or (np.inf, -np.inf, set())
    finite = values[np.isfinite(values)]
    if finite.size:
        low, high = min(low, float(finite.min())), max(high, float(finite.max()))
    return low, high, files | {path}


def _check_range(declared: LayerMap, found: tuple[float, float, set[Path]], folder: Path) -> None:
    """Refuse a layer that says nothing in any view.

    Raises:
        PredictionError: No value is finite, or no depth is above 0.
    """
    low, high, _ = found
    if low > high:
        raise PredictionError(
            f"expected values of {declared.layer} in {folder}, got none that is finite by '{declared}'. Mend "
            "the outputs, or the declaration"
        )
    if declared.layer == DEPTH and high <= 0:
        raise PredictionError(
            f"expected depths above 0 in {folder}, got {low:.4g} to {high:.4g} by '{declared}'. Where z "
            "points backward, add times=-1"
        )


def _adopted(declared: LayerMap, found: tuple[float, float, set[Path]]) -> AdoptedLayer:
    low, high, files = found
    return AdoptedLayer(declared.layer, str(declared), len(files), low, high)


def _unpredicted(capture: Capture, places: Sequence[Place]) -> list[str]:
    """Say which views have no prediction, and what follows."""
    named = {place.view.name for place in places}
    lacking = [view for view in capture.views if view.name not in named]
    if not lacking:
        return []
    if lacking[0].split == "test":
        return [f"{len(lacking)} held-out views have no prediction: their scores will fail"]
    return [
        f"{len(lacking)} training views have no prediction: scores with a gauge that is fitted on them will "
        "fail, as those of albedo. Render the training cameras, too"
    ]


def _move(staging: Path, out: Path) -> None:
    """Put finished predictions in the place of older ones; the index, which makes them whole, goes last."""
    clear_predictions(out)
    for name in (*FOLDERS, INDEX):
        if (staging / name).exists():
            (staging / name).replace(out / name)
    remove(staging)
