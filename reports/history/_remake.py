# SPDX-License-Identifier: Apache-2.0
"""A published page made anew around its pictures: all else follows from records and today's rules."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from markupsafe import escape

from graycard import RecordError
from graycard.records import Comparison, Ledger, RunRecord
from graycard.reports._claims import section_of
from graycard.reports._page import build_page
from graycard.reports._templates import asset, content_policy, render_page

_SCENE: Final = re.compile(r'<article class="scene" id="([^"]*)".*?</article>', re.DOTALL)
_BODY: Final = re.compile(r"<body [^>]*>")
_LINEAR: Final = re.compile(r'<script type="application/json" id="linear">.*?</script>', re.DOTALL)
_SCRIPT: Final = re.compile(r"(?<=<script>).*?(?=</script>)", re.DOTALL)
_STYLE: Final = re.compile(r"(?<=<style>).*?(?=</style>)", re.DOTALL)
_POLICY: Final = re.compile(r'(?<=http-equiv="Content-Security-Policy" content=")[^"]*')
_OF_PICTURES: Final = re.compile(r"^\.bar\..*", re.DOTALL | re.MULTILINE)
"""The style that a page has for its own pictures, after that of all pages."""


@dataclass(frozen=True, slots=True)
class PictureParts:
    """The parts of a page that only scenes and predictions can give, as HTML."""

    scenes: Mapping[str, str]
    """By anchor: pictures, with the scores of the same scene, which no rule changes."""
    body: str
    """Opening tag, with the code in which linear light is embedded."""
    linear: str
    """Linear light by its number."""
    script: str
    """Shows that light."""
    style: str


def picture_parts(page: str, record: RunRecord) -> PictureParts:
    """Return what a published page keeps.

    Raises:
        RecordError: A part is missing, or the page has not the scenes of the record.
    """
    scenes = {found[1]: found[0] for found in _SCENE.finditer(page)}
    if len(scenes) != len(record.scenes):
        raise RecordError(
            f"expected a page with {len(record.scenes)} scenes, as run.json has, got {len(scenes)}. "
            "Publish the run anew"
        )
    found = [pattern.search(page) for pattern in (_BODY, _LINEAR, _SCRIPT, _STYLE)]
    body, linear, script, style = (part[0] if part else "" for part in found)
    own = _OF_PICTURES.search(style)
    if not (body and linear and script and own):
        raise RecordError("expected a report with style and script, got a page without. Publish the run anew")
    return PictureParts(scenes, body, linear, script, own[0])


def remade_page(
    kept: PictureParts, record: RunRecord, run: Path, comparison: Comparison, ledger: Ledger
) -> str:
    """Return a page with the words and tables of today around pictures of before.

    Who is best, leaderboards, rules, claims and facts follow from the records; nothing else is read.

    Args:
        kept: Parts of the page as it was.
        record: Its run.
        run: The published folder.
        comparison: Of the run, by today's rules.
        ledger: Its verdicts.
    """
    built = replace(build_page(record, run, (), comparison), claims=section_of(ledger, run))
    page = render_page(built)
    page = _SCENE.sub(lambda found: kept.scenes[found[1]], page)
    style = asset("report.css") + kept.style
    policy = str(escape(content_policy(style, kept.script)))
    parts = (_BODY, kept.body), (_LINEAR, kept.linear), (_SCRIPT, kept.script), (_STYLE, style)
    for pattern, part in (*parts, (_POLICY, policy)):
        page = pattern.sub(lambda _, part=part: part, page, count=1)
    return page
