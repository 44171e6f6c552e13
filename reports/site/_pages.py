# SPDX-License-Identifier: Apache-2.0
"""The pages of a site as HTML text; everything that comes from a record is escaped."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any
from urllib.parse import quote

from jinja2 import Environment
from markupsafe import Markup

from graycard.reports._claims import LEGEND
from graycard.reports._templates import asset, content_policy, environment
from graycard.reports.history._page import verdict_class
from graycard.reports.site._claims import SitePaper
from graycard.reports.site._runs import SiteRun

PAGES: tuple[tuple[str, str, str], ...] = (
    (
        "index.html",
        "Ledger",
        "What papers on inverse rendering claim, and what scenes say of it whose light is known exactly.",
    ),
    ("claims.html", "Claims", "Each claim with every verdict that it ever had, and why it changed."),
    ("leaderboards.html", "Leaderboards", "Who is best on which track, by how much, and how surely."),
    ("scenes.html", "Scenes", "The rendered scenes that judge."),
    ("methods.html", "Methods", "The rows of all runs, and what they are."),
    ("submit.html", "How to submit", "Bring a method, predictions or claims."),
)
"""File, name and first sentence of each page that every site has."""


def site_pages(
    papers: Sequence[SitePaper], runs: Sequence[SiteRun], histories: Iterable[tuple[str, str]]
) -> Iterator[tuple[str, str]]:
    """Yield the file name and the text of each page but those of histories.

    Args:
        papers: With their claims.
        runs: All of them.
        histories: File and name of each page of a history, which the bar of pages links to.
    """
    style = asset("report.css") + asset("site/site.css")
    links = [*((file, name) for file, name, _ in PAGES), *histories]
    shared: dict[str, Any] = {
        "papers": papers,
        "runs": runs,
        "pages": links,
        "legend": LEGEND,
        "style": Markup(style),
        "policy": content_policy(style, ""),
    }
    templates = _environment()
    for file, title, lead in PAGES:
        template = templates.get_template(f"site/{file}.j2")
        yield file, template.render(here=file, title=title, lead=lead, **shared)


def _environment() -> Environment:
    found = environment()
    found.filters["verdict_class"] = verdict_class
    found.filters["quoted"] = quote
    found.filters["quoted_link"] = _quoted_link
    return found


def _quoted_link(link: str) -> str:
    """Return a link to a place in a file with both parts quoted."""
    path, _, anchor = link.partition("#")
    return f"{quote(path)}#{quote(anchor)}"
