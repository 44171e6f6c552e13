# SPDX-License-Identifier: Apache-2.0
"""Seeds that suites set aside: scenes in reserve, and scenes under seal."""

from dataclasses import replace
from pathlib import Path

import pytest

from graycard import GraycardError, RecordError
from graycard.benchmarks import load_suite, opened, refuse_sealed, suite_names
from graycard.benchmarks._edition import sealed_in
from graycard.benchmarks._ranges import SceneRange, SceneTemplate
from graycard.benchmarks._run_record import RunError
from graycard.cli import main
from graycard.synth import SceneSpec, scene_name
from tiny_benches import write_reserve_suite

WITH_RANGES = [name for name in suite_names() if load_suite(name).sealed]


def test_kinds_take_turns_and_so_do_their_knobs() -> None:
    kinds = SceneTemplate("dark", "corridor", {"gloss": [0.0, 0.25]}), SceneTemplate("dark", "shelf-room")
    found = SceneRange((501, 505), kinds).drawn()
    assert [(s.family, s.seed, dict(s.knobs)) for s in found] == [
        ("corridor", 501, {"gloss": 0.0}),
        ("shelf-room", 502, {}),
        ("corridor", 503, {"gloss": 0.25}),
        ("shelf-room", 504, {}),
        ("corridor", 505, {"gloss": 0.0}),
    ]


@pytest.mark.parametrize("seeds", [(5, 4), (-1, 3), (990, 1000)])
def test_seeds_of_tuning_never_judge(seeds: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="expected seeds from the first to the last, from 0 to below 1000"):
        SceneRange(seeds, (SceneTemplate("dark", "corridor"),))


def test_a_range_of_nothing() -> None:
    with pytest.raises(ValueError, match="expected one kind of scene or more"):
        SceneRange((1, 2), ())


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("seeds = [501, 510]", "seeds = [1, 10]", "got corridor-0001, shelf-room-0002 in two places"),
        ("seeds = [601, 602]", "seeds = [505, 506]", "from each other, got corridor-0505"),
        ("gloss = [0.0, 0.25]", "gloss = [0.0, 7.0]", "gloss"),
        ('family = "shelf-room" }', 'family = "hall" }', "dark/hall"),
    ],
)  # fmt: skip
def test_a_range_that_cannot_be_kept(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = write_reserve_suite(tmp_path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(GraycardError, match=words):
        load_suite(str(path))


def test_a_suite_of_a_known_name_opens_no_seal() -> None:
    known = load_suite("claims-dark")
    assert known.sealed is not None
    copied = replace(known, sealed=replace(known.sealed, seeds=(990, 999)))
    assert sealed_in(opened(known).scenes[0], copied) == "claims-dark"
    assert sealed_in(opened(copied).scenes[0], copied) == "claims-dark"
    assert not sealed_in(opened(copied).scenes[0], known)


@pytest.mark.parametrize("name", WITH_RANGES)
def test_no_suite_shows_a_scene_that_another_keeps_sealed(name: str) -> None:
    for other in map(load_suite, suite_names()):
        for spec in (*other.scenes, *other.added):
            assert not sealed_in(spec), f"{scene_name(spec)} of {other.name}"
    suite = load_suite(name)
    assert all(sealed_in(spec) for spec in opened(suite).scenes)
    families = {spec.family for spec in suite.scenes}
    assert {spec.family for spec in suite.added} == (families if suite.reserve else set())
    assert {spec.family for spec in opened(suite).scenes} == families


def test_every_suite_of_claims_has_scenes_under_seal() -> None:
    assert {f"claims-{of}" for of in ("dark", "multilight", "tabletop", "matte", "robust")} <= {*WITH_RANGES}


def test_a_suite_without_sealed_scenes_cannot_be_opened() -> None:
    with pytest.raises(RecordError, match="expected a suite with a sealed range, got 'demo'"):
        opened(load_suite("demo"))


def test_knobs_do_not_break_a_seal() -> None:
    spec = opened(load_suite("claims-dark")).scenes[0]
    with pytest.raises(RunError, match="which suite 'claims-dark' keeps for code that was tagged before"):
        refuse_sealed([SceneSpec("dark", spec.family, spec.seed, {"gloss": 0.7})])
    refuse_sealed([SceneSpec("tabletop", "glossy-table", 801)])


def test_sealed_scenes_are_not_rendered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "data")
    spec = opened(load_suite("claims-dark")).scenes[0]
    command = ["render", "dark", "--family", spec.family, "--seed", str(spec.seed), "--out", out]
    assert main(command) == 2
    said = capsys.readouterr().err
    assert f"got {spec.family}-{spec.seed:04d}, which suite 'claims-dark' keeps" in said
    assert "graycard bench claims-dark --sealed" in said
    path = write_reserve_suite(tmp_path)
    path.write_text(path.read_text().replace("seed = 1\n", f"seed = {spec.seed}\n", 1))
    assert main(["render", str(path), "--out", out]) == 2
    assert main(["bench", str(path), "--out", out]) == 2
    assert capsys.readouterr().err.count("keeps for code that was tagged before") == 2
    assert not Path(out).exists()
