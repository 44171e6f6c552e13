# SPDX-License-Identifier: Apache-2.0
"""Plan an import before anything is written: read cameras, check files, and say so in rows."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from graycard._errors import DatasetError, UnknownNameError
from graycard._point_colours import GREYED
from graycard.dataset import TRACKS
from graycard.exchange._blender import TRAIN, read_blender
from graycard.exchange._cameras import PosedPhotograph, check_names
from graycard.exchange._develop import undistorted, with_width
from graycard.exchange._develop_pictures import FoundPictures, PictureOptions, find_pictures
from graycard.exchange._doctor import ImportRow, merge_rows, some
from graycard.exchange._hold_out import check_hold_out, hold_out
from graycard.exchange._nerfstudio import INDEX, read_nerfstudio, read_nerfstudio_points
from graycard.exchange._odd_cameras import odd_cameras
from graycard.exchange._tensoir import has_true_layers, read_tensoir, view_folders
from graycard.exchange.colmap._folder import ColmapFolder, has_model, read_colmap
from graycard.exchange.colmap._model import points_of
from graycard.exchange.pictures import SUFFIXES, Files
from graycard.points import Points

FEW = 0.5
"""Share of the photographs in a folder below which their cameras look like a part of a split model."""


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """Choices of an import."""

    hold_out: str | None = None
    """A count N for indices 0, N, 2N, … (0 for none), a file of names, or names with commas."""
    width: int | None = None
    """Width of the pictures, pixels; None for that of the photographs."""
    model: str | None = None
    """Name of one of several models or lights; None for the largest, or the first."""
    pictures: PictureOptions = field(default_factory=PictureOptions)
    """Orientation, background, exposures and the sense of masks."""


@dataclass(frozen=True, slots=True)
class ImportPlan:
    """Photographs with the cameras that their pictures will have."""

    source: Path
    track: str
    settings: dict[str, Any]
    """Record of how it was imported, for the manifest."""
    shots: tuple[PosedPhotograph, ...]
    pictures: FoundPictures
    """Photographs that are there, and masks of training views."""
    points: Points | None
    rows: tuple[ImportRow, ...]

    @property
    def train(self) -> tuple[PosedPhotograph, ...]:
        """The shots whose photographs are imported."""
        return tuple(shot for shot in self.shots if not shot.held_out)

    @property
    def has_truth(self) -> bool:
        """Tell whether some held-out view has the true layers that scores need."""
        return any(shot.held_out and has_true_layers(shot) for shot in self.shots)


@dataclass(frozen=True, slots=True)
class _Source:
    """Contents of a folder, of whatever layout."""

    kind: str
    shots: Sequence[PosedPhotograph]
    rows: Sequence[ImportRow] = ()
    colmap: ColmapFolder | None = None


def plan_import(source: Path, track: str, options: ImportOptions | None = None) -> ImportPlan:
    """Read the cameras of a folder and prove that its photographs are there; nothing is written.

    Args:
        source: A folder of nerfstudio, NeRF-synthetic, TensoIR or COLMAP.
        track: What kind of scene it is. On ``tabletop`` masks are taken as the object to be removed,
            black where it is seen.
        options: Held-out views, width, and the model of several.

    Raises:
        UnknownNameError: There is no such track, model or photograph.
        DatasetError: The source is missing, malformed or incomplete.
        GraycardError: A lens needs pycolmap, which is not installed.
    """
    options = options or ImportOptions()
    check_options(track, options)
    found = _read(Path(source), options.model)
    check_names((shot.name for shot in found.shots), Path(source))
    named, renamed = _on_disk(sorted(found.shots, key=lambda s: s.name))
    shots, held, record = hold_out(named, options.hold_out)
    made = [
        with_width(shot if track == "tabletop" else replace(shot, mask=None), options.width) for shot in shots
    ]
    pictures = _pictures(made, options.pictures)
    points, said = _points(Path(source), found, made)
    rows = (
        ImportRow("cameras", len(shots), f"read as {found.kind}"),
        *found.rows,
        *renamed,
        *_of_cameras(shots, made),
        *_of_files(Path(source), found, shots),
        *_of_masks(shots, made),
        *_of_width(made, options.width),
        *odd_cameras(shots, points),
        held,
        *said,
    )
    chosen = {"width": options.width, "model": options.model}
    settings = {"format": found.kind, **record, **{k: v for k, v in chosen.items() if v is not None}}
    return ImportPlan(Path(source), track, settings, tuple(made), pictures, points, merge_rows(rows))


def check_options(track: str, options: ImportOptions) -> None:
    """Refuse a track or options that are none, before anything is read.

    Raises:
        UnknownNameError: There is no such track.
        DatasetError: The width or the choice of held-out views is none.
    """
    if track not in TRACKS:
        raise UnknownNameError("track", track, TRACKS)
    if options.width is not None and options.width < 1:
        raise DatasetError(f"expected a width of 1 or more pixels, got {options.width}. Mend --width")
    check_hold_out(options.hold_out)


def _read(source: Path, model: str | None) -> _Source:
    """Read the cameras of a folder, by the layout that it has."""
    if (source / INDEX).is_file():
        _refuse_model(model, "nerfstudio")
        shots, rows = read_nerfstudio(source)
        said = (
            f"read from {INDEX} alone: cameras of {TRAIN} are passed over. Move {INDEX} away to import them"
        )
        both = (source / TRAIN).is_file()
        if both and len(shots) < 2:
            raise DatasetError(
                f"expected two or more frames in {source / INDEX}, got {len(shots)}, and {TRAIN} beside it, "
                f"which is passed over. Move {INDEX} away to import that"
            )
        return _Source(
            "nerfstudio", shots, [*rows, ImportRow("cameras", len(shots), said, warns=True)] if both else rows
        )
    if view_folders(source):
        found = read_tensoir(source, model)
        return _Source("tensoir", found.shots, found.rows)
    if (source / TRAIN).is_file():
        _refuse_model(model, "NeRF-synthetic")
        return _Source("blender", *read_blender(source))
    if has_model(source):
        colmap = read_colmap(source, model)
        return _Source("colmap", colmap.shots, colmap.rows, colmap)
    raise DatasetError(
        f"expected a folder with {INDEX}, {TRAIN}, train_000/metadata.json or a COLMAP model in sparse/ at "
        f"{source}, got {'none of them' if source.is_dir() else 'nothing'}. See "
        "docs/reference/formats.md, or let --find-cameras find the cameras of bare photographs"
    )


def _refuse_model(model: str | None, layout: str) -> None:
    if model is not None:
        raise DatasetError(
            f"expected --model for a folder of COLMAP or TensoIR, which may have several models or lights, "
            f"got {model!r} for one of {layout}, which has one. Leave --model out"
        )


def _on_disk(shots: Sequence[PosedPhotograph]) -> tuple[list[PosedPhotograph], list[ImportRow]]:
    """Return shots with their files by the very names that they have on disk; others are as they were."""
    files, found = Files(), []
    for shot in shots:
        image = files.find(shot.image) or shot.image
        mask = shot.mask and (files.find(shot.mask) or shot.mask)
        found.append(replace(shot, image=image, mask=mask))
    count = sum((a.image, a.mask) != (b.image, b.mask) for a, b in zip(shots, found, strict=True))
    return found, [ImportRow("names", count, "found under a name in other case")] if count else []


def _pictures(shots: Sequence[PosedPhotograph], options: PictureOptions) -> FoundPictures:
    """Find photographs; behind transparency is black where the layout says that nothing is there."""
    train = [shot for shot in shots if not shot.held_out]
    if options.background == "none" and all(shot.cutout for shot in train):
        options = replace(options, background="black")
    return find_pictures(train, options, [shot for shot in shots if shot.held_out and shot.image.is_file()])


def _points(
    source: Path, found: _Source, shots: Sequence[PosedPhotograph]
) -> tuple[Points | None, list[ImportRow]]:
    if found.colmap is not None:
        points, rows = points_of(found.colmap.model, shots, found.colmap.names)
        rows.append(
            ImportRow("world", 1, "as the model has it: what is a metre, and what is up, is not known")
        )
    else:
        points = read_nerfstudio_points(source) if found.kind == "nerfstudio" else None
        said = f"kept, without tracks{points.said and '; '}{points.said}" if points is not None else ""
        grey = points is not None and points.said.startswith(f"{GREYED},")
        rows = [ImportRow("points", len(points), said, warns=grey)] if points is not None else []
    if points is None or not len(points):
        rows.append(ImportRow("points", 0, "none: methods begin with points of their own"))
    return points, rows


def _of_cameras(shots: Sequence[PosedPhotograph], made: Sequence[PosedPhotograph]) -> Iterator[ImportRow]:
    """Yield rows about lenses, then about sizes: what the files say, and what the capture will have."""
    whole = [undistorted(shot.lens, shot.camera) if shot.lens else shot.camera for shot in shots]
    for shot, camera in zip(shots, whole, strict=True):
        if shot.lens is None:
            yield ImportRow("distortion", 1, "none: a pinhole")
            continue
        (w, h), few = shot.size, camera.width * camera.height < FEW * shot.size[0] * shot.size[1]
        said = f"{shot.lens.model} lens undone: {w}x{h} becomes {camera.width}x{camera.height}"
        yield ImportRow("distortion", 1, said + (", and most of it is lost" if few else ""), warns=few)
    for camera, after in zip(whole, (shot.camera for shot in made), strict=True):
        if after.width != camera.width:
            said = f"{camera.width}x{camera.height} becomes {after.width}x{after.height}, averaged over areas"
            yield ImportRow("width", 1, said)


def _of_files(source: Path, found: _Source, shots: Sequence[PosedPhotograph]) -> Iterator[ImportRow]:
    """Yield rows about cameras without photographs and photographs without cameras."""
    missing = [shot.name for shot in shots if not shot.image.is_file()]
    if missing:
        yield ImportRow("cameras", len(missing), f"without a photograph, held out: {some(missing)}")
    if found.kind == "tensoir":
        return
    home = {found.colmap.photographs} if found.colmap else {shot.image.parent for shot in shots}
    known = {shot.image for shot in shots} | {shot.mask for shot in shots}
    bare = sorted({path for place in home for path in _files(place, source) if path not in known})
    if not bare:
        return
    there = len(shots) - len(missing)
    few = there < FEW * (there + len(bare))
    named = some(path.relative_to(source).as_posix() for path in bare)
    said = f"without a camera, left out: {named}"
    if few:
        said += f"; cameras hold {there} of {there + len(bare)}: is this a part of a split model?"
    yield ImportRow("photographs", len(bare), said, warns=few)


def _of_width(made: Sequence[PosedPhotograph], width: int | None) -> Iterator[ImportRow]:
    """Yield a row about pictures that are smaller than the width that was asked for."""
    if width is not None and (small := sum(shot.camera.width < width for shot in made)):
        yield ImportRow("width", small, f"less than {width} pixels: nothing is made larger")


def _of_masks(shots: Sequence[PosedPhotograph], made: Sequence[PosedPhotograph]) -> Iterator[ImportRow]:
    """Yield a row about masks that another track than tabletop does not take."""
    if lost := sum(
        shot.mask is not None and after.mask is None for shot, after in zip(shots, made, strict=True)
    ):
        yield ImportRow("masks", lost, "left out: tabletop alone has an object to be removed")


def _files(place: Path, source: Path) -> Iterator[Path]:
    """Yield the pictures below a folder of photographs; of the source itself, those beside each other."""
    for path in place.glob("*") if place == source else place.rglob("*"):
        if path.suffix.lower() in SUFFIXES and not path.name.startswith(".") and path.is_file():
            yield path
