# SPDX-License-Identifier: Apache-2.0
"""Suites as they are read."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from graycard import TRACKS, GraycardError, RecordError, UnknownNameError
from graycard.benchmarks import Part, Suite, load_suite, narrow, suite_names
from graycard.benchmarks._suites import SuiteMethod
from graycard.benchmarks.planning._plan import part_of_plan
from graycard.synth import CaptureSettings, RenderSettings, family_of

SUITE = """
name = "mine"
version = 1
title = "Mine"
{more}
[render]
samples = 64
[[scenes]]
track = "dark"
family = "corridor"
seed = 1000
[[scenes]]
track = "multilight"
family = "studio"
seed = 1000
[[methods]]
name = "gray"
"""


def written(folder: Path, more: str = "") -> str:
    path = folder / "mine.toml"
    path.write_text(SUITE.format(more=more))
    return str(path)


TRACK_OF = {"claims-matte": "tabletop", "claims-robust": "tabletop"}


@cache
def views_built(family: Any, train: int, test: int, seed: int = 1000) -> int:
    """Return the number of views of a scene once it is built."""
    return len(family.build(seed, RenderSettings(8, 8, train, test)).views)


@pytest.mark.xdist_group("suites")  # a worker that has built a scene knows its views
@pytest.mark.parametrize("own_seeds", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", suite_names())
def test_every_suite_that_comes_along_can_be_built(name: str, own_seeds: bool) -> None:
    """A scene of each family is built, and each with its own knobs and seed where there is time."""
    suite = load_suite(name)
    tracks = {scene.track for scene in suite.scenes}
    of_one = TRACK_OF.get(name) or name.partition("-")[2].partition("-")[0]
    assert tracks == (set(TRACKS) if "-" not in name else {of_one})
    for scene in suite.scenes:
        is_tuning = scene.seed >= 1000  # such scenes judge nothing
        assert is_tuning == (
            name.startswith(("noise-", "convergence-", "paper-", "sizes-")) or name.endswith("-hd")
        )
        settings = suite.render_of(scene)
        counts, family = (settings.train_views, settings.test_views), family_of(scene)
        built = (
            views_built(family, *counts, scene.seed) if own_seeds else views_built(type(family)(), *counts)
        )
        assert built == settings.views


@pytest.mark.parametrize(
    ("name", "track"), [*((f"claims-{t}", t) for t in TRACKS), ("claims-robust", "tabletop")]
)
def test_claims_of_a_track_are_tried_on_the_scenes_of_all_claims(name: str, track: str) -> None:
    """One dataset then serves both: scenes, pictures and noise ceilings are the same."""
    one, every = load_suite(name), load_suite("claims")
    scenes = [scene for scene in every.scenes if scene.track == track]
    assert list(one.scenes) == scenes
    assert [one.render_of(s) for s in scenes] == [every.render_of(s) for s in scenes]
    assert one.ceilings == {track: every.ceilings[track]}


def test_bounds_are_looked_for_on_scenes_that_judge() -> None:
    bounds, judging = load_suite("bounds-tabletop"), load_suite("claims-tabletop")
    assert all(scene in judging.scenes for scene in bounds.scenes)
    assert [bounds.render_of(s) for s in bounds.scenes] == [judging.render_of(s) for s in bounds.scenes]
    rows = {method.row: method for method in judging.methods}
    assert all(method == rows[method.row] for method in bounds.methods if method.row in rows)


def test_a_track_and_a_family_may_have_samples_of_their_own(tmp_path: Path) -> None:
    suite = load_suite(written(tmp_path, "samples = {multilight = 256, corridor = 16}"))
    dark, many = (suite.render_of(scene) for scene in suite.scenes)
    assert (dark.samples, many.samples) == (16, 256)
    both = load_suite(written(tmp_path, "samples = {multilight = 256, studio = 144}"))
    assert both.render_of(both.scenes[1]).samples == 144
    assert (dark.width, dark.max_depth) == (many.width, many.max_depth)


def test_samples_of_a_track_that_does_not_exist_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'dark'"):
        load_suite(written(tmp_path, "samples = {drak = 256}"))


def test_ceilings_of_a_track_that_does_not_exist_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'dark'"):
        load_suite(written(tmp_path, "ceilings = {drak = 45}"))


def test_samples_that_are_not_four_squares_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="4 times a square"):
        load_suite(written(tmp_path, "samples = {dark = 50}"))


def test_a_suite_may_ask_for_a_camera_with_faults(tmp_path: Path) -> None:
    path = Path(written(tmp_path))
    faults = "samples = 64\n[render.capture]\nbits = 8\nshot_noise = 8000"
    path.write_text(path.read_text().replace("samples = 64", faults))
    suite = load_suite(str(path))
    assert suite.render_of(suite.scenes[0]).capture == CaptureSettings(bits=8, shot_noise=8000)


def test_a_baseline_is_not_made_stricter_than_its_metrics(tmp_path: Path) -> None:
    path = Path(written(tmp_path))
    path.write_text(path.read_text() + "slack = 0.5\n")
    with pytest.raises(RecordError, match="slack of 1 or more for gray, got 0.5"):
        load_suite(str(path))


def test_a_part_of_a_suite_is_named_by_rows_or_by_methods() -> None:
    suite = load_suite("claims-dark")

    def rows(*names: str) -> list[str]:
        return [method.row for method in narrow(suite, methods=names).methods]

    assert rows("darkgs", "darkgs-2", "darkgs") == ["darkgs", "darkgs-2"]
    assert rows("mine:Own") == ["mine:Own"]
    assert rows() == [method.row for method in suite.methods]
    named = [SuiteMethod("gray", label="a"), SuiteMethod("gray", label="b"), SuiteMethod("input")]
    suite = replace(suite, methods=tuple(named))
    assert rows("gray") == ["a", "b"]  # no row has the name of the method
    assert rows("b", "gray") == ["b", "a"]


TRACKED = """
[[methods]]
name = "2dgs"
tracks = ["tabletop"]
"""


def two_tracks(folder: Path, more: str = TRACKED) -> Path:
    """Write a suite with a scene on two tracks, and a row that runs on one of them."""
    path = Path(written(folder))
    scene = '\n[[scenes]]\ntrack = "tabletop"\nfamily = "glossy-table"\nseed = 1\n'
    path.write_text(path.read_text() + scene + more)
    return path


def fits_of(suite: Suite, scenes: slice = slice(None)) -> list[tuple[str, str, int]]:
    """Return the fits on some scenes of a suite, in order."""
    return [
        (scene.track, method.row, seed)
        for scene in suite.scenes[scenes]
        for method in suite.rows_on(scene.track)
        for seed in suite.seeds
    ]


def test_a_row_may_run_on_some_tracks(tmp_path: Path) -> None:
    suite = load_suite(str(two_tracks(tmp_path)))
    own = [method.row for method in suite.methods]
    assert [method.row for method in suite.rows_on("tabletop")] == own
    assert [method.row for method in suite.rows_on("dark")] == [row for row in own if row != "2dgs"]
    assert "2dgs" not in [method.row for method in narrow(suite, ["dark"]).methods]
    assert [method.row for method in narrow(suite, ["tabletop"], ["2dgs"]).methods] == ["2dgs"]


def test_a_row_that_runs_on_none_of_the_tracks_is_refused(tmp_path: Path) -> None:
    suite = load_suite(str(two_tracks(tmp_path)))
    with pytest.raises(RecordError, match="expected rows that run on dark, got 2dgs, which runs on tabletop"):
        narrow(suite, ["dark"], ["2dgs"])
    with pytest.raises(GraycardError, match="did you mean 'tabletop'"):
        load_suite(str(two_tracks(tmp_path, TRACKED.replace('"tabletop"', '"tabeltop"'))))


@pytest.mark.parametrize("parts", [1, 2, 3, 5])
def test_parts_of_a_suite_with_rows_of_some_tracks_are_all_fits_once(tmp_path: Path, parts: int) -> None:
    suite = load_suite(str(two_tracks(tmp_path)))
    found = []
    for number in range(1, parts + 1):
        scenes, own = part_of_plan(suite, Part(number, parts))
        found += fits_of(suite, scenes)[own]
    assert found == fits_of(suite)


def test_the_demo_has_a_method_of_each_track_beside_simple_ones() -> None:
    suite = load_suite("demo")
    own = {track: [m.row for m in suite.rows_on(track) if m.tracks] for track in TRACKS}
    assert own == {"dark": ["sunfaded"], "tabletop": ["goris", "removal"], "multilight": ["gsid"]}
    assert [m.row for m in suite.methods if not m.tracks] == ["truth", "gray", "input", "retinex", "2dgs"]


SWEPT = """
[[methods]]
name = "2dgs"
settings = { iterations = 1000, surfels = 5000 }
sweep = { iterations = [500, 1000, 2000], surfels = [2500] }
"""


def test_a_sweep_adds_a_row_for_each_value(tmp_path: Path) -> None:
    path = Path(written(tmp_path))
    path.write_text(path.read_text() + SWEPT)
    rows = {method.row: method.settings for method in load_suite(str(path)).methods if method.name == "2dgs"}
    assert rows == {
        "2dgs": {"iterations": 1000, "surfels": 5000},
        "2dgs-iterations-500": {"iterations": 500, "surfels": 5000},
        "2dgs-iterations-2000": {"iterations": 2000, "surfels": 5000},
        "2dgs-surfels-2500": {"iterations": 1000, "surfels": 2500},
    }


@pytest.mark.parametrize(
    ("sweep", "message"),
    [
        ("{ iterations = 500 }", "expected sweep = .* for 2dgs in .*, got"),
        ('{ iterations = ["500"] }', "expected sweep = .* for 2dgs in .*, got"),
        ("[500, 1000]", "expected sweep = .* for 2dgs in .*, got"),
        (
            "{ fill = [0.5] }",
            "expected settings of 2dgs in .* to name what its sweep varies, got none for fill",
        ),
    ],
)
def test_a_sweep_that_is_none_is_refused(tmp_path: Path, sweep: str, message: str) -> None:
    path = Path(written(tmp_path))
    swept = SWEPT.replace("{ iterations = [500, 1000, 2000], surfels = [2500] }", sweep)
    path.write_text(path.read_text() + swept)
    with pytest.raises(RecordError, match=message):
        load_suite(str(path))


@pytest.mark.parametrize("track", TRACKS)
def test_convergence_is_looked_for_on_scenes_that_do_not_judge(track: str) -> None:
    suite = load_suite(f"convergence-{track}")
    assert {scene.track for scene in suite.scenes} == {track}
    assert all(scene.seed >= 1000 for scene in suite.scenes)
    assert len(suite.scenes) >= 3
