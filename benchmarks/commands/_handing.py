# SPDX-License-Identifier: Apache-2.0
"""Inputs of a command, and its outputs as predictions of the scene."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from graycard import Capture, MethodError, PredictionError, Predictions, find_layer, open_predictions
from graycard.adoption import adopt, find_layout, request_of
from graycard.benchmarks._handed import OPAQUE
from graycard.benchmarks.commands._command import Command
from graycard.dataset import write_index
from graycard.exchange import export_capture
from graycard.io import output_error, remove, write_json
from graycard.layers import shape_of
from graycard.predictions import (
    FOLDERS,
    INDEX,
    LIGHTS,
    check_room,
    clear_predictions,
    finish_predictions,
)


def hand_over(command: Command, capture: Capture, folder: Path) -> Path:
    """Write a capture as a command wants it.

    Args:
        command: Names the format.
        capture: A copy that does not tell its scene, in a folder ``capture``.
        folder: For what is written.

    Returns:
        The folder that stands for ``{capture}``.

    Raises:
        DatasetError: The format cannot say its cameras.
        OutputError: There is no room for it.
    """
    assert capture.root is not None, "it was copied"
    if command.input == "graycard":
        return capture.root
    out = folder / command.input
    if command.input == "arrays":
        _write_arrays(capture, out)
    else:
        export_capture(capture.root.parent, command.input, out)
    return out


def _write_arrays(capture: Capture, out: Path) -> None:
    """Write photographs, masks and points as NumPy's own files: ``photographs/<view>.npy`` and so on."""
    try:
        for folder in ("photographs", *(["masks"] if capture.target is not None else [])):
            (out / folder).mkdir(parents=True)
        for view in capture.train:
            np.save(out / "photographs" / f"{view.name}.npy", capture.photograph(view))
            if capture.target is not None:
                np.save(out / "masks" / f"{view.name}.npy", capture.target_mask(view))
        points = capture.points()
        np.savez(out / "points.npz", positions=points.positions, colors=points.colors)
    except OSError as cause:
        raise output_error(out, cause) from cause
    write_index(out, replace(capture, scene=OPAQUE))


def take_outputs(command: Command, made: Path, capture: Capture, method: str, predictions: Path) -> None:
    """Make predictions of what a command wrote.

    Args:
        command: Says how its outputs are read.
        made: A copy of its folder for outputs.
        capture: The copy that it was handed, which names the scene.
        method: Name of the row.
        predictions: The predictions folder; older predictions there are replaced.

    Raises:
        MethodError: There are none, or of other views or sizes.
        PredictionError: They cannot be read.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    assert capture.root is not None, "it was copied"
    if command.layout or command.maps:
        layout = find_layout(command.layout) if command.layout else None
        adopt(request_of(made, capture.root.parent, command.maps, layout, method=method), predictions)
        names: Sequence[str] = (LIGHTS, "environments")
    else:
        _check_views(made, capture)
        clear_predictions(predictions)
        names = (LIGHTS, *FOLDERS)
    for name in names:
        if (made / name).exists():
            _move(made / name, predictions / name)
    finish_predictions(predictions, Predictions(method, capture.track, capture.scene))
    open_predictions(predictions).lights()  # refused now, not when it is scored


def _move(source: Path, target: Path) -> None:
    """Move a file or folder, to another file system as well.

    Raises:
        OutputError: The disk is full, or cannot be written to.
    """
    remove(target)
    try:
        shutil.move(source, target)
    except OSError as cause:
        raise output_error(target, cause) from cause


def _check_views(made: Path, capture: Capture) -> None:
    """Refuse outputs that lack views, or have layers of other sizes.

    Raises:
        MethodError: They do.
        PredictionError: A file cannot be read, or a layer in it cannot be used.
    """
    try:
        check_room(made)
    except Exception as cause:
        raise MethodError(
            "expected predictions in {out}: views/, and lights.json or others of docs/reference/formats.md. "
            f"{cause}"
        ) from None
    write_json(made / INDEX, Predictions("command", capture.track, capture.scene))
    found = open_predictions(made)
    wanted, there = [view.name for view in capture.views], found.view_names()
    if missing := [name for name in wanted if name not in there]:
        got = ", ".join(there[:3]) or "none"
        raise MethodError(
            f"expected views/<view>.exr in {{out}} for each of the {len(wanted)} views of capture.json, got "
            f"{got}. {missing[0]} is missing. Write every view, or name what is there in `maps` or `layout`"
        )
    for view in capture.views:
        known = found.known_layers(view.name)
        if known.faults:
            raise PredictionError(f"view {view.name}: {next(iter(known.faults.values()))}")
        for name, values in known.layers.items():
            find_layer(name)
            if values.shape != (shape := shape_of(name, view.camera.height, view.camera.width)):
                raise MethodError(
                    f"expected {name} of view {view.name} of shape {shape}, got {values.shape}. Write each "
                    "view as large as its camera in capture.json"
                )
