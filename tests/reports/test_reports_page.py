# SPDX-License-Identifier: Apache-2.0
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graycard import OutputError, Predictions, RecordError, open_predictions
from graycard.io import to_builtins, write_json
from graycard.predictions import finish_predictions, write_view
from graycard.records import Edition, RunRecord, Score
from graycard.reports import write_report
from graycard.reports._templates import TEMPLATES
from graycard.reports.parts._islands import without_bytes
from graycard.reports.parts._kept import kept_scenes
from opened import opened
from runs_of_size import write_made_up

MakeRun = Callable[..., tuple[Path, RunRecord]]
VOID = {"meta", "img", "input", "br", "link"}
SHAPES = {"circle", "rect", "polygon", "path", "line", "image"}


class Outline(HTMLParser):
    """Elements with their attributes; fails where tags do not nest."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        assert len(dict(attrs)) == len(attrs), f"an attribute twice in <{tag}>"
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag in SHAPES, f"<{tag}/> closes itself in SVG only"
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("script", "style"):
            self.text.append(data)

    def all(self, tag: str, **attributes: str) -> list[dict[str, str | None]]:
        return [a for t, a in self.found if t == tag and attributes.items() <= a.items()]

    @property
    def words(self) -> str:
        return " ".join(" ".join(self.text).split())


@pytest.fixture(scope="module")
def outline(tiny_report: str) -> Outline:
    return Outline(tiny_report)


def report_of(run: Path) -> Outline:
    return Outline(opened(write_report(run).read_text(encoding="utf-8")))


def test_well_formed_with_unique_ids_and_targets(outline: Outline) -> None:
    ids = Counter(a["id"] for _, a in outline.found if "id" in a)
    assert max(ids.values()) == 1
    for name in ("href", "aria-labelledby", "aria-describedby"):
        targets = [a[name] for tag, a in outline.found if a.get(name) and tag != "image"]
        assert targets
        assert {str(t).removeprefix("#") for t in targets} <= set(ids)


def test_accessible(outline: Outline) -> None:
    assert all(a.get("alt") for a in outline.all("img"))
    assert all(a.get("scope") for a in outline.all("th"))
    assert len(outline.all("caption")) == len(outline.all("table"))
    assert all(a.get("tabindex") == "0" and a.get("aria-label") for a in outline.all("div", role="region"))
    assert outline.all("html", lang="en")


def test_names_what_the_run_holds(outline: Outline) -> None:
    for part in (
        "Suite smoke", "21 November 2026, 09:47 UTC", "Track Dark", "Track Tabletop", "Track Multilight",
        "1 h 2 min", "llvm_ad_rgb", "0123abc+", "An & Example <CPU>", "12.5 s", "346 MiB", "0123456789ab",
        "also sees: radiance, lights", "ceiling 48.50", "∞", "12 jobs, 1 failed",
        "1 of 2 lights has no partner", "gauge 2 1 0.5",
        "10·log10(1 / MSE), srgb(L·exposure) <mask>", "in dB; higher is better; perfect is ∞ dB",
        "without unit;",
        "here from 10.46 (<script>window.broken = 1</script>) to ∞ (truth)",
    ):  # fmt: skip
        assert part in outline.words, part


def test_failure_is_told_in_visible_words(outline: Outline) -> None:
    assert outline.words.count("got its death <exit code -9>") == 3  # track, scene, list of all failures
    failed = [a for a in outline.all("td") if "failed" in (a.get("class") or "").split()]
    assert len(failed) > 4


def test_not_provided_is_a_dash_with_a_title(outline: Outline) -> None:
    quiet = [a for a in outline.all("td") if "not-provided" in (a.get("class") or "").split()]
    assert quiet
    assert {a.get("title") for a in quiet} == {"not provided"}


def test_removal_stands_on_the_tabletop_only(tiny_report: str) -> None:
    _, dark, tabletop, multilight = re.split(r'id="track-\d-tables"', tiny_report)
    title = "Radiance without the target object"
    assert title in tabletop
    assert title not in dark
    assert title not in multilight
    assert "Removal PSNR" not in dark


def test_nothing_of_a_record_becomes_markup(outline: Outline, tiny_report: str) -> None:
    assert len(outline.all("script")) == 1
    assert "<script>window.broken" not in tiny_report
    assert "<b>fails</b>" not in tiny_report
    assert "<script>window.broken = 1</script>" in outline.words
    assert not [name for _, a in outline.found for name in a if name.startswith("on") or name == "style"]


def test_no_reference_to_any_host_or_file(outline: Outline, tiny_report: str) -> None:
    assert not re.search(r"https?:|url\(|@import|//[a-z]+\.", re.sub(r"[A-Za-z0-9+/=]{60,}", "", tiny_report))
    for name in ("src", "href", "data", "poster", "srcset"):
        values = [str(a[name]) for _, a in outline.found if name in a]
        assert all(v.startswith(("data:image/webp;base64,", "#")) for v in values)


def test_tabletop_tells_at_the_top_what_it_asks(make_run: MakeRun) -> None:
    """Claims come before scenes in the bar, as on the page, and what no method provides is hidden."""
    run, record = make_run()
    residual = "counterfactual.residual.mirror.specular"
    asked = replace(record.metrics[2], id=residual, title="Left over <mirror>", unit="1", headline=False)
    results = tuple(
        replace(r, sheet=replace(r.sheet, scores=tuple(_unscored(s, residual) for s in r.sheet.scores)))
        if r.sheet
        else r
        for r in record.results
    )
    metrics = tuple(asked if m.id == "counterfactual.psnr" else m for m in record.metrics)
    write_json(run / "run.json", replace(record, metrics=metrics, results=results))
    html = opened(write_report(run).read_text(encoding="utf-8"))
    summary = html[html.index('<section class="summary"') : html.index('<section class="track"')]
    assert "Removal of the reflection" in summary
    assert "Provided by no competing method: Light position error." in Outline(html).words
    boards = re.findall(r'<table class="scores leaderboard">.*?</table>', html, re.S)
    assert ["Left over &lt;mirror&gt;" in board for board in boards] == [False, True, False]
    hidden = re.compile(r'<th scope="col" class="number nobody">.*?</th>', re.S)
    assert all("Light position error" in board for board in boards)
    assert not any("Light position error" in hidden.sub("", board) for board in boards)
    told = "no competing method provides it: 1 column (Light position error)"
    assert Outline(html).words.count(told) == 3


def _unscored(score: Score, residual: str) -> Score:
    if score.metric == "counterfactual.psnr":
        return replace(score, metric=residual)
    if score.metric == "light.position":
        return replace(score, status="not provided", value=None, per_view={}, warnings=())
    return score


def test_policy_holds_the_hash_of_the_script(outline: Outline) -> None:
    (meta,) = outline.all("meta", **{"http-equiv": "Content-Security-Policy"})
    assert "default-src 'none'" in str(meta["content"])
    assert re.search(r"script-src 'sha256-[\w+/=]{44}'", str(meta["content"]))


def find_pictures(data: Any) -> Iterator[dict[str, Any]]:
    """Yield all pictures in JSON data."""
    if isinstance(data, dict) and "webp" in data:
        yield data
    elif isinstance(data, dict | list | tuple):
        for part in data.values() if isinstance(data, dict) else data:
            yield from find_pictures(part)


def test_equal_pictures_are_embedded_once(tiny_page: str) -> None:
    """The reference method shows the truth again."""
    for kept in kept_scenes(tiny_page).values():
        assert kept.pictures is not None
        for view in kept.pictures.gallery.views:
            for row in view.rows:
                truth, own = row.truth.picture, row.predictions[kept.pictures.methods.index("truth")].picture
                assert truth is not None
                assert own is None or own.webp == truth.webp
        _, blobs = without_bytes(to_builtins(kept))
        assert len(blobs) < sum(len(picture) > 1 for picture in find_pictures(to_builtins(kept)))


def test_same_run_same_bytes_and_small(tiny_run: Path, tiny_page: str) -> None:
    path = write_report(tiny_run)
    assert path == tiny_run / "report" / "index.html"
    assert path.read_text(encoding="utf-8") == tiny_page
    assert path.stat().st_size < 5e6
    assert [p.name for p in path.parent.iterdir()] == ["index.html"]


def test_moved_run_gives_the_same_report(make_run: MakeRun, tmp_path: Path) -> None:
    run, _ = make_run()
    before = write_report(run).read_bytes()
    moved = run.rename(tmp_path / "elsewhere")
    assert write_report(moved).read_bytes() == before


def test_run_without_record(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"expected a run folder with run\.json"):
        write_report(tmp_path)


def test_folder_that_cannot_be_written(make_run: MakeRun) -> None:
    run, _ = make_run()
    (run / "report").write_text("a file in the way")
    with pytest.raises(OutputError, match="expected an output folder"):
        write_report(run)


def test_missing_scene_is_said_in_place(make_run: MakeRun) -> None:
    run, record = make_run()
    (run / record.scenes[0].folder / "truth" / "manifest.json").unlink()
    words = report_of(run).words
    assert "No pictures of this scene expected a dataset folder" in words
    assert words.count("Scores of tiny-0000") == 3


def test_missing_and_broken_predictions_are_said_in_place(make_run: MakeRun) -> None:
    run, record = make_run()
    by_method = {
        r.job.method: run / r.folder / "predictions" for r in record.results if r.job.track == "dark"
    }
    (by_method["truth"] / "predictions.json").unlink()
    (by_method["gray"] / "lights.json").write_text("{")
    next((by_method["retinex"] / "views").glob("*.exr")).write_bytes(b"broken")
    words = report_of(run).words
    assert "truth expected a predictions folder with predictions.json" in words
    assert "gray lights: expected" in words
    assert "with SHA-256" in words  # the changed view of retinex


def test_layer_of_another_size_or_with_nan_has_its_reason_in_its_place(make_run: MakeRun) -> None:
    run, record = make_run()
    folder = next(run / r.folder for r in record.results if r.job.method == "retinex") / "predictions"
    found = open_predictions(folder)
    first, second = found.view_names()
    write_view(folder, first, {"normal": np.zeros((4, 5, 3))})
    layers = found.layers(second)
    layers["depth"][14, 12] = np.nan  # where an object is seen
    write_view(folder, second, layers)
    finish_predictions(folder, Predictions(found.method, found.track, found.scene))
    kept = kept_scenes(write_report(run).read_text(encoding="utf-8"))
    reasons = [
        tile.note
        for scene in kept.values()
        for view in (scene.pictures.gallery.views if scene.pictures else ())
        for row in view.rows
        for tile in row.predictions
        if tile.missing == "failed"
    ]
    assert any("expected normal of shape (24, 28, 3), got (4, 5, 3)" in reason for reason in reasons)
    assert any("expected finite values in depth" in reason for reason in reasons)


def test_several_seeds_and_a_part_that_failed(make_run: MakeRun) -> None:
    run, record = make_run(seeds=(0, 1))
    results = tuple(
        replace(r, status="failed", reason="out of memory", sheet=None)
        if (r.job.method, r.job.seed, r.job.track) == ("gray", 1, "tabletop")
        else r
        for r in record.results
    )
    write_json(run / "run.json", replace(record, results=results))
    words = report_of(run).words
    assert "mean over 1 scene × 2 seeds" in words
    assert "1 of 2 scored" in words
    assert "tiny-0000, seed 1: the whole job out of memory" in words


def test_run_where_nothing_failed_and_one_where_nothing_ran(make_run: MakeRun) -> None:
    run, record = make_run()
    whole = tuple(r for r in record.results if r.status == "done")
    write_json(run / "run.json", replace(record, results=whole))
    assert "Nothing failed: every job ran" in report_of(run).words
    write_json(run / "run.json", replace(record, results=(), methods=()))
    assert "12 jobs" not in report_of(run).words


def test_long_list_of_what_a_reference_sees_is_cut(make_run: MakeRun) -> None:
    run, record = make_run()
    sees = tuple(f"layer{i}" for i in range(7))
    methods = tuple(replace(m, sees=sees) if m.name == "truth" else m for m in record.methods)
    write_json(run / "run.json", replace(record, methods=methods))
    found = report_of(run)
    assert "also sees: layer0, layer1, layer2, layer3, layer4 and 2 more" in found.words
    assert found.all("span", title=", ".join(sees))


def test_templates_have_no_handlers_and_no_unsafe_filter() -> None:
    text = "".join(p.read_text(encoding="utf-8") for p in sorted(TEMPLATES.glob("*.j2")))
    assert not re.search(r"\|\s*safe|\son\w+=|style=|javascript:", text)


def test_a_mean_that_lacks_a_scene_says_so_wherever_it_stands(tmp_path: Path) -> None:
    """One row was not run on one of three scenes; it is made up, so no scene has pictures."""
    record = write_made_up(tmp_path, 5, 3, metrics=2)
    left = tuple(r for r in record.results if (r.job.method, r.job.scene) != ("row-4", "scene-2"))
    write_json(tmp_path / "run.json", replace(record, results=left))
    page = opened(write_report(tmp_path).read_text(encoding="utf-8"))
    for name in ("dots", "scores leaderboard"):
        (table,) = re.findall(f'<table class="{name}">.*?</table>', page, re.S)
        (row,) = re.findall(r'<tr data-row="row-4".*?</tr>', table, re.S)
        assert row.count('<span class="note lacks">run on 2 of 3 scenes</span>') == 2
        assert table.count("note lacks") == 2
    outline = Outline(page)
    worst = outline.all("a", **{"class": "worst-cell"})
    assert worst
    assert {str(a["href"])[1:] for a in worst} <= {a.get("id") for _, a in outline.found}


def test_a_run_of_sealed_scenes_names_the_tag_at_the_top_and_in_its_facts(tmp_path: Path) -> None:
    record = write_made_up(tmp_path, 2, 1, metrics=2)
    assert "sealed scenes" not in report_of(tmp_path).words
    edition = Edition("edition-7", "0123456789abcdef" * 2 + "01234567")
    write_json(tmp_path / "run.json", replace(record, edition=edition))
    words = report_of(tmp_path).words
    assert "1 scene, 2 rows, 2 jobs, sealed scenes of edition-7 ·" in words
    assert "rendered after code and claims were fixed by edition-7, commit 0123456789ab" in words
