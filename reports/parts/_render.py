# SPDX-License-Identifier: Apache-2.0
"""From the content of a page to HTML text: a shell that is seen at once, and parts that lie in it as data."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

from jinja2 import Environment
from markupsafe import Markup, escape

from graycard.reports._explanations import EXPLAINS
from graycard.reports._page import Page
from graycard.reports._scene_section import SceneSection
from graycard.reports._templates import content_policy, environment, map_island, page_script, page_style
from graycard.reports.parts._islands import blob_island, pack
from graycard.reports.parts._kept import kept_of
from graycard.reports.pictures._pictures import KNEE, LEVELS, STEP

WHOLE = "This file is complete in itself and asks no host for anything."
SPLIT = "Its scenes lie in files beside it; none asks a host for anything."


@dataclass(frozen=True, slots=True)
class Island:
    """A part of a page as data."""

    kind: str
    """``part``, ``kept`` or ``blobs``."""
    id: str
    text: str

    def html(self) -> str:
        """Return it as an element that a browser does not run."""
        media = "application/json" if self.kind == "blobs" else "application/octet-stream"
        return f'<script type="{media}" data-{self.kind}="{escape(self.id)}">{self.text}</script>\n'


class Renderer:
    """Templates of a report, with what all of them are told."""

    def __init__(self) -> None:
        self._environment: Environment = environment()
        self._modules: dict[str, Any] = {}

    def part(self, file: str, macro: str, *content: object) -> str:
        """Return the HTML of one part."""
        module = self._modules.get(file)
        if module is None:
            module = self._environment.get_template(file).make_module({"explains": EXPLAINS})
            self._modules[file] = module
        return str(getattr(module, macro)(*content))

    def page(self, file: str, islands: Sequence[Island], **told: object) -> str:
        """Return a whole page around its islands."""
        style, script = page_style(), page_script()
        return self._environment.get_template(file).render(
            style=Markup(style),
            script=Markup(script),
            policy=content_policy(style, script),
            islands=Markup("".join(island.html() for island in islands)),
            colour_maps=Markup(map_island()),
            knee=KNEE,
            step=STEP,
            levels=LEVELS,
            explains=EXPLAINS,
            **told,
        )


def render_page(page: Page) -> str:
    """Return a report as one HTML text."""
    render = Renderer()
    islands = [
        *run_islands(render, page),
        *(i for t in page.tracks for s in t.scenes for i in scene_islands(render, t.name, s)),
    ]
    return shell(render, page, islands, {}, WHOLE)


def render_files(page: Page, index: str, folder: str) -> Iterator[tuple[str, str]]:
    """Yield a report as several files, its index last: name below one folder, and HTML text.

    Args:
        page: The content.
        index: Name of the file that leads to the others.
        folder: Name of the folder of scenes.
    """
    render, elsewhere = Renderer(), {}
    for track in page.tracks:
        for section in track.scenes:
            islands = list(scene_islands(render, track.name, section))
            name = f"{folder}/{section.anchor}.html"
            elsewhere[section.anchor] = quote(name)
            yield (
                name,
                render.page(
                    "one_scene.html.j2", islands, page=page, track=track, section=section, index=quote(index)
                ),
            )
    yield index, shell(render, page, list(run_islands(render, page)), elsewhere, SPLIT)


def shell(
    render: Renderer, page: Page, islands: Sequence[Island], elsewhere: Mapping[str, str], closing: str
) -> str:
    """Return the page of a run around its islands.

    Args:
        render: Templates.
        page: The content.
        islands: Parts as data.
        elsewhere: Links to files of scenes that are not in this one, by anchor.
        closing: Last sentence.
    """
    return render.page("report.html.j2", islands, page=page, elsewhere=elsewhere, closing=closing)


def run_islands(render: Renderer, page: Page) -> Iterator[Island]:
    """Yield the parts of a run that belong to no scene."""
    papers = page.claims.papers if page.claims else ()
    for row in (row for paper in papers for group in paper.groups for row in group.claims):
        yield _island(row.anchor, render.part("claim.html.j2", "claim_of", row))
    for track in page.tracks:
        for macro, name in (
            ("board", "board"),
            ("all", "all"),
            ("by_scene", "by-scene"),
            ("failures", "failures"),
        ):
            yield _island(f"{track.anchor}-{name}", render.part("tables.html.j2", macro, track))
    for macro in ("failures", "machine", "jobs", "hashes"):
        yield _island(f"facts-{macro}", render.part("facts.html.j2", macro, page))


def scene_islands(render: Renderer, track: str, section: SceneSection) -> Iterator[Island]:
    """Yield the parts of a scene, and its pictures."""
    yield _island(section.anchor, render.part("scene.html.j2", "scene", section))
    yield _island(f"{section.anchor}-scores", render.part("scene.html.j2", "scores", section))
    yield _island(f"{section.anchor}-views", render.part("scene.html.j2", "views", section))
    if section.warnings:
        yield _island(f"{section.anchor}-warnings", render.part("scene.html.j2", "warnings", section))
    if section.spreads:
        yield _island(f"{section.anchor}-protocols", render.part("spread.html.j2", "protocols", section))
    if section.pictures:
        yield _island(f"{section.anchor}-settings", render.part("scene.html.j2", "settings", section))
        yield _island(f"{section.anchor}-worst", render.part("scene.html.j2", "worst", section))
        yield _island(f"{section.anchor}-lights", render.part("plan.html.j2", "lights", section))
    kept, blobs = kept_of(track, section)
    yield Island("kept", section.anchor, pack(kept))
    yield Island("blobs", section.anchor, blob_island(blobs))


def _island(anchor: str, html: str) -> Island:
    return Island("part", anchor, pack(html))
