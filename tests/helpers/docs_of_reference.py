# SPDX-License-Identifier: Apache-2.0
"""Reference pages that are made of the code: some are kept in docs/reference, others exist in the site alone.

``make docs`` writes those that are kept. ``make site`` adds the rest: commands, settings and the Python API.
"""

import ast
import contextlib
import io
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from docs_pictures import file_of_layer
from graycard.benchmarks import load_suite, suite_names
from graycard.benchmarks.claims import claims_names, load_claims
from graycard.cli._main import main
from graycard.cli._table import VERBS
from graycard.layers import all_layers
from graycard.methods import BUILT_IN
from graycard.synth.families import all_families, knobs

DOCS = Path(__file__).parents[2] / "docs"
MARK = "<!-- written by `make docs` from the code: do not edit -->\n"
API = {
    "graycard": "Domain: cameras, lights, captures, truth, predictions, errors",
    "graycard.layers": "Layers",
    "graycard.lights": "Lights",
    "graycard.colour": "Colour",
    "graycard.dataset": "Datasets",
    "graycard.predictions": "Predictions",
    "graycard.points": "Sparse points",
    "graycard.edits": "Edits",
    "graycard.resources": "Cores and memory",
    "graycard.exchange": "Other programs' formats",
    "graycard.io": "Files",
    "graycard.records": "Records",
    "graycard.synth": "Scenes",
    "graycard.methods": "Methods",
    "graycard.methods.priors": "Priors",
    "graycard.methods.shading": "Shading",
    "graycard.methods.splat": "The surfel engine",
    "graycard.eval": "Scores",
    "graycard.eval.protocols": "Protocols",
    "graycard.eval.statistics": "Statistics",
    "graycard.benchmarks": "Suites and runs",
    "graycard.reports": "Reports",
}
"""Public modules, each with the title of its page."""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(cell(text) for text in line) + " |\n" for line in lines)


def cell(text: str) -> str:
    """Return a text as it stands in one cell: one line, bars escaped, code marked once."""
    return " ".join(text.split()).replace("``", "`").replace("|", "\\|")


def layers_page() -> str:
    """Return the page of all layers."""
    rows = [
        (f"`{layer.name}`", " ".join(layer.channels), layer.unit, layer.meaning, _picture(layer.name))
        for layer in all_layers()
    ]
    return (
        f"# Layers\n\n{MARK}\nA layer is a named image. A file holds it as channels `<layer>.<channel>`. "
        "`<light>` stands for the name of a light.\n\n"
        + table(("layer", "channels", "unit", "meaning", "example"), rows)
    )


def _picture(layer: str) -> str:
    return f"![{layer.replace('<light>', 'light')}](../pictures/{file_of_layer(layer)})"


def knobs_page() -> str:
    """Return the page of all families and their knobs."""
    parts = [
        f"# Scene families and their knobs\n\n{MARK}\nA knob changes what it names and leaves the rest "
        "of the scene as it is. `graycard scenes FAMILY` prints the same.\n"
    ]
    for name, family in all_families().items():
        rows = [(f"`{k.name}`", str(k.default), k.allowed, k.meaning) for k in knobs(family)]
        parts.append(
            f"\n## `{name}`\n\n{family.title[0].upper()}{family.title[1:]} (track `{family.track}`).\n\n"
            f"![A view of the family {name}](../pictures/family-{name}.jpg)\n\n"
            + table(("knob", "default", "allowed", "meaning"), rows)
        )
    return "".join(parts)


def suites_page() -> str:
    """Return the page of the suites that come along."""
    rows: list[list[str]] = []
    for name in suite_names():
        suite = load_suite(name)
        tracks = ", ".join(sorted({scene.track for scene in suite.scenes}))
        size = f"{suite.render.width} x {suite.render.height}"
        views = f"{suite.render.train_views} + {suite.render.test_views}"
        jobs = sum(len(suite.rows_on(scene.track)) for scene in suite.scenes) * len(suite.seeds)
        rows.append([f"`{name}` {suite.version}", tracks, str(len(suite.scenes)), size, views])
        rows[-1] += [str(len(suite.methods)), str(jobs), suite.title]
    head = ("suite, version", "tracks", "scenes", "pixels", "views", "rows", "jobs", "about")
    return (
        f"# Suites\n\n{MARK}\nViews are those for training and those held out. "
        "[Suite files](suite-files.md) says how to write one.\n\n" + table(head, rows)
    )


def claims_page() -> str:
    """Return the page of the claims that come along."""
    parts = [
        f"# Claims\n\n{MARK}\nSentences of papers that runs are held against. "
        "[Claim files](claim-files.md) says how to write one, "
        "[Statistics](../explanation/statistics.md) how a verdict follows.\n"
    ]
    for name in claims_names():
        paper = load_claims(name)
        rows = [
            (c.id, c.sentence, c.source, ", ".join(dict.fromkeys(k.quantity.metric for k in c.checks)))
            for c in paper.claims
        ]
        parts.append(
            f"\n## `{name}`\n\n{paper.title}. Judged on the suite `{paper.suite or 'any'}`.\n\n"
            + table(("id", "sentence", "source", "metrics"), rows)
        )
    return "".join(parts)


KEPT: Mapping[str, Callable[[], str]] = {
    "reference/layers.md": layers_page,
    "reference/knobs.md": knobs_page,
    "reference/suites.md": suites_page,
    "reference/claims.md": claims_page,
}
"""Pages that are kept in docs/, by path."""


def commands_page() -> str:
    """Return the page of all verbs, each with its help."""
    parts = ["# Commands\n\n`graycard --help`:\n\n```text\n", _help("--help"), "```\n"]
    for verb in VERBS:
        parts.append(
            f"\n## `graycard {verb.name}`\n\n{verb.help}.\n\n```text\n{_help(verb.name, '--help')}```\n"
        )
    return "".join(parts)


def settings_page() -> str:
    """Return the page of the settings of all methods."""
    parts = ["# Settings of the methods\n\n`graycard methods NAME` prints the same.\n"]
    for name in BUILT_IN:
        parts.append(f"\n## `{name}`\n\n```text\n{_help('methods', name)}```\n")
    return "".join(parts)


def api_page(module: str, title: str) -> str:
    """Return the page of a public module, which mkdocstrings fills in: its own names, or those it offers."""
    offered = offers(module)
    parts = [f"# {title}: `{module}`\n", _entry(module, members="false")] if offered else []
    parts += [_entry(path, show_root_heading="true", heading_level="2") for path in offered]
    return "\n".join(parts) or f"# {title}: `{module}`\n\n::: {module}\n"


def offers(module: str) -> list[str]:
    """Return where the classes and functions are defined that a door offers, in order of their names.

    Those of another public module stand on the page of that one.
    """
    found = {
        alias.name: f"{node.module}.{alias.name}"
        for node in _body_of(module)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == alias.name and node.module not in API and _defines(str(node.module), alias.name)
    }
    return [found[name] for name in sorted(found, key=str.lower)]


@cache
def _body_of(module: str) -> list[ast.stmt]:
    spec = find_spec(module)
    assert spec is not None
    return ast.parse(Path(str(spec.origin)).read_text(encoding="utf-8")).body


def _defines(module: str, name: str) -> bool:
    kinds = (ast.ClassDef, ast.FunctionDef)
    return any(isinstance(node, kinds) and node.name == name for node in _body_of(module))


def _entry(path: str, **options: str) -> str:
    """Return a directive of mkdocstrings."""
    lines = [f"      {name}: {value}\n" for name, value in options.items()]
    return f"::: {path}\n    options:\n{''.join(lines)}"


def site_pages() -> Iterator[tuple[str, str]]:
    """Return the pages that exist in the site alone, as pairs (path, Markdown)."""
    yield "reference/commands.md", commands_page()
    yield "reference/settings.md", settings_page()
    for module, title in API.items():
        yield f"reference/python/{module}.md", api_page(module, title)


def _help(*args: str) -> str:
    """Return what the command line prints, 100 columns wide, without colours."""
    out = io.StringIO()
    before = {name: os.environ.get(name) for name in ("COLUMNS", "NO_COLOR", "TERM")}
    os.environ.update(COLUMNS="100", NO_COLOR="1", TERM="dumb")
    try:
        with contextlib.redirect_stdout(out):
            main(list(args))
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})
    return re.sub(r"\x1b\[[0-9;]*m", "", out.getvalue())
