# SPDX-License-Identifier: Apache-2.0
"""From an imported capture and predictions of it to one HTML file."""

import json
from collections.abc import Sequence
from pathlib import Path

from graycard import RecordError
from graycard.io import to_builtins, write_bytes
from graycard.reports.captures._page import CapturePage, CaptureRow, capture_page
from graycard.reports.parts._islands import blob_island, pack, without_bytes
from graycard.reports.parts._render import Island, Renderer


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
    kept, blobs = without_bytes({"pictures": {"methods": page.methods, "gallery": to_builtins(page.gallery)}})
    islands = [
        Island("kept", "pictures", pack(json.dumps(kept, separators=(",", ":")))),
        Island("blobs", "pictures", blob_island(blobs)),
    ]
    return Renderer().page("capture.html.j2", islands, page=page)
