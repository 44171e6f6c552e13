# SPDX-License-Identifier: Apache-2.0
"""The table of verbs and the help: complete, readable at 80 columns, and free of heavy imports."""

import io
import re
import shlex
import shutil
import signal
import subprocess
import sys
from itertools import groupby
from pathlib import Path
from typing import get_args

import pytest
from rich.console import Console

from graycard.cli import main
from graycard.cli._main import CUT_OFF, ERROR
from graycard.cli._overview import EXIT_CODES, overview
from graycard.cli._parse import parse_verb
from graycard.cli._table import VERBS, Group, Verb, find_verb
from graycard.cli._terminal import FAILED, OK, Terminal

ROOT = Path(__file__).parents[2]
NAMES = [verb.name for verb in VERBS]
HEAVY = ("torch", "mitsuba", "drjit", "numba", "skimage", "scipy", "cv2", "colour", "jinja2", "tyro")
STAGES = ("synth", "methods", "eval", "benchmarks", "reports")
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")


def sections() -> dict[str, list[str]]:
    """Return the lines below each heading of the help."""
    parts = (part.splitlines() for part in overview().split("\n\n"))
    return {lines[0]: lines[1:] for lines in parts}


def test_each_verb_is_in_one_group():
    assert len({*NAMES}) == len(NAMES)
    assert [group for group, _ in groupby(VERBS, key=lambda verb: verb.group)] == [*get_args(Group)]
    listed = [line.split()[0] for group in get_args(Group) for line in sections()[group]]
    assert listed == NAMES


def test_the_verbs_of_developers_come_last():
    assert NAMES[-4:] == ["speed", "bounds", "train-prior", "prior-errors"]
    assert sections()["for developers of graycard"][0].split()[0] == "speed"


def test_the_help_has_one_line_a_verb():
    for verb in VERBS:
        assert len(verb.help) <= 64, verb.help
        assert f"  {verb.name:12}  {verb.help}" in overview().splitlines()
    assert max(map(len, overview().splitlines())) <= 80


def test_the_help_has_one_table_of_exit_codes():
    table = "\n".join(sections()["exit codes"])
    assert [int(code) for code in re.findall(r"^  (\d+) ", table, re.M)] == [*EXIT_CODES]
    stopped, ended = 128 + signal.SIGINT, 128 + signal.SIGTERM
    assert {OK, FAILED, ERROR, CUT_OFF, stopped, ended} == {*EXIT_CODES}


@pytest.mark.parametrize("asked", ["-h", "--help"])
def test_the_help_is_what_was_asked_for(asked: str, capsys: Capture):
    assert main([asked]) == 0
    assert capsys.readouterr().out == overview() + "\n"


def test_no_verb_is_answered_by_the_help_and_exit_code_2(capsys: Capture):
    assert main([]) == 2
    said = capsys.readouterr()
    assert said.err == overview() + "\n"
    assert said.out == ""


def test_the_help_imports_no_stage():
    """Neither a stage nor a library that only stages need: each would be waited for."""
    code = "import sys; from graycard.cli import main; main(['--help']); print(*sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    loaded = {*shown.splitlines()[-1].split()}
    assert "graycard.cli._overview" in loaded
    assert not loaded & {*HEAVY, *(f"graycard.{stage}" for stage in STAGES)}


@pytest.mark.parametrize("args", [["benhc"], ["doctor", "--jsn", "x"], ["score", "--help"]])
def test_mistakes_and_help_import_no_stage(args: list[str]):
    code = f"import sys; from graycard.cli import main; main({args}); print(*sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    loaded = {*shown.splitlines()[-1].split()}
    assert not loaded & {*HEAVY, *(f"graycard.{stage}" for stage in STAGES)} - {"tyro"}


def test_a_verb_is_imported_alone():
    code = "import sys; from graycard.cli._table import VERBS; VERBS[-5].load(); print(*sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    modules = {verb.module for verb in VERBS}
    assert (
        {m for m in modules if f"graycard.cli.{m}" in shown.split()}
        == {VERBS[-5].module}
        == {"machine._doctor"}
    )


@pytest.mark.parametrize("verb", VERBS, ids=NAMES)
def test_the_example_of_a_verb_parses(verb: Verb):
    graycard, name, *args = shlex.split(verb.example)
    assert (graycard, name) == ("graycard", verb.name)
    command, rest = parse_verb(verb, args)
    assert type(command) is verb.load()
    assert rest == []


def test_an_example_with_a_fault_does_not_parse():
    with pytest.raises(SystemExit, match="2"):
        parse_verb(find_verb("score"), ["mine"])


@pytest.mark.parametrize("verb", VERBS, ids=NAMES)
def test_the_classes_of_verbs_have_one_suffix(verb: Verb):
    name = "".join(word.capitalize() for word in verb.name.split("-")) + "Command"
    assert verb.load().__name__ == name


@pytest.mark.parametrize("verb", VERBS, ids=NAMES)
@pytest.mark.usefixtures("narrow")
def test_the_help_of_a_verb_begins_with_an_example(verb: Verb, capsys: Capture):
    assert main([verb.name, "--help"]) == 0
    example, purpose, usage = capsys.readouterr().out.split("\n\n")[:3]
    assert example == f"example: {verb.example}"
    assert " ".join(purpose.split()) == " ".join((verb.load().__doc__ or "").split())
    assert usage.startswith(f"usage: graycard {verb.name} [-h]")


@pytest.mark.parametrize("verb", VERBS, ids=NAMES)
@pytest.mark.usefixtures("narrow")
def test_the_help_of_a_verb_fits_80_columns(verb: Verb, capsys: Capture):
    assert main([verb.name, "--help"]) == 0
    shown = capsys.readouterr().out
    assert [line for line in shown.splitlines() if len(line) > 80 and not line.startswith("usage: ")] == []
    assert "default: None" not in shown
    assert "{None}" not in shown


@pytest.mark.parametrize("args", [["gray", "--help"], ["-h", "gray"], ["gray", "scene", "--out", "p", "-h"]])
@pytest.mark.usefixtures("narrow")
def test_the_help_of_a_fit_ends_with_the_settings_of_its_method(args: list[str], capsys: Capture):
    assert main(["fit", *args]) == 0
    own, settings = capsys.readouterr().out.split("Options of `graycard fit gray` that may follow:")
    assert "--priors" in own
    assert "--reflectance" not in own
    assert "--reflectance FLOAT" in settings
    assert "--priors" not in settings


def test_the_help_of_a_fit_without_a_method_shows_its_own_options(capsys: Capture):
    for args in (["--help"], ["--out", "p", "--help"]):
        assert main(["fit", *args]) == 0
        assert "may follow:" not in capsys.readouterr().out


def test_the_help_of_a_fit_of_no_method_says_so(capsys: Capture):
    assert main(["fit", "retinx", "--help"]) == 2
    said = capsys.readouterr()
    assert "did you mean 'retinex'" in said.err
    assert said.out == ""


def test_the_help_of_a_rendering_shows_the_settings_of_a_track_alone(capsys: Capture):
    assert main(["render", "dark", "--help"]) == 0
    assert "--capture.bits" in capsys.readouterr().out
    assert main(["render", "demo", "--help"]) == 0
    assert "--capture.bits" not in capsys.readouterr().out


def test_a_completion_knows_every_verb(capsys: Capture):
    with pytest.raises(SystemExit) as ended:
        main(["--tyro-print-completion", "bash"])
    assert not ended.value.code
    shown = capsys.readouterr().out
    assert all(name in shown for name in NAMES)


COMPLETE = """
source "$1"
COMP_WORDS=({words}) COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
"$(complete -p graycard | sed 's/.*-F \\([^ ]*\\).*/\\1/')" graycard "${{COMP_WORDS[$COMP_CWORD]}}" ""
printf '%s\n' "${{COMPREPLY[@]}}"
"""


@pytest.mark.parametrize(
    ("words", "found"),
    [("graycard gat", "gate"), ("graycard gate --basel", "--baseline"), ("graycard compl", "completion")],
)
def test_bash_completes_verbs_options_and_values(words: str, found: str, tmp_path: Path, capsys: Capture):
    if shutil.which("bash") is None:
        pytest.skip("no bash on this machine")
    assert main(["completion", "bash"]) == 0
    (tmp_path / "graycard.bash").write_text(capsys.readouterr().out)
    command = ["bash", "-c", COMPLETE.format(words=words), "complete", str(tmp_path / "graycard.bash")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert found in done.stdout.split(), done.stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_has_its_completion(shell: str, capsys: Capture):
    assert main(["completion", shell]) == 0
    shown = capsys.readouterr()
    assert all(name in shown.out for name in NAMES)
    assert shown.err == ""


def test_what_a_method_says_of_its_progress_is_no_markup():
    """A tag that closes nothing would end the bench."""
    shown = io.StringIO()
    with Terminal(err=Console(file=shown, force_terminal=True, width=80)).progress("suite x") as report:
        report(0.5, "[/red] [bold]half[/bold]")
    assert "[/red] [bold]half[/bold]" in shown.getvalue()


def test_help_of_settings_leaves_out_what_code_raises(narrow: None, capsys: Capture):
    assert main(["render", "dark", "--help"]) == 0
    shown = capsys.readouterr().out
    assert "Render settings." in shown
    assert "Raises" not in shown
