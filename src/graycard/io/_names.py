# SPDX-License-Identifier: Apache-2.0
"""Names and relative paths that files give: checked when they are decoded, and again when they become paths.

Fields of records that name something are of type :data:`Name`, :data:`RelativePath` or :data:`Label`. Whoever
makes a path of such a name calls :func:`inside`, which refuses to leave its root, be the name good or not.
"""

import unicodedata
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from graycard._errors import GraycardError, OutputError
from graycard.io._files import PARTIAL, end_of_links

LONGEST = 200
"""Bytes of a name in UTF-8: file systems allow 255, of which a suffix and a partial file take some."""
_FORBIDDEN = frozenset('/\\<>:"|?*')
"""Separators, and what some file systems refuse."""
_UNPRINTABLE = frozenset({"Cc", "Cf", "Co", "Cs", "Zl", "Zp"})
"""Unicode categories of control and format characters (bidirectional ones too), private ones, surrogates and
line breaks."""
_RESERVED = frozenset(
    {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))}
)
"""Names of devices on Windows, with any suffix."""


def check_label(text: str) -> str:
    """Return a text that can be printed on one line.

    Raises:
        ValueError: It is empty, too long, or holds control characters or surrogates.
    """
    if not text or len(text.encode(errors="replace")) > LONGEST:
        raise ValueError(f"expected a name of 1 to {LONGEST} bytes, got {_shown(text)}")
    if text.isascii() and text.isprintable():
        return text
    if bad := [c for c in text if unicodedata.category(c) in _UNPRINTABLE]:
        raise ValueError(f"expected a name without control characters, got {bad[0]!r} in {_shown(text)}")
    return text


def check_name(text: str) -> str:
    """Return a text that can name a file or a folder on any system.

    Raises:
        ValueError: It is no :func:`check_label`, holds a separator or a character that some file system
            refuses, begins with a dot or a space, ends in one, or is reserved.
    """
    check_label(text)
    if not _FORBIDDEN.isdisjoint(text):
        bad = next(c for c in text if c in _FORBIDDEN)
        raise ValueError(f"expected a name without {bad!r}, as it names a file, got {_shown(text)}")
    if text[0] in ". " or text[-1] in ". ":
        raise ValueError(f"expected a name that neither begins nor ends with a dot or a space, got {text!r}")
    if text.split(".")[0].casefold() in _RESERVED or text.casefold().endswith(PARTIAL):
        raise ValueError(f"expected a name that is not reserved, got {text!r}")
    return text


def check_relative_path(text: str) -> str:
    """Return names joined by ``/``: a path that stays below the folder that it is relative to.

    Raises:
        ValueError: It is absolute, or a part of it is no :func:`check_name`, as ``..``.
    """
    for part in text.split("/"):
        try:
            check_name(part)
        except ValueError as cause:
            raise ValueError(
                f"expected a path that stays in its folder, names joined by '/', got {_shown(text)}: {cause}"
            ) from cause
    return text


def check_folder(text: str) -> str:
    """Return a :func:`check_relative_path`, or nothing or ``.``: the folder itself.

    Raises:
        ValueError: It leads out of the folder.
    """
    return text if text in ("", ".") else check_relative_path(text)


def check_place(text: str) -> str:
    """Return a path that may lead anywhere, but is printable, or nothing.

    Raises:
        ValueError: It is too long, or holds control characters or surrogates.
    """
    for part in filter(None, text.split("/")):
        check_label(part)
    return text


@dataclass(frozen=True, slots=True)
class TextRule:
    """Metadata of a type: the check that its texts pass when they are decoded."""

    check: Callable[[str], str]
    """Return the text, or raise ValueError."""


Label = Annotated[str, TextRule(check_label)]
"""A text of one printable line."""
Name = Annotated[str, TextRule(check_name)]
"""A text that names one file or folder."""
RelativePath = Annotated[str, TextRule(check_relative_path)]
"""Names joined by ``/``."""
FolderBelow = Annotated[str, TextRule(check_folder)]
"""Names joined by ``/``, or none: a folder below another, or that one."""
AnyPlace = Annotated[str, TextRule(check_place)]
"""A path that whoever runs graycard has chosen: relative or absolute, printable."""


def inside(root: Path, *names: str, error: type[GraycardError] = OutputError) -> Path:
    """Return the path of names below a root; every path that is made of a given name comes from here.

    Args:
        root: A folder; it need not exist.
        names: Each one name or several joined by ``/``.
        error: Error to raise.

    Raises:
        OutputError: (or ``error``) The path would leave the root: by ``..``, as an absolute path, or by a
            link on the way.
    """
    relative = "/".join(names)
    try:
        check_relative_path(relative)
    except ValueError as cause:
        raise error(f"{cause}. Rename it") from cause
    path = Path(root) / relative
    place = end_of_links(path)
    if place is None or not place.is_relative_to(Path(root).resolve()):
        raise error(
            f"expected {relative} to lie in {root}, got a link to {place or 'itself'}. Put the file itself "
            "there"
        )
    return path


def check_distinct(names: Iterable[str]) -> None:
    """Refuse names that are one file where upper and lower case, or ways to write an accent, are one.

    Raises:
        ValueError: Two are; the message names them.
    """
    known: dict[str, str] = {}
    for name in names:
        folded = unicodedata.normalize("NFKC", name).casefold()
        if folded in known:
            raise ValueError(f"expected names of different files, got {known[folded]!r} and {name!r}")
        known[folded] = name


def printable(text: str) -> str:
    """Return a text with its control characters, but for line breaks and tabs, as escapes.

    Terminals obey such characters, and bidirectional ones make a text look like another.
    """
    return "".join(
        c if c in "\n\t" or unicodedata.category(c) not in _UNPRINTABLE else _escape(c) for c in text
    )


def markdown_text(text: str) -> str:
    """Return a text that Markdown shows as it is, on one line."""
    for sign in "\\|`*_<>[]":
        text = text.replace(sign, "\\" + sign)
    return " ".join(text.split())


def is_text(value: str) -> bool:
    """Tell whether a text can be written in UTF-8: Python keeps odd bytes of names as surrogates."""
    return value.encode(errors="replace").decode() == value


def _escape(character: str) -> str:
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _shown(text: str) -> str:
    """Return a text as ASCII in quotes, cut where it is long."""
    return ascii(text if len(text) <= 60 else f"{text[:60]}…")
