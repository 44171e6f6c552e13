# SPDX-License-Identifier: Apache-2.0
"""Misspelt verbs and options are met with what was meant, before anything heavy is loaded."""

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import pytest
import tyro

from graycard import GraycardError
from graycard.cli import main
from graycard.cli._options import given_options, near_option, option_names, parse_settings, refuse
from graycard.cli._parse import parse_verb
from graycard.cli._table import VERBS, Verb, find_verb
from graycard.methods import listings, load_method
from graycard.synth import RenderSettings

Capture = pytest.CaptureFixture[str]


@dataclass(frozen=True)
class Lens:
    """A part with settings of its own."""

    focal_length: float = 35.0


@dataclass(frozen=True)
class Sample:
    """Options of every kind."""

    folder: Annotated[Path, tyro.conf.Positional]
    hold_out: int = 8
    check: bool = True
    lens: Lens = field(default_factory=Lens)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["benhc", "demo"], "got 'benhc' (did you mean 'bench'?)"),
        (["chek-result", "x"], "did you mean 'check-result'"),
        (["--verson"], "expected options of `graycard`, got --verson (did you mean --version?)"),
        (["--hlep"], "did you mean --help?"),
        (["doctor", "--jsn", "x"], "got --jsn (did you mean --json?). See `graycard doctor --help`"),
        (["verify", "data", "--no-rendr"], "did you mean --no-render?"),
        (["gate", "x", "--baseline=b", "--wrte"], "did you mean --write?"),
        (["import", "a", "--trak", "dark"], "did you mean --track?"),
        (["score", "a", "b", "--xyzzy"], "got --xyzzy. See `graycard score --help`"),
        (["doctor", "x"], "expected options of `graycard doctor`, got x. See"),
        (["render", "dark", "--outt", "x"], "options of `graycard render`, got --outt (did you mean --out?)"),
        (["render", "dark", "--out", "x", "--sed", "3"], "got --sed 3 (did you mean --seed?)"),
        (["render", "dark", "--out", "x", "--widht", "3"], "did you mean --width?"),
        (["render", "dark", "--out", "x", "--capture.bit", "8"], "did you mean --capture.bits?"),
        (["render", "demo", "--out", "x", "--width", "3"], "options of `graycard render`, got --width 3"),
        (["fit", "gray", "x", "--ou", "y"], "did you mean --out?"),
        (["fit", "gray", "{scene}", "--out", "{tmp}/p", "--sed", "3"], "did you mean --seed?"),
        (["fit", "gray", "{scene}", "--out", "{tmp}/p", "--reflectnce", "1"], "did you mean --reflectance?"),
    ],
)  # fmt: skip
def test_a_misspelt_word_is_met_with_the_one_that_was_meant(
    args: list[str], message: str, tiny_scenes: dict[str, Path], tmp_path: Path, capsys: Capture
):
    assert main([arg.format(scene=tiny_scenes["dark"], tmp=tmp_path) for arg in args]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "p").exists()


def test_options_are_named_as_tyro_names_them():
    assert option_names(Sample) == ["--hold-out", "--check", "--no-check", "--lens.focal-length"]


def shown_options(capsys: Capture) -> set[str]:
    """Return the options in the left column of a help."""
    rows = re.findall(r"^[│ ] (--?\S.*?)(?:  |│|$)", capsys.readouterr().out, re.M)
    return {name for row in rows for name in re.findall(r"--[a-z][\w.-]*", row)} - {"--help"}


@pytest.mark.parametrize("verb", VERBS, ids=[verb.name for verb in VERBS])
def test_the_options_of_a_verb_are_those_of_its_help(verb: Verb, capsys: Capture):
    main([verb.name, "--help"])
    assert shown_options(capsys) == {*option_names(verb.load())}


def test_the_options_of_settings_are_those_of_their_help(capsys: Capture):
    settings = [load_method(row.name).settings_type for row in listings() if row.summary]
    assert len(settings) > 5
    for kind in (*settings, RenderSettings, Sample):
        with pytest.raises(SystemExit, match="0"):
            tyro.cli(kind, args=["--help"])
        assert shown_options(capsys) == {*option_names(kind)}, kind


@pytest.mark.parametrize(
    ("args", "options"),
    [
        (["a", "--hold-out", "-3", "--hold_out=-4", "-1e-3"], ["--hold-out", "--hold-out"]),
        (["--holdout", "a-b", "--check", "-x"], ["--holdout", "--check", "-x"]),
    ],
)
def test_a_number_below_0_is_a_value_not_an_option(args: list[str], options: list[str]):
    assert given_options(args) == options


def test_a_setting_is_not_taken_for_an_option_that_is_there():
    """``--outs`` is near ``--out``, but that is given: only the method knows if it is a setting."""
    command, rest = parse_verb(find_verb("fit"), ["gray", "scene", "--out=p", "--outs", "3"])
    assert (command.out, rest) == (Path("p"), ["--outs", "3"])


def test_what_is_like_nothing_is_near_nothing():
    assert near_option("--hodl_out", option_names(Sample)) == "--hold-out"
    assert near_option("--xyzzy", option_names(Sample)) is None


def test_every_misspelt_option_is_met():
    with pytest.raises(
        GraycardError, match=r"got --hodl-out 3 --chek \(did you mean --hold-out and --check\?\)"
    ):
        refuse(["--hodl-out", "3", "--chek"], "graycard sample", option_names(Sample))
    refuse([], "graycard sample", [])


def test_settings_are_parsed_or_refused():
    verb = find_verb("fit").load()
    assert parse_settings(Lens, ["--focal-length", "50"], "graycard fit lens", verb) == Lens(50.0)
    with pytest.raises(GraycardError, match="expected options of `graycard fit lens`, got 7. See"):
        parse_settings(Lens, ["7"], "graycard fit lens", verb)
    with pytest.raises(GraycardError, match="expected a number after --focal-length, got 'far'"):
        parse_settings(Lens, ["--focal-length", "far"], "graycard fit lens", verb)
    with pytest.raises(SystemExit, match="2"):
        parse_settings(Lens, ["--focal-length"], "graycard fit lens", verb)


@pytest.mark.parametrize("options", [["--hold_out", "0"], ["--hold-out=0"]])
def test_underscores_and_equals_signs_are_understood(options: list[str], tmp_path: Path, capsys: Capture):
    args = ["import", str(tmp_path / "none"), "--track", "dark", "--scene", "x", "--out", str(tmp_path / "d")]
    assert main([*args, *options]) == 2
    assert "got nothing" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("export s --format colmp --out q", "expected a value of --format that exists, got 'colmp' (did you"),
        ("export s --format=crossant --out q", "(did you mean 'croissant'?)"),
        ("report r --summary junti", "(did you mean 'junit'?)"),
        ("salt nwe x", "that exists, got 'nwe' (did you mean 'new'?)"),
        ("completion bsh", "(did you mean 'bash'?)"),
        ("speed enginee", "(did you mean 'engine'?)"),
        ("import f --track dark --scene x --out d --mask-object blak", "(did you mean 'black'?)"),
    ],
)
def test_a_misspelt_choice_is_met(command: str, said: str, capsys: Capture):
    assert main(command.split()) == 2
    assert said in capsys.readouterr().err


def test_a_misspelt_scene_is_met(tmp_path: Path, capsys: Capture):
    for scene in ("corridor-0001", "corridor-0002"):
        (tmp_path / "dark" / scene / "capture").mkdir(parents=True)
        (tmp_path / "dark" / scene / "capture" / "manifest.json").write_text("{}")
    assert main(["score", "p", str(tmp_path / "dark" / "coridor-0002")]) == 2
    assert "got 'coridor-0002' (did you mean 'corridor-0002'?)" in capsys.readouterr().err


def test_every_json_has_a_format_and_its_version(tmp_path: Path, capsys: Capture):
    """A record has its own; all else lies in one shell, with the verb that wrote it."""
    out = tmp_path / "j.json"
    for command in (["scenes"], ["methods", "gray"], ["doctor"], ["weights"], ["adopt", "--layouts"]):
        assert main([*command, "--json", str(out)]) == 0
        found = json.loads(out.read_text())
        assert list(found) == ["verb", "result", "graycard", "format", "format_version"]
        assert (found["verb"], found["format"], found["format_version"]) == (command[0], "graycard-output", 1)
    assert main(["claims", "--json", str(out)]) == 0
    assert json.loads(out.read_text())["format"] == "graycard-claims"
    capsys.readouterr()


def test_each_verb_that_shows_something_takes_json():
    pages = {"report", "figure", "view", "turntable", "splat", "salt", "completion"}
    silent = {"new-method", "site", "train-prior"}
    lacking = {verb.name for verb in VERBS if "--json" not in option_names(verb.load())}
    assert lacking == pages | silent
