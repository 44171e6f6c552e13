# SPDX-License-Identifier: Apache-2.0
"""Texts of records in Markdown and XML: shown as they are, whatever they hold."""

import re

from graycard.io import printable

LONGEST = 400
"""Characters of a text in a list; the rest of a longer one is left out."""
_SPECIAL = re.compile(r"([\\`*_\[\]|<>~&$]|^[-+#=:>]|^\d+(?=[.)]))")
"""Marks of Markdown, within a line or at its begin."""
_LINKS = re.compile(r"@|#\d|:/|\bwww\.|\bGH-\d|\b[0-9a-f]{7,40}\b|:[\w+-]+:", re.IGNORECASE)
"""Texts that hosts of code turn into a link, a mention, a reference or a picture of their own."""
_BACKTICKS = re.compile(r"`+")
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def code(text: str) -> str:
    """Return a text as code in Markdown: a host shows it as it is, and links nothing in it."""
    line = _one_line(text) or " "
    longest = max((len(found) for found in _BACKTICKS.findall(line)), default=0)
    fence = "`" * (longest + 1)
    pad = " " if line[0] == "`" or line[-1] == "`" else ""
    return f"{fence}{pad}{line}{pad}{fence}".replace("|", "\\|")


def prose(text: str) -> str:
    """Return a text in Markdown without any markup or link; as code where a host would make a link of it."""
    line = _one_line(text)
    return code(line) if _LINKS.search(line) else _SPECIAL.sub(_escaped, line)


def xml_text(text: str) -> str:
    """Return a text that XML 1.0 can hold: other characters are shown as escapes."""
    return _NO_XML.sub("\ufffd", printable(text))


def _escaped(found: re.Match[str]) -> str:
    text = found[0]
    return f"{text}\\" if text[-1].isdigit() else f"\\{text}"


def _one_line(text: str) -> str:
    line = " ".join(printable(text).split())
    return line if len(line) <= LONGEST else f"{line[:LONGEST]} …"
