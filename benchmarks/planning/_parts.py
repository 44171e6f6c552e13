# SPDX-License-Identifier: Apache-2.0
"""Parts of a run, one for each task of a job array: neighbours in the plan, so that they share scenes."""

import re
from dataclasses import dataclass

from graycard import GraycardError

_FORM = re.compile(r"([0-9]{1,9})/([0-9]{1,9})")


@dataclass(frozen=True, slots=True)
class Part:
    """One of several parts of a run, which together are the whole."""

    number: int
    """From 1 on."""
    of: int

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def share(self, count: int) -> range:
        """Return the places of this part among so many jobs; shares differ by one job at most."""
        return range((self.number - 1) * count // self.of, self.number * count // self.of)


def parse_part(text: str) -> Part:
    """Return the part that is written as ``K/N``.

    Raises:
        GraycardError: It is not of this form, or there is no such part.
    """
    found = _FORM.fullmatch(text)
    part = Part(int(found[1]), int(found[2])) if found else Part(0, 0)
    if not 1 <= part.number <= part.of:
        raise GraycardError(f"expected a part as K/N, K from 1 to N, such as 3/20, got {text!r}. Mend --only")
    return part
