# SPDX-License-Identifier: Apache-2.0
"""Measure prose: sentences and table cells of Markdown, first words of docstrings. Standard library alone."""

import ast
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md", "docs")
CODE = ("src", "benchmarks", "eval", "methods", "reports", "synth", "tests")
RIDDLES = ("What", "Whether", "Where", "How", "Which", "When", "As", "Of")
"""Words that no docstring begins with: it would be a fragment that needs the name to be read."""
_END = re.compile(r"(?<=[.!?])[\"”)*_]*\s+(?=[A-Z`\[*(0-9\"“])")
_CODE = re.compile(r"^\s*(```|~~~).*?^\s*\1\s*$", re.DOTALL | re.MULTILINE)
_ENTRY = re.compile(r"\s*(?:[-*+]|\d{1,2}\.)\s+")
_BULLET = re.compile(r"\s*(?:[-*+]|1\.)\s+")
"""Only these interrupt a paragraph: a line may begin with the end of "dB for scene 1014. The next"."""
_WORD = re.compile(r"\S*\w\S*")


@dataclass(frozen=True)
class Prose:
    """Lengths in words of what a page says."""

    sentences: tuple[str, ...]
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Docstring:
    """One docstring, of a module, a class, a function or an attribute."""

    path: str
    line: int
    text: str

    @property
    def first(self) -> str:
        """First word, without marks."""
        return next(iter(re.findall(r"[\w'-]+", self.text)), "")


def pages(root: Path = ROOT) -> list[Path]:
    """Return the Markdown files that are written for readers."""
    found: list[Path] = []
    for name in PAGES:
        path = root / name
        found += sorted(path.rglob("*.md")) if path.is_dir() else [path]
    return found


def prose_of(text: str) -> Prose:
    """Return the sentences and the cells of a page.

    Code blocks and headings are left out. Where ``make docs`` writes a part or a page, its cells count and
    its sentences do not: those are texts of the code and of ledgers.
    """
    paragraphs: list[str] = []
    cells: list[str] = []
    begin, listed = True, False
    written = "<!-- written by" in text
    for line in _CODE.sub("\n", text).splitlines():
        stripped = line.strip()
        if stripped.startswith("<!--"):
            written = written or "written by `make docs`" in stripped
            written = written and not stripped.startswith("<!-- end of")
        if stripped.startswith("|"):
            cells += _cells(stripped)
        if not stripped or stripped.startswith(("|", "#", "![", "<!--", ":::")) or written:
            begin = True
        elif begin or _BULLET.match(line) or (listed and _ENTRY.match(line)):
            entry = _ENTRY.match(line)
            listed = entry is not None
            paragraphs.append(line[entry.end() :].strip() if entry else stripped)
            begin = False
        else:
            paragraphs[-1] += f" {stripped}"
    return Prose(tuple(s for p in paragraphs for s in sentences(p)), tuple(cells))


def sentences(paragraph: str) -> list[str]:
    """Return the sentences of a paragraph, links and code as one word each."""
    plain = re.sub(r"`[^`]*`", "X", re.sub(r"!?\[([^\]]*)\]\([^)]*\)", _shown, paragraph))
    return [part for part in _END.split(plain) if words(part)]


def _shown(link: re.Match[str]) -> str:
    """Return the words of a link; a picture has none."""
    return "" if link[0].startswith("!") else link[1]


def words(text: str) -> int:
    """Return the number of words; a mark alone is none."""
    return len(_WORD.findall(text))


def percentile(lengths: Iterable[int], share: float) -> int:
    """Return the least length that so large a share of all do not exceed."""
    ordered = sorted(lengths)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def faults(texts: dict[str, str]) -> list[str]:
    """Return what is wrong with the prose of pages, by their names: all together, then cell by cell."""
    found = {name: prose_of(text) for name, text in texts.items()}
    lengths = [words(sentence) for page in found.values() for sentence in page.sentences]
    wrong = []
    if lengths and median(lengths) > 16:
        wrong.append(f"expected a median sentence of at most 16 words, got {median(lengths):g}")
    if lengths and percentile(lengths, 0.9) > 30:
        wrong.append(f"expected nine sentences in ten of at most 30 words, got {percentile(lengths, 0.9)}")
    for name, page in found.items():
        wrong += [f"{name}: {words(c)} words in a cell: {c[:60]}…" for c in page.cells if words(c) > 40]
    return wrong


def docstrings(root: Path = ROOT) -> Iterator[Docstring]:
    """Yield every docstring of the package and of its tests, those of attributes too."""
    for folder in CODE:
        for path in sorted((root / folder).rglob("*.py")):
            if not any(part.is_symlink() for part in path.parents):
                yield from docstrings_of(path.read_text(encoding="utf-8"), str(path.relative_to(root)))


def docstrings_of(source: str, path: str = "") -> Iterator[Docstring]:
    """Yield every docstring of one module."""
    for node in ast.walk(ast.parse(source)):
        body = getattr(node, "body", None)
        if not isinstance(body, list):
            continue
        own = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        for before, statement in zip([None, *body], body, strict=False):
            documents = (own and before is None) or isinstance(before, ast.Assign | ast.AnnAssign)
            if documents and (text := _string(statement)):
                yield Docstring(path, statement.lineno, text)


def _string(node: ast.stmt) -> str:
    match node:
        case ast.Expr(value=ast.Constant(value=str(text))):
            return text
    return ""


def _cells(row: str) -> list[str]:
    if re.fullmatch(r"[|:\-\s]+", row):
        return []
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", row.strip("|"))
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", plain)]
