# SPDX-License-Identifier: Apache-2.0
"""Names of places in a page: as like what they name as can be, and never two alike."""

import re
from itertools import count


class Anchors:
    """Names that are taken in one page.

    No name has two hyphens in a row, so ``NAME--PART`` is free for the parts of a place.
    """

    def __init__(self) -> None:
        self._taken = {"content"}

    def take(self, text: str) -> str:
        """Return a name for a text: the text itself where that can be, else one like it."""
        plain = re.sub(r"[^A-Za-z0-9._]+", "-", text).strip("-") or "place"
        numbered = (f"{plain}-{number}" for number in count(2))
        found = plain if plain not in self._taken else next(n for n in numbered if n not in self._taken)
        self._taken.add(found)
        return found
