# SPDX-License-Identifier: Apache-2.0
"""Prose that a newcomer can read: CONTRIBUTING.md, "How we write". `make lint` runs this file."""

import subprocess

import pytest

from prose import (
    RIDDLES,
    ROOT,
    Docstring,
    docstrings,
    docstrings_of,
    faults,
    pages,
    prose_of,
    sentences,
    words,
)

SINCE = "157dc660dc5a70ab7b49dcd778044d94244f577f"
"""Commit after which subjects are held to the rule."""
LONG = "word " * 45
GOOD = "Return the depth. It is in metres.\n\n| a | b |\n| --- | --- |\n| short | cell |\n"


TOO_LONG = {
    "Know an installed wheel by its hashes, and publish submitted rows with a badge",
    "Build the wheel from the source distribution, and run it outside a checkout",
    "Gate the CI of others, light installs, doctor --mend, completion, progress in logs",
}
"""Those that came to the shared history before anybody had counted."""


def subjects() -> list[str]:
    """Return the subjects of the commits since the rule, but of merges."""
    log = subprocess.run(
        ["git", "log", "--no-merges", "--format=%s", f"{SINCE}..HEAD"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if log.returncode:
        pytest.skip("needs the history of the repository")
    return [subject for subject in log.stdout.splitlines() if subject not in TOO_LONG]


def fault_of(subject: str) -> str:
    """Return what is wrong with the subject of a commit; empty if nothing."""
    if len(subject) > 72:
        return f"expected at most 72 characters, got {len(subject)}: {subject}"
    return f"expected one thing, got a semicolon: {subject}" if ";" in subject else ""


def share_of_riddles(found: list[Docstring]) -> float:
    """Return the share of docstrings that begin with one of the words."""
    return sum(docstring.first in RIDDLES for docstring in found) / len(found)


def test_pages_have_short_sentences_and_cells():
    texts = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in pages()}
    assert len(texts) > 40
    assert faults(texts) == []


def test_every_page_has_a_title_and_few_levels():
    for path in pages():
        first = path.read_text(encoding="utf-8").partition("\n")[0]
        assert first.startswith("# "), path


def test_docstrings_say_what_a_thing_does():
    found = list(docstrings())
    assert len(found) > 10_000
    assert any(d.path.startswith("tests/") for d in found)
    wrong = [f"{d.path}:{d.line} {d.text[:60]}" for d in found if d.first in RIDDLES]
    assert wrong == []


def test_subjects_of_commits_are_short():
    assert [fault for subject in subjects() if (fault := fault_of(subject))] == []


@pytest.mark.parametrize(
    ("page", "said"),
    [
        (f"{LONG}.\n" * 3, "median sentence"),
        ("Short one. " * 8 + f"{LONG}. {LONG}.", "nine sentences in ten"),
        (f"{GOOD}| more | {LONG} |\n", "45 words in a cell"),
        (f"- {LONG}\n- {LONG}\n", "median sentence"),
        (f"> {LONG}\n", "median sentence"),
        (
            f"{GOOD}<!-- metrics: written by `make docs`, do not edit -->\n| x | {LONG} |\n",
            "45 words in a cell",
        ),
        (f"```sh\nls\n```\n{LONG}.\n", "median sentence"),
        (f"<!-- a: written by `make docs` -->\nx\n<!-- end of a -->\n{LONG}.\n", "median sentence"),
    ],
)
def test_a_bad_page_is_seen(page: str, said: str):
    assert any(said in fault for fault in faults({"bad.md": page}))


@pytest.mark.parametrize(
    "page",
    [
        GOOD,
        f"# {LONG}\n\nShort.\n",
        f"```text\n{LONG}\n```\nShort.\n",
        f"Short. ![{LONG}](picture.jpg)\n",
        f"<!-- a: written by `make docs` -->\n{LONG}\n<!-- end of a -->\nShort.\n",
    ],
)
def test_a_good_page_passes(page: str):
    assert not any("cell" in fault or "median" in fault for fault in faults({"good.md": page}))


def test_sentences_end_at_marks_and_not_at_decimals():
    assert len(sentences("It has 2.5 dB, e.g. here. Then more? Yes. `code` follows.")) == 4
    assert [words(s) for s in sentences("One [two three](a/b.md) `four five`.")] == [4]
    assert prose_of("a b\nc\n\n- d e\n  f\n1. g\n2. h").sentences == ("a b c", "d e f", "g", "h")
    assert prose_of("It is 1014. The rest").sentences == ("It is 1014.", "The rest")
    assert prose_of("table 1013 and\n1014. The rest").sentences == ("table 1013 and 1014.", "The rest")


def test_docstrings_of_all_kinds_are_found_and_riddles_seen():
    source = (
        '"""Module."""\nX = 1\n"""Whether it is."""\nclass A:\n    """Class."""\n'
        '    y: int = 0\n    """What it is."""\n'
        '    def f(self):\n        """Return it."""\n        "no docstring"\n'
    )
    found = list(docstrings_of(source))
    assert [d.text for d in found] == ["Module.", "Whether it is.", "Class.", "What it is.", "Return it."]
    assert share_of_riddles(found) == 0.4


@pytest.mark.parametrize("subject", ["Add a thing " + "x" * 61, "Add one; add another"])
def test_a_bad_subject_is_seen(subject: str):
    assert fault_of(subject)
    assert not fault_of("Add a thing")
