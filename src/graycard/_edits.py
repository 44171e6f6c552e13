# SPDX-License-Identifier: Apache-2.0
"""What is changed in a scene whose picture under the change is known: its lights, or an object put in."""

from collections.abc import Iterable
from dataclasses import dataclass

from graycard._errors import UnknownNameError


@dataclass(frozen=True, slots=True)
class LightEdit:
    """One change of a scene's lights; everything else stays as it is.

    On disk it is a folder ``truth/relighting/<name>`` with the changed lights and the held-out views.
    """

    name: str
    summary: str
    """One sentence that says what is changed."""

    @property
    def folder(self) -> str:
        """Where its files are, relative to the truth."""
        return f"relighting/{self.name}"

    def view_file(self, view: str) -> str:
        """The file of a view under the changed lights, relative to the truth."""
        return f"{self.folder}/views/{view}.exr"


def find_edit(edits: Iterable[LightEdit], name: str) -> LightEdit:
    """The edit of a name.

    Raises:
        UnknownNameError: There is none.
    """
    edits = tuple(edits)
    for edit in edits:
        if edit.name == name:
            return edit
    raise UnknownNameError("light edit", name, (edit.name for edit in edits))
