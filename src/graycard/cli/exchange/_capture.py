# SPDX-License-Identifier: Apache-2.0
"""The verbs that exchange captures with other programs."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from graycard._errors import GraycardError
from graycard.cli._options import Json, optional
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json
from graycard.exchange import (
    Background,
    ExchangeFormat,
    Exposures,
    ImportOptions,
    ImportPlan,
    ImportRow,
    MaskObject,
    Orientation,
    PictureOptions,
    Publication,
)
from graycard.io import Progress
from graycard.processes import narrowed

SurfelFormat = Literal["ply", "2dgs", "splat"]
"""Formats of ``graycard.methods.trained``, which is too heavy for the help."""
_TOLD = Publication()
CardFormat = Literal["croissant"]
SHEET = "contact-sheet.png"
"""Contact sheet of an imported scene, in its folder."""
MODELS = "colmap"
"""Models that were found for bare photographs, in the scene's folder."""


@dataclass(frozen=True)
class ExportCommand:
    """Write a capture, without photographs of held-out views, or fitted surfels for another program; or
    describe a dataset to those who look for one.
    """

    scene: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE|SAVED|DATASET")]
    """DATASET/<track>/<scene>, or what `graycard fit --save` wrote; for croissant the whole DATASET."""
    format: ExchangeFormat | SurfelFormat | CardFormat
    """For a scene: nerfstudio; COLMAP in text or binary; NeRF-synthetic (blender); or TensoIR, which holds
    truth. Of surfels: ply for viewers of splats, 2dgs for code of 2D Gaussian Splatting, or splat.
    Of a dataset: croissant, a manifest of MLCommons with a data card beside it."""
    out: Annotated[Path, tyro.conf.arg(metavar="FOLDER|FILE")]
    """Write to this folder, new or empty, for croissant the dataset itself; surfels to this file."""
    license: Annotated[str | None, optional("LICENCE")] = None
    """For croissant: licence of the data; Apache-2.0 by default, but for imported photographs."""
    url: str = _TOLD.url
    """For croissant: address of the data."""
    json: Json = None
    """Also write what was exported to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Write the capture, or the surfels."""
        if self.format != "croissant" and (self.license is not None or self.url != _TOLD.url):
            raise GraycardError(
                f"expected --license and --url with --format croissant, got {self.format}. Leave them out"
            )
        if self.format in ("ply", "2dgs", "splat"):
            from graycard.cli.splats import export_surfels

            return export_surfels(self.scene, self.format, self.out, terminal)
        if self.format == "croissant":
            return self._describe(terminal)
        from graycard.exchange import export_capture, left_out_of

        capture = export_capture(self.scene, self.format, self.out)
        held = "with truth" if self.format == "tensoir" else "without a photograph"
        terminal.out.print(
            f"export: {self.out} as {self.format}, {len(capture.train)} photographs, "
            f"{len(capture.test)} held-out cameras {held}"
        )
        lost = left_out_of(capture, self.format)
        counts = {"photographs": len(capture.train), "held_out": len(capture.test), "left_out": lost}
        write_optional_json(self.json, {"folder": self.out, "format": self.format} | counts)
        if lost:
            terminal.err.print(f"warning: {self.format} has no place for {' and '.join(lost)}: left out")
        return OK

    def _describe(self, terminal: Terminal) -> int:
        """Write the manifest and the card of a dataset."""
        from graycard import __version__
        from graycard.exchange import write_cards

        found = write_cards(self.scene, self.out, __version__, Publication(self.license or "", self.url))
        told = {"folder": self.out, "format": self.format, "scenes": len(found.scenes)}
        write_optional_json(self.json, told)
        if self.url == _TOLD.url:
            terminal.advise("give --url, the address where people will find the data")
        terminal.out.print(f"export: {self.out} as croissant, with a data card, {len(found.scenes)} scenes")
        return OK


@dataclass(frozen=True)
class ImportCommand:
    """Make a capture of your own photographs and cameras, and say what was done to them."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    """A folder of nerfstudio, COLMAP (text or binary), NeRF-synthetic or TensoIR."""
    track: Annotated[str, tyro.conf.arg(metavar="TRACK")]
    """Kind of scene: dark, tabletop or multilight."""
    scene: Annotated[str, tyro.conf.arg(metavar="NAME")]
    """Name of the scene."""
    out: Annotated[Path, tyro.conf.arg(metavar="DATASET")]
    """Write to DATASET/<track>/<scene>/capture."""
    hold_out: Annotated[str | None, optional("N|FILE|NAMES")] = None
    """Hold out each N-th photograph by name from the first, 0 for none; or those that a file names, one a
    line; or names with commas. Lists of the folder by default, else each 8th."""
    width: Annotated[int | None, optional("PIXELS")] = None
    """Average photographs down to this width, in linear light; as they are by default."""
    model: Annotated[str | None, optional("NAME")] = None
    """Take this of several models (or lights of TensoIR); the one with the most photographs by default."""
    orientation: Orientation = "auto"
    """EXIF orientation: as camera sizes tell, else pixels as stored (auto); as stored; or turned upright."""
    background: Background = "none"
    """Light behind transparent pixels, in linear light; with none they are an error, but for layouts
    that say that nothing is there: black."""
    exposures: Exposures = "exif"
    """Divide photographs by the exposures that EXIF tells, or take all as exposed alike."""
    mask_object: MaskObject = "auto"
    """The side of masks that is the object: black, unless masks look inverted, which is an error (auto)."""
    find_cameras: bool = False
    """FOLDER holds bare photographs: let COLMAP find their cameras (pip install 'graycard[cameras]')."""
    dry_run: bool = False
    """Show the table of what would be done, and write nothing but --json."""
    json: Json = None
    """Also write the table to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Read, check, write, and show what was done."""
        from graycard.exchange import check_import, plan_import, survey_import

        pictures = PictureOptions(self.orientation, self.background, self.exposures, self.mask_object)
        options = ImportOptions(self.hold_out, self.width, self.model, pictures)
        check_import(None if self.dry_run else self.out, self.track, self.scene, options)
        with (
            terminal.progress(f"importing {self.scene}") as progress,
            self._source(narrowed(progress, 0, 0.5)) as source,
        ):
            plan = plan_import(source, self.track, options)
            if self.dry_run:
                rows = survey_import(plan, narrowed(progress, 0.5, 1))
            else:
                rows = self._write(plan, source, narrowed(progress, 0.5, 1))
        self._show(terminal, rows)
        held = len(plan.shots) - len(plan.train)
        done = "dry run, nothing written" if self.dry_run else str(self.out / self.track / self.scene)
        truth = "true layers of held-out views" if plan.has_truth else "no truth"
        seen = len(plan.pictures.held)
        scored = f", {seen} of them with a photograph to be scored by" if seen else ""
        counts = f"{len(plan.train)} photographs, {held} views held out{scored}"
        terminal.out.print(f"import: {done}, {counts}, {truth}")
        return OK

    @contextmanager
    def _source(self, progress: Progress) -> Iterator[Path]:
        """Yield a folder with cameras."""
        from graycard.exchange import find_cameras

        if not self.find_cameras:
            yield self.folder
            return
        with find_cameras(self.folder, progress) as found:
            yield found

    def _write(self, plan: ImportPlan, source: Path, progress: Progress) -> Sequence[ImportRow]:
        """Write the capture, its contact sheet, and the models that were found for it."""
        from graycard import __version__
        from graycard.exchange import write_import, write_png
        from graycard.io import atomic_folder
        from graycard.reports import contact_sheet

        home = self.out / self.track / self.scene
        rows = write_import(plan, self.out, self.scene, version=__version__, progress=progress)
        if self.find_cameras:
            with atomic_folder(home / MODELS) as kept:
                shutil.copytree(source / "sparse", kept / "sparse")
        write_png(home / SHEET, contact_sheet(home))
        return rows

    def _show(self, terminal: Terminal, rows: Sequence[ImportRow]) -> None:
        table = new_table("", "what", "how many", "said")
        for row in rows:
            table.add_row("!" if row.warns else "", row.what, str(row.count), row.said)
        terminal.out.print(table)
        for row in rows:
            if row.warns:
                terminal.err.print(f"warning: {row.what} ({row.count}): {row.said}")
        write_optional_json(self.json, {"folder": self.folder, "rows": list(rows)})
