# SPDX-License-Identifier: Apache-2.0
"""Changes of a scene with a known picture: its lights, or an object put in."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from graycard._errors import UnknownNameError
from graycard.io import Label, Name

RELIGHTING, COMPOSITION = "relighting", "composition"
"""Folders of changed lights and of the composition, relative to the truth, and to a predictions folder."""

EditKind = Literal["off", "moved", "recoloured", "environment"]
"""Change of the lights: one is switched off, moved or given another colour; or all are off and the
surroundings are others."""

_KINDS: tuple[tuple[str, EditKind], ...] = (
    ("without-", "off"),
    ("moved-", "moved"),
    ("flash-moved", "moved"),
    ("recoloured-", "recoloured"),
    ("flash-recoloured", "recoloured"),
    ("environment-", "environment"),
)
"""By how the name of an edit begins."""


@dataclass(frozen=True, slots=True)
class LightEdit:
    """One change of a scene's lights; everything else stays as it is.

    On disk it is a folder ``truth/relighting/<name>`` with the changed lights and the held-out views.
    """

    name: Name
    summary: str
    """One sentence that says what is changed."""

    @property
    def kind(self) -> EditKind | None:
        """Return the change of lights of a name; None for a name of another maker."""
        return next((kind for start, kind in _KINDS if self.name.startswith(start)), None)

    @property
    def folder(self) -> str:
        """Folder of its files, relative to the truth, and to a predictions folder."""
        return relit_folder(self.name)

    def view_file(self, view: str) -> str:
        """Return the file of a view under the changed lights, relative to the truth."""
        return relit_file(self.name, view)


def relit_folder(edit: str) -> str:
    """Folder of a change of the lights, relative to the truth, and to a predictions folder."""
    return f"{RELIGHTING}/{edit}"


def relit_file(edit: str, view: str) -> str:
    """Return the file of a view under changed lights, relative to the truth, and to a predictions folder."""
    return f"{relit_folder(edit)}/views/{view}.exr"


def find_edit(edits: Iterable[LightEdit], name: str) -> LightEdit:
    """Return the edit of a name.

    Raises:
        UnknownNameError: There is none.
    """
    edits = tuple(edits)
    for edit in edits:
        if edit.name == name:
            return edit
    raise UnknownNameError("light edit", name, (edit.name for edit in edits))


@dataclass(frozen=True, slots=True)
class Donor:
    """The scene that an object is taken out of, and which object it is."""

    track: Name
    family: Name
    seed: int
    knobs: Mapping[str, Any]
    """All of them, the defaults included."""
    object: Label
    """Name of the object in its own scene."""
    object_id: int
    """Its id there."""


@dataclass(frozen=True, slots=True, eq=False)
class Composition:
    """An object of another scene, put into this one and lit by its lights.

    On disk it is ``truth/composition/composition.json``, with the held-out views beside it.
    """

    donor: Donor
    donor_to_host: np.ndarray
    """Shape ``(4, 4)``: from world coordinates of the donor's scene to those of this one, metres; rigid."""
    object_id: int
    """Id of the object in ``object_id`` layers of the composed views; others have the ids of this scene."""


def composed_file(view: str) -> str:
    """Return the file of a composed view, relative to the truth, and to a predictions folder."""
    return f"{COMPOSITION}/views/{view}.exr"
