# SPDX-License-Identifier: Apache-2.0
"""The verbs that show what was fitted: a web viewer, and a film of a turn around it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from graycard._errors import GraycardError
from graycard.cli._options import optional
from graycard.cli._terminal import OK, Terminal

if TYPE_CHECKING:
    from graycard import Camera

HIGHEST = 65535
"""Port that a computer has."""
LONGEST = 3600
"""Pictures of a film."""


@dataclass(frozen=True)
class ViewCommand:
    """Show fitted surfels or the layers of predictions in the browser of this machine."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="PREDICTIONS|SAVED")]
    """Predictions, or what `graycard fit --save` wrote."""
    scene: Annotated[Path | None, optional("SCENE")] = None
    """Also show the cameras of DATASET/<track>/<scene>."""
    port: int = 8080
    """Port of the page, http://127.0.0.1:PORT; the next free one is taken."""
    seconds: Annotated[float | None, optional("SECONDS")] = None
    """End after so long; by default when you press Ctrl-C."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Serve the page."""
        from graycard.methods.viewer import is_saved, open_fitted, serve_fitted, serve_pictures
        from graycard.predictions import open_predictions

        self._check()
        cameras = _cameras(self.scene)
        if is_saved(self.folder):
            server = serve_fitted(open_fitted(self.folder), cameras, self.port)
        else:
            server = serve_pictures(open_predictions(self.folder), cameras, self.port)
        terminal.out.print(f"view: http://127.0.0.1:{server.get_port()} (Ctrl-C ends)")
        end = time.monotonic() + (self.seconds if self.seconds is not None else float("inf"))
        try:
            while time.monotonic() < end:
                time.sleep(0.1)
        finally:
            server.stop()
        return OK

    def _check(self) -> None:
        """Refuse a page that cannot be served.

        Raises:
            GraycardError: A number is out of its range.
        """
        if not 1 <= self.port <= HIGHEST:
            raise GraycardError(f"expected a port from 1 to {HIGHEST}, got {self.port}. Mend --port")
        if self.seconds is not None and not self.seconds >= 0:
            raise GraycardError(f"expected seconds of 0 or more, got {self.seconds}. Mend --seconds")


@dataclass(frozen=True)
class TurntableCommand:
    """Write a film of a turn around a saved decomposition."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SAVED")]
    """A folder that `graycard fit --save` wrote."""
    out: Annotated[Path, tyro.conf.arg(metavar="FILE.mp4|FILE.gif|FOLDER")]
    """Write to this file; a name without a suffix is a folder of PNG files."""
    layer: Annotated[str, tyro.conf.arg(metavar="LAYER")] = "radiance"
    """Layer that is shown."""
    scene: Annotated[Path | None, optional("SCENE")] = None
    """Go where the cameras of DATASET/<track>/<scene> stand, instead of around all surfels."""
    frames: int = 60
    """Pictures of the film."""
    seconds: float = 4.0
    """Length of the film."""
    size: int = 256
    """Pixels a side."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Draw, then write."""
        from graycard.methods.viewer import brightest, check_film, open_fitted, orbit, preview, write_film

        self._check()
        check_film(self.out)
        cameras, fitted = list(_cameras(self.scene).values()), open_fitted(self.folder)
        path = orbit(fitted.surfels.shapes.centres.numpy(), self.frames, self.size, cameras)
        drawn, white = [], None
        with terminal.progress(f"drawing {self.frames} pictures of {self.folder}") as progress:
            for done, camera in enumerate(path):
                progress(done / len(path), "drawing")
                values = fitted.decomposition.render(camera, [self.layer])[self.layer]
                white = white or brightest(values)  # one for the film, or it would flicker
                drawn.append(preview(self.layer, values, white))
        write_film(self.out, drawn, self.frames / self.seconds)
        terminal.out.print(f"turntable: {self.out}, {len(drawn)} pictures of {self.layer} by {fitted.method}")
        return OK

    def _check(self) -> None:
        """Refuse a film that is none.

        Raises:
            GraycardError: A number is out of its range.
        """
        if not 1 <= self.frames <= LONGEST:
            raise GraycardError(f"expected 1 to {LONGEST} pictures, got {self.frames}. Mend --frames")
        if not 0 < self.seconds < float("inf"):
            raise GraycardError(f"expected seconds above 0, got {self.seconds}. Mend --seconds")
        if not 16 <= self.size <= 4096 or self.size % 2:
            raise GraycardError(f"expected an even size of 16 to 4096 pixels, got {self.size}. Mend --size")


def _cameras(scene: Path | None) -> dict[str, Camera]:
    """Return the cameras of a scene by the names of their views."""
    if scene is None:
        return {}
    from graycard.dataset import check_scene, open_capture

    check_scene(scene)
    return {view.name: view.camera for view in open_capture(scene / "capture", check=False).views}
