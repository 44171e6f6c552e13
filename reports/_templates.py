# SPDX-License-Identifier: Apache-2.0
"""From the content of a page to HTML text; everything that comes from a record is escaped."""

import base64
import hashlib
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from graycard.reports._explanations import EXPLAINS
from graycard.reports._format import format_name, format_number
from graycard.reports._page import Page
from graycard.reports._scene_section import ScenePictures
from graycard.reports.pictures._colour_maps import COLOUR_MAPS
from graycard.reports.pictures._pictures import gradient

TEMPLATES = Path(__file__).parent / "templates"
MAX_NAMED_SCENES = 8
"""With more, the bar at the top names tracks alone."""

CELL_PADDING, LEAST_CELL = 10, 176
"""Of a gallery, in CSS pixels: beside a picture, and as wide as names and scales need."""


def render_page(page: Page) -> str:
    """Return the HTML text of a page, with its style and script inside."""
    bars = "".join(f".bar.{name} {{ background: {gradient(name)}; }}\n" for name in COLOUR_MAPS)
    shown = [s.pictures for track in page.tracks for s in track.scenes if s.pictures]
    widths = "".join(f".across-{n} {{ max-width: {n}px; }}\n" for n in sorted(set(map(gallery_width, shown))))
    style, script = asset("report.css") + bars + widths, asset("report.js")
    return (
        environment()
        .get_template("report.html.j2")
        .render(
            page=page,
            style=Markup(style),
            script=Markup(script),
            policy=content_policy(style, script),
            linear=linear_sources(page),
            explains=EXPLAINS,
            gallery_width=gallery_width,
            few_scenes=sum(len(track.scenes) for track in page.tracks) <= MAX_NAMED_SCENES,
        )
    )


def gallery_width(pictures: ScenePictures) -> int:
    """CSS pixels that the gallery of a scene needs for its pictures side by side."""
    tiles = [row.truth for view in pictures.gallery.views for row in view.rows]
    widest = max((tile.picture.shown[0] for tile in tiles if tile.picture), default=0)
    return (len(pictures.methods) + 1) * max(widest + CELL_PADDING, LEAST_CELL)


def linear_sources(page: Page) -> dict[str, int]:
    """The data URIs of all linear light in a page, each once, with its number.

    A perfect prediction is the same picture as the truth: its bytes are not written twice.
    """
    galleries = [s.pictures.gallery for track in page.tracks for s in track.scenes if s.pictures]
    found = [picture.linear for gallery in galleries for picture in gallery.pictures()]
    return {source: number for number, source in enumerate(dict.fromkeys(filter(None, found)))}


def content_policy(style: str, script: str) -> str:
    """A content security policy under which only this style, this script and data: images work.

    Whatever escaped the escaping could still not run, and no browser asks any host for anything.
    """
    return (
        f"default-src 'none'; img-src data:; style-src '{_digest(style)}'; script-src '{_digest(script)}'; "
        "base-uri 'none'; form-action 'none'"
    )


def environment() -> Environment:
    """Return what templates are rendered by: strict, and all that comes from a record is escaped."""
    found = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters["words"] = format_name
    found.filters["number"] = format_number
    return found


def asset(name: str) -> str:
    """Return the text of a style sheet or script that comes along."""
    return "\n" + (TEMPLATES / name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
