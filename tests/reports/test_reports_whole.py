# SPDX-License-Identifier: Apache-2.0
"""Nothing of a run is lost: what its records say stands in the page once that is opened."""

import re
from collections.abc import Iterator
from functools import cache
from html import unescape

import pytest

from graycard.records import RunRecord, read_ledger, read_run
from graycard.reports._format import format_value
from graycard.reports.history._keep import OWN
from opened import opened, parts_of

TAG = re.compile(r"<[^>]*>")


def words(html: str) -> str:
    """The words of HTML, and those of its titles and labels."""
    told = re.findall(r'(?:title|aria-label)="([^"]*)"', html)
    return " ".join(unescape(" ".join((TAG.sub(" ", html), *told))).split())


@cache
def page_of(name: str) -> str:
    return (OWN / name / "index.html").read_text(encoding="utf-8")


def scenes_of(record: RunRecord) -> Iterator[tuple[str, str]]:
    """Anchors with names of scenes."""
    tracks = list(dict.fromkeys(scene.track for scene in record.scenes))
    for number, track in enumerate(tracks, 1):
        for place, scene in enumerate((s for s in record.scenes if s.track == track), 1):
            yield f"track-{number}-scene-{place}", scene.scene


def check_scene(record: RunRecord, parts: dict[str, str], anchor: str, scene: str) -> None:
    """Hold the parts of a scene against its scores, warnings and failures."""
    handed = {method.name for method in record.methods if method.sees}
    units = {metric.id: metric.unit for metric in record.metrics}
    scores, warnings = words(parts[f"{anchor}-scores"]), words(parts.get(f"{anchor}-warnings", ""))
    for result in (r for r in record.results if r.job.scene == scene):
        assert result.sheet is not None
        for score in result.sheet.scores:
            if score.value is not None:
                assert format_value(score.value, units[score.metric]) in scores
            for warning in score.warnings if result.job.method not in handed else ():
                assert " ".join(warning.split()) in warnings
            if score.status == "failed":
                assert " ".join(score.reason.split()) in words(parts["facts-failures"])


@pytest.mark.parametrize("name", ["tabletop", "dark"])
def test_every_score_and_warning_of_a_scene_is_in_its_parts(name: str) -> None:
    record, parts = read_run(OWN / name), parts_of(page_of(name))
    for anchor, scene in scenes_of(record):
        check_scene(record, parts, anchor, scene)


@pytest.mark.parametrize("name", ["tabletop", "multilight"])
def test_every_verdict_stands_with_its_evidence(name: str) -> None:
    ledger, parts, page = read_ledger(OWN / name), parts_of(page_of(name)), opened(page_of(name))
    assert ledger is not None
    for claim in (claim for paper in ledger.papers for claim in paper.claims):
        assert f'href="#claim-{claim.id}"' in page
        part = words(parts[f"claim-{claim.id}"])
        told = (claim.sentence, claim.verdict, claim.text.rstrip("."), claim.source, *claim.notes)
        assert all(" ".join(text.split()) in part for text in told)
        assert all(" ".join(check.says.split()) in part for check in claim.checks)


def test_every_method_metric_job_and_hash_is_told() -> None:
    record, page = read_run(OWN / "tabletop"), words(opened(page_of("tabletop")))
    for method in record.methods:
        assert method.name in page
        assert " ".join(method.summary.split()) in page
    scored = {score.metric for result in record.results if result.sheet for score in result.sheet.scores}
    for metric in record.metrics:
        assert metric.title in page or metric.id not in scored
    for result in record.results:
        assert result.job_hash[:12] in page
    for scene in record.scenes:
        assert scene.truth_sha256 in page
        assert scene.title in page


def test_a_score_that_is_missing_is_found() -> None:
    """Planted: a score of the first scene is taken out."""
    record, parts = read_run(OWN / "tabletop"), parts_of(page_of("tabletop"))
    anchor, scene = next(scenes_of(record))
    check_scene(record, parts, anchor, scene)
    sheet = next(r.sheet for r in record.results if r.job.scene == scene)
    assert sheet is not None
    score = next(score for score in sheet.scores if score.value is not None)
    name, text = f"{anchor}-scores", format_value(score.value or 0.0, score.unit)
    with pytest.raises(AssertionError):
        check_scene(record, parts | {name: parts[name].replace(text, "–")}, anchor, scene)


@pytest.mark.parametrize("name", ["dark", "tabletop", "multilight", "matte", "robust"])
def test_published_pages_are_small_and_light(name: str) -> None:
    page = page_of(name)
    shell = page.partition('<script type="application/octet-stream"')[0]
    assert len(page) < 6e6
    assert len(re.findall(r"<[a-z]", shell)) < 5000
    assert shell.index("<img") < shell.index("<table")
