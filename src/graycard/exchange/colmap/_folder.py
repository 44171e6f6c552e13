# SPDX-License-Identifier: Apache-2.0
"""COLMAP's folders: find models, choose one, find its photographs, and write a capture as one.

Held-out views are a model of their own in ``held_out/``: programs that read a model open each of its images.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from graycard._capture import Capture
from graycard._errors import DatasetError, UnknownNameError
from graycard.exchange._cameras import PosedPhotograph, make_shot, source_file, view_name, write_photographs
from graycard.exchange._doctor import ImportRow
from graycard.exchange.colmap import _binary, _text
from graycard.exchange.colmap._model import Model
from graycard.exchange.colmap._tracks import model_tables
from graycard.exchange.pictures import Files

MODEL_FOLDERS = ("sparse", "", "colmap/sparse", "dense/sparse")
"""Folders of models, or of folders of them with numbers for names."""
HELD_OUT = "held_out"
PHOTOGRAPHS = ("images", "photographs", "photos", "input", "image", "rgb")
"""Names of folders with photographs, in the order in which they are looked at."""
MASKS = "masks"


@dataclass(frozen=True, slots=True)
class ColmapFolder:
    """The shots of a folder, with the model that they come from."""

    shots: tuple[PosedPhotograph, ...]
    model: Model
    """Model of the training views."""
    names: dict[int, str]
    """Name of the view by id of its image in the model."""
    photographs: Path
    """Folder that names of images are relative to."""
    rows: tuple[ImportRow, ...]


def has_model(folder: Path) -> bool:
    """Tell whether a folder holds a model of COLMAP."""
    return bool(find_models(folder))


def find_models(folder: Path) -> list[Path]:
    """Return where models lie in a folder, of the first place that has any."""
    for place in MODEL_FOLDERS:
        parent = folder / place
        below = sorted(parent.iterdir()) if place and parent.is_dir() else []
        found = [path for path in (parent, *below) if path.is_dir() and _is_model(path)]
        if found:
            return found
    return []


def read_colmap(folder: Path, wanted: str | None) -> ColmapFolder:
    """Read a model and find its photographs, which are not yet looked at.

    Args:
        folder: It has a model.
        wanted: Name of the folder of one of several models; None for the one with the most images.

    Raises:
        UnknownNameError: There is no such model.
        DatasetError: A file is missing or malformed, or a name leads out of the folder.
    """
    place, rows = _choose(folder, wanted)
    model, own = _read(place), _place_of(folder, place)
    if _is_model(place) and not _is_text(place) and (place / _text.CAMERAS).is_file():
        told = "in both forms; binary files are read, as COLMAP does, and text files are passed over"
        rows = [*rows, ImportRow("models", 1, told, warns=True)]
    home, said = _photographs(folder, own, model)
    masks = (own if home.is_relative_to(own) else folder) / MASKS
    if own != folder and masks != folder / MASKS and (folder / MASKS).is_dir():
        told = f"of {MASKS}/ left out: they are of other photographs than those in {_shown(folder, home)}"
        said.append(
            ImportRow("masks", sum(1 for p in (folder / MASKS).rglob("*") if p.is_file()), told, True)
        )
    shots = _shots(masks, home, model, held_out=False)
    if _is_model(folder / HELD_OUT):
        shots += _shots(masks, home, _read(folder / HELD_OUT), held_out=True)
    names = {number: view_name(image.name) for number, image in model.images.items()}
    return ColmapFolder(tuple(shots), model, names, home, (*rows, *said))


def write_colmap(capture: Capture, folder: Path) -> None:
    """Write a capture as ``images/``, ``sparse/0/``, ``held_out/`` and, where granted, ``masks/``, in text.

    Raises:
        DatasetError: A photograph is missing or broken.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    _write(capture, folder, _text.write_text)


def write_colmap_binary(capture: Capture, folder: Path) -> None:
    """Write a capture as :func:`write_colmap` does, with binary models.

    Raises:
        DatasetError: A photograph is missing or broken.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    _write(capture, folder, _binary.write_binary)


def _write(capture: Capture, folder: Path, write_model: Callable[..., None]) -> None:
    write_photographs(capture, folder, ".png.png")
    write_model(folder / "sparse/0", *model_tables(capture, capture.train, with_points=True))
    if capture.test:
        write_model(folder / HELD_OUT, *model_tables(capture, capture.test, with_points=False))


def _is_model(folder: Path) -> bool:
    return (folder / _text.CAMERAS).is_file() or (folder / _binary.CAMERAS).is_file()


def _is_text(folder: Path) -> bool:
    return (folder / _text.CAMERAS).is_file() and not (folder / _binary.CAMERAS).is_file()


def _read(model: Path) -> Model:
    return _text.read_text(model) if _is_text(model) else _binary.read_binary(model)


def _choose(folder: Path, wanted: str | None) -> tuple[Path, list[ImportRow]]:
    """Return a model of a folder, and what there is to say of the others."""
    places = find_models(folder)
    names = {place.relative_to(folder).as_posix(): place for place in places}
    named = {place.name: place for place in places} | names
    if wanted is not None:
        if wanted not in named:
            raise UnknownNameError("model", wanted, names)
        return named[wanted], []
    if len(places) == 1:
        return places[0], []
    counts = {name: _count(place) for name, place in names.items()}
    largest = max(counts, key=lambda name: counts[name])
    others = ", ".join(f"{name} ({count})" for name, count in counts.items() if name != largest)
    said = (
        f"found; taken is {largest}, of most photographs ({counts[largest]}), left {others}: --model chooses"
    )
    return names[largest], [ImportRow("models", len(places), said, warns=True)]


def _count(model: Path) -> int:
    return _text.count_images(model) if _is_text(model) else _binary.count_images(model)


def _place_of(folder: Path, model: Path) -> Path:
    """Return the folder that a model is of: that which holds ``sparse``, as COLMAP's ``dense`` does."""
    parts = model.relative_to(folder).parts
    return folder.joinpath(*parts[: parts.index("sparse")]) if "sparse" in parts else folder


def _shown(folder: Path, place: Path) -> str:
    return f"{place.relative_to(folder).as_posix()}/"


def _photographs(folder: Path, own: Path, model: Model) -> tuple[Path, list[ImportRow]]:
    """Return the folder that names of images are relative to: the one in which the most of them lie.

    Those beside the model come first: COLMAP's undistorter gives its photographs the names of the originals.
    """
    names, files = [image.name for image in model.images.values()], Files()
    best, most = folder / PHOTOGRAPHS[0], 0
    for base in dict.fromkeys((own, folder)):
        known = [base / name for name in PHOTOGRAPHS]
        others = sorted(p for p in base.iterdir() if p.is_dir() and p not in known and p.name[0] != ".")
        for place in (*known, *others, base):
            there = sum(files.find(source_file(place, name, str(place))) is not None for name in names)
            if there > most:
                best, most = place, there
            if most == len(names):
                break
        if most:
            break
    if best == folder / PHOTOGRAPHS[0]:
        return best, []
    said = f"found in {_shown(folder, best)}, by the names of the model's images"
    return best, [ImportRow("photographs", most, said)]


def _shots(masks: Path, home: Path, model: Model, held_out: bool) -> list[PosedPhotograph]:
    shots, files = [], Files()
    for image in model.images.values():
        if image.camera not in model.cameras:
            known = ", ".join(map(str, model.cameras)) or "none"
            raise DatasetError(
                f"expected a camera of {_text.CAMERAS} in {image.where}, got {image.camera}. Known: {known}"
            )
        file = source_file(home, image.name, image.where)
        mask = files.find(source_file(masks, f"{image.name}.png", image.where))
        name = view_name(image.name)
        shot = make_shot(file, name, model.cameras[image.camera], image.pose, image.where)
        shots.append(replace(shot, mask=mask, held_out=held_out))
    return shots
