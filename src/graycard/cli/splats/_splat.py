# SPDX-License-Identifier: Apache-2.0
"""The verb that renders a trained splat as predictions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from graycard._errors import GraycardError
from graycard.cli._options import optional
from graycard.cli._terminal import OK, Terminal

if TYPE_CHECKING:
    from graycard.methods.trained import Frame, Look, TrainedSplat

BACKGROUNDS = {"black": 0.0, "white": 1.0}
CHOICES = {"auto": None, "yes": True, "no": False}


@dataclass(frozen=True)
class SplatCommand:
    """Render a splat that another program has trained, as predictions of a scene."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE.ply")]
    """A 3DGS or 2DGS PLY, as INRIA's code, nerfstudio, gsplat, OpenSplat, brush and SuperSplat write it
    (compressed ones too), or a .splat."""
    scene: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """DATASET/<track>/<scene>."""
    out: Annotated[Path, tyro.conf.arg(metavar="PREDICTIONS")]
    """Write the predictions to this folder; predictions that it holds are replaced."""
    encoding: Literal["srgb", "linear"] = "srgb"
    """Encoding of the colours. Training on photographs makes sRGB ones: these are blended as they are, then
    decoded, for radiance is linear. linear: after training on linear images."""
    exposed: Literal["auto", "yes", "no"] = "auto"
    """Say if it was trained on light times the scene's exposure, which is then divided out: as photographs of
    `graycard export` are. auto: no for a scene that was imported, and yes for any other."""
    background: Literal["black", "white"] = "black"
    """Background that it was trained over."""
    frame: Annotated[tuple[str, Path] | None, optional("KIND FILE")] = None
    """Undo what a program did to the world: `nerfstudio dataparser_transforms.json`, or `matrix FILE` with
    the 4x4 matrix from the scene's world to the splat's (text, JSON or NPY)."""
    applied: Annotated[Path | None, optional("FILE")] = None
    """With --frame nerfstudio: transforms.json that the scene was imported from, if by ns-process-data."""
    primitive: Literal["auto", "3dgs", "2dgs"] = "auto"
    """Draw ellipsoids or discs; a file with two scales holds discs."""
    antialiased: Literal["auto", "yes", "no"] = "auto"
    """Say if it was trained so (gsplat, nerfstudio); with auto the file says, as those of brush do."""
    name: Annotated[str, tyro.conf.arg(metavar="NAME")] = "splat"
    """Name of the predictions in reports."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Read, check, then render every view."""
        from graycard.dataset import check_scene, open_capture
        from graycard.io import check_label
        from graycard.methods.trained import read_splat, write_splat_predictions

        try:
            check_label(self.name)
        except ValueError as cause:
            raise GraycardError(f"{cause}. Mend --name") from cause
        look = self._look()
        check_scene(self.scene)
        capture = open_capture(self.scene / "capture")
        splat = read_splat(self.file, None if self.primitive == "auto" else self.primitive)
        if splat.unused:
            terminal.advise(f"properties that are not looked at: {', '.join(splat.unused)}")
        for doubt in splat.doubts:
            terminal.advise(doubt)
        with terminal.progress(f"{self.file} on {capture.track}/{capture.scene}") as progress:
            drawn = write_splat_predictions(splat, capture, self.out, progress, look, self.name)
        if drawn.unseen:
            terminal.advise(
                f"nothing of the splat is seen in {len(drawn.unseen)} of {len(capture.views)} views, as "
                f"{', '.join(drawn.unseen[:3])}: is its world that of the scene? --frame tells how it was "
                "moved"
            )
        terminal.out.print(f"splat: {self.out}, {_described(splat)}, {len(capture.views)} views")
        return OK

    def _look(self) -> Look:
        from graycard.methods.trained import Look

        return Look(
            self.encoding,
            CHOICES[self.exposed],
            BACKGROUNDS[self.background],
            CHOICES[self.antialiased],
            self._frame(),
        )

    def _frame(self) -> Frame:
        """Return where the world of the splat lies.

        Raises:
            GraycardError: There is no such kind, or its file is none.
        """
        from graycard.methods.trained import FRAMES, SAME, read_frame

        if self.frame is None:
            return SAME
        kind, path = self.frame
        for known in FRAMES:
            if kind == known:
                return read_frame(known, path, self.applied)
        raise GraycardError(
            f"expected --frame with {' or '.join(FRAMES)} and a file, got {kind!r}. Mend --frame"
        )


def _described(splat: TrainedSplat) -> str:
    shapes = "ellipsoids (3DGS)" if splat.primitive == "3dgs" else "discs (2DGS)"
    return f"{len(splat)} {shapes} with harmonics of degree {splat.degree}"
