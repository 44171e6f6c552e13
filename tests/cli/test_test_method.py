# SPDX-License-Identifier: Apache-2.0
"""The verb that checks a method: what it says of faults, of commands, and of options that do not fit."""

import json
from pathlib import Path

import pytest

from command_scripts import MEAN, write_script
from graycard.cli import main
from graycard.cli.kit._verbs import _settings_in
from kit_here import checked_here

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenes")


@pytest.fixture(autouse=True)
def in_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, dataset: Path) -> None:
    (tmp_path / "tmp").mkdir()
    checked_here(monkeypatch, tmp_path / "tmp", dataset)


def test_a_sound_method_has_no_fault(capsys: Capture, tmp_path: Path):
    options = ["--settings", "reflectance=0.3", "--json", str(tmp_path / "a.json")]
    assert main(["test-method", "gray", *options]) == 0
    said = capsys.readouterr().out
    assert "test-method: gray: no faults in" in said
    assert "fitted on dark with reflectance = 0.3; renders base_color, normal, radiance" in said
    assert json.loads((tmp_path / "a.json").read_text())["result"]["faults"] == []


def test_a_fault_is_shown_with_its_mend_and_its_line(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    made = Path(__file__).parents[2] / "benchmarks" / "kit" / "template" / "method.py.txt"
    text = made.read_text().replace("pixels = []", "pixels = [1 / 0]")
    (tmp_path / "my_broken.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["test-method", "my_broken:DemoMethod"]) == 1
    said = capsys.readouterr().out
    assert "fault fit: its fit fails" in said
    assert "pixels = [1 / 0]" in said
    assert "mend: Mend the lines that are shown" in said
    assert "1 fault in" in said


COMMAND = ["test-method", "python infer.py {capture} {out} 1.0", "--input", "arrays", "--map"]


def test_a_command_is_checked(capsys: Capture, tmp_path: Path):
    write_script(tmp_path, MEAN)
    options = ["base_color=albedo/{view}.npy:linear", "--folder", str(tmp_path)]
    assert main([*COMMAND, *options]) == 0
    assert "no faults" in capsys.readouterr().out
    write_script(tmp_path, MEAN.replace("print(", "raise SystemExit('no weights here')\nprint("))
    assert main([*COMMAND, *options]) == 1
    said = capsys.readouterr().out
    assert "fault command: the command fails" in said
    assert "no weights here" in said


FAULTY = {
    "seed": MEAN.replace("colour = [mean", "import time\ncolour = [(time.time() % 1) * mean"),
    "outputs": MEAN.replace("for view in index", "for view in index[:0] or index")
    .replace('index[:0] or index["views"]', 'index["views"][1:]'),
    "range": MEAN.replace('* index["exposure"]', "* 1000"),
}  # fmt: skip


@pytest.mark.parametrize("wanted", FAULTY)
def test_faults_of_commands_are_named(wanted: str, capsys: Capture, tmp_path: Path):
    write_script(tmp_path, FAULTY[wanted])
    assert main([*COMMAND, "base_color=albedo/{view}.npy:linear", "--folder", str(tmp_path)]) == 1
    said = capsys.readouterr().out
    assert [line.split()[1] for line in said.splitlines() if line.startswith("fault ")] == [f"{wanted}:"]


WRONG = {
    "unknown": (["no-such-method"], "method"),
    "option": (["gray", "--python", "x"], "--python with a command"),
    "input": (["gray", "--input", "arrays"], "--input with a command"),
    "setting": (["gray", "--settings", "reflectance"], "NAME=VALUE"),
    "priors": (["python x.py {out}", "--priors", "classical"], "no --priors"),
    "placeholder": (["python x.py {out} {steps}"], "{steps}"),
    "interpreter": (["python x.py {out}", "--python", "no/such"], "interpreter"),
    "timeout": (["gray", "--timeout", "0"], "--timeout"),
}


@pytest.mark.parametrize("fault", WRONG)
def test_what_does_not_fit_is_refused(fault: str, capsys: Capture):
    args, words = WRONG[fault]
    assert main(["test-method", *args]) == 2
    assert words in capsys.readouterr().err


def test_settings_are_read_as_in_a_suite():
    texts = ["steps=3", "rate=0.5", "name=plain", 'quoted="x"', "on=true", "list=[1, 2]"]
    assert _settings_in(texts) == {
        "steps": 3, "rate": 0.5, "name": "plain", "quoted": "x", "on": True, "list": [1, 2],
    }  # fmt: skip
