# SPDX-License-Identifier: Apache-2.0
"""From an imported capture and predictions of it to one HTML file."""

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from graycard import RecordError
from graycard.io import write_bytes
from graycard.reports._templates import CELL_PADDING, LEAST_CELL, asset, content_policy, environment
from graycard.reports.captures._page import CapturePage, CaptureRow, capture_page
from graycard.reports.pictures._colour_maps import COLOUR_MAPS
from graycard.reports.pictures._pictures import KNEE, LEVELS, STEP, gradient


def write_capture_report(scene: Path, rows: Sequence[CaptureRow], *, out: Path | None = None) -> Path:
    """Write the page of an imported capture: one HTML file without any reference to another host or file.

    Args:
        scene: ``DATASET/<track>/<scene>`` of an imported capture.
        rows: Predictions with their scores by photographs, one or more.
        out: The file; None for ``SCENE/report/index.html``.

    Returns:
        The path of the page.

    Raises:
        RecordError: There are no rows, or two have one name.
        DatasetError: The photographs are missing or damaged.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    names = [row.name for row in rows]
    if not names or len({*names}) < len(names):
        raise RecordError(f"expected rows of different names, got {', '.join(names) or 'none'}. Rename one")
    path = Path(scene) / "report" / "index.html" if out is None else out
    write_bytes(path, _html(capture_page(Path(scene), rows)).encode())
    return path


def _html(page: CapturePage) -> str:
    bars = "".join(f".bar.{name} {{ background: {gradient(name)}; }}\n" for name in COLOUR_MAPS)
    tiles = [view.picture.truth.picture for view in page.views]
    widest = max((picture.shown[0] for picture in tiles if picture), default=0)
    width = (len(page.methods) + 1) * max(widest + CELL_PADDING, LEAST_CELL)
    style = asset("report.css") + bars + f".across-{width} {{ max-width: {width}px; }}\n"
    script = asset("report.js")
    sources = dict.fromkeys(p.linear for p in page.pictures() if p.linear)
    return (
        environment()
        .get_template("capture.html.j2")
        .render(
            page=page,
            style=Markup(style),
            script=Markup(script),
            policy=content_policy(style, script),
            linear={source: number for number, source in enumerate(sources)},
            width=width,
            knee=KNEE,
            step=STEP,
            levels=LEVELS,
        )
    )
