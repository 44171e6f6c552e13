# SPDX-License-Identifier: Apache-2.0
"""Code of the docs: every command parses, every block is of its language, and examples run as they stand."""

import ast
import json
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import tyro

from graycard import open_predictions
from graycard.benchmarks.claims import load_claims
from graycard.cli import main
from graycard.cli._parse import parse_verb
from graycard.cli._runs import FitCommand
from graycard.cli._table import VERBS, find_verb
from graycard.eval import registry
from graycard.eval.protocols import PsnrProtocol
from graycard.methods import load_method
from graycard.methods.priors import parse_priors
from graycard.synth import RenderSettings
from prose import ROOT, pages

LANGUAGES = {"sh", "python", "toml", "json", "text", "yaml", "html"}
OWN = {"median:Median", "mine:Method"}
"""Methods that the reader is asked to write."""
Capture = pytest.CaptureFixture[str]


@dataclass(frozen=True)
class Block:
    """A code block of a page."""

    page: str
    number: int
    language: str
    text: str

    @property
    def commands(self) -> list[str]:
        """Commands of graycard in it, comments and continued lines as a shell takes them."""
        lines = self.text.replace("\\\n", " ").splitlines()
        found = [line.partition(" #")[0].strip() for line in lines]
        return [line for line in found if line.startswith("graycard ")]


def blocks() -> list[Block]:
    """Return the code blocks of all pages."""
    found = []
    for path in pages():
        text = path.read_text(encoding="utf-8")
        fences = re.findall(r"^[ ]*```([\w-]*)\n(.*?)^[ ]*```", text, re.MULTILINE | re.DOTALL)
        found += [Block(str(path.relative_to(ROOT)), n, *fence) for n, fence in enumerate(fences)]
    return found


BLOCKS = blocks()
COMMANDS = [(block.page, command) for block in BLOCKS for command in block.commands]


def block_of(page: str, language: str, begin: str = "") -> str:
    """Return the first block of a page in a language that begins so."""
    return next(
        b.text
        for b in BLOCKS
        if b.page == f"docs/{page}" and b.language == language and b.text.startswith(begin)
    )


def fault_of(command: str) -> str:
    """Return what is wrong with a command; empty if the command line takes it."""
    _, name, *args = shlex.split(command)
    if name == "--help":
        return ""
    try:
        parsed, rest = parse_verb(find_verb(name), args)
        if isinstance(parsed, FitCommand) and parsed.method not in OWN:  # what is left is for the method
            tyro.cli(load_method(parsed.method).settings_type, args=rest)
    except (Exception, SystemExit) as cause:
        return f"{command}: {cause}"
    return ""


@pytest.mark.parametrize(("page", "command"), COMMANDS, ids=lambda text: text[:60])
def test_every_command_parses(page: str, command: str):
    assert fault_of(command) == "", page


def test_the_pages_name_most_verbs():
    assert len(COMMANDS) > 60
    named = {command.split()[1] for _, command in COMMANDS}
    assert len(named & {verb.name for verb in VERBS}) > len(VERBS) / 2


@pytest.mark.parametrize(
    "command", ["graycard benhc demo", "graycard score", "graycard fit gray a --out b --x 1"]
)
def test_a_wrong_command_is_seen(command: str):
    assert fault_of(command)


def fault_of_block(language: str, text: str) -> str:
    """Return why a text is not of its language; empty if it is."""
    try:
        if language == "python":
            ast.parse(text)
        elif language == "toml":
            tomllib.loads(text)
        elif language == "json":
            json.loads(text)
    except ValueError as cause:
        return str(cause)
    except SyntaxError as cause:
        return str(cause)
    return ""


@pytest.mark.parametrize("block", BLOCKS, ids=lambda b: f"{b.page}-{b.number}")
def test_every_block_is_of_its_language(block: Block):
    assert block.language in LANGUAGES, f"{block.page}: name the language of {block.text[:40]!r}"
    assert fault_of_block(block.language, block.text) == ""


@pytest.mark.parametrize(("language", "text"), [("python", "x = ("), ("toml", "a = "), ("json", "{")])
def test_a_wrong_block_is_seen(language: str, text: str):
    assert fault_of_block(language, text)


def test_the_method_of_the_tutorial_works(make_scene: Callable[..., Path], tmp_path: Path):
    (tmp_path / "median.py").write_text(block_of("tutorials/your-method.md", "python"))
    scene = make_scene()
    graycard = Path(sys.executable).with_name("graycard")  # the console script, from the working directory
    fit = [str(graycard), "fit", "median:Median", str(scene), "--out", "p", "--save", "d"]
    subprocess.run(fit, cwd=tmp_path, check=True, capture_output=True)
    assert main(["score", str(tmp_path / "p"), str(scene)]) == 0


FORMATS = "reference/formats.md"


def python_of_formats(number: int) -> str:
    """Return an example of the page on formats."""
    return [b.text for b in BLOCKS if b.page == f"docs/{FORMATS}" and b.language == "python"][number]


def test_the_predictions_of_the_docs_work(
    make_scene: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    scene = make_scene(scene="corridor-1234")
    (tmp_path / "dataset").rename(tmp_path / "data")
    monkeypatch.chdir(tmp_path)
    exec(compile(python_of_formats(0), FORMATS, "exec"), {})
    Path("mine/lights.json").write_text(block_of(FORMATS, "json", "["))
    assert len(open_predictions(Path("mine")).lights() or ()) == 6
    Path("mine/lights.json").unlink()
    assert main(["score", "mine", str(Path("data") / "dark" / scene.name)]) == 0


def test_the_removal_of_the_docs_works(
    make_scene: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
):
    make_scene(track="tabletop", scene="glossy-table-1234")
    (tmp_path / "dataset").rename(tmp_path / "data")
    monkeypatch.chdir(tmp_path)
    exec(compile(python_of_formats(1), FORMATS, "exec"), {})
    assert main(["score", "removed", "data/tabletop/glossy-table-1234"]) == 0
    assert "counterfactual.psnr" in capsys.readouterr().out


def test_the_priors_of_the_docs_are_read(tmp_path: Path):
    (tmp_path / "p.toml").write_text(block_of("reference/priors.md", "toml", "source = "))
    assert str(parse_priors(str(tmp_path / "p.toml"))) == "oracle, severity 2; mask: oracle, severity 4"


def test_the_metric_of_the_how_to_is_one():
    space: dict[str, Any] = {}
    exec(compile(block_of("how-to/add-a-metric.md", "python"), "add-a-metric.md", "exec"), space)
    (metric,) = space["METRICS"]
    assert metric.id == "albedo.mae"
    assert metric.id not in {known.id for known in registry()}


def test_the_protocol_of_the_how_to_is_one():
    space: dict[str, Any] = {}
    exec(compile(block_of("how-to/add-a-protocol.md", "python"), "add-a-protocol.md", "exec"), space)
    assert isinstance(space["MINE"], PsnrProtocol)
    assert space["MINE"].id == "mine-1"


def test_the_family_of_the_how_to_builds_a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "pedestal_of_docs.py").write_text(block_of("how-to/add-a-scene-family.md", "python", '"""'))
    monkeypatch.syspath_prepend(tmp_path)
    from pedestal_of_docs import Pedestal  # pyright: ignore[reportMissingImports]

    settings = RenderSettings(train_views=4, test_views=2)
    scene = Pedestal(strength=20.0).build(7, settings)
    assert [view.split for view in scene.views].count("test") == 2
    assert scene.lights[0].intensity == (20.0, 20.0, 20.0)
    with pytest.raises(ValueError, match="expected strength in"):
        Pedestal(strength=0.0)


def test_the_claim_of_the_how_to_is_read(tmp_path: Path):
    (tmp_path / "mine.toml").write_text(block_of("how-to/add-a-claim.md", "toml"))
    paper = load_claims(str(tmp_path / "mine.toml"))
    assert [check.id for claim in paper.claims for check in claim.checks] == ["quality"]
