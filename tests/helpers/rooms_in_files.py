# SPDX-License-Identifier: Apache-2.0
"""Rooms for records of views without any memory."""

import pytest

from graycard.io import _room


def all_in_files(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Keep all that rooms hold in files from now on; return a list that gets how many arrays each has."""
    made: list[int] = []
    mapped = _room.mapped
    monkeypatch.setattr(_room, "SHARE", 0.0)
    monkeypatch.setattr(_room, "SMALL", 256)  # bytes: less than a picture, more than a camera
    monkeypatch.setattr(_room, "hand_back_freed_memory", lambda: True)
    monkeypatch.setattr(_room, "mapped", lambda parts: made.append(len(parts)) or mapped(parts))
    return made
