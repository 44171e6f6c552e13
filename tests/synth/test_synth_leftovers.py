# SPDX-License-Identifier: Apache-2.0
"""A rendering that was killed at its very end leaves a folder that no other goes on from: it goes."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from graycard.io import write_json
from graycard.synth import clear_leftovers
from graycard.synth.dataset import _render
from graycard.synth.dataset._store import Place, stamped


def test_what_is_left_of_whole_scenes_goes_and_what_is_half_made_stays(
    tmp_path: Path, write_tiny: Callable[..., Path]
) -> None:
    write_tiny(tmp_path, track="dark", scene="corridor-0001")
    whole, half, broken = (Place(tmp_path, "dark", f"corridor-000{n}") for n in (1, 2, 3))
    for place in (whole, half, broken):
        write_json(place.stamp, {"seed": 1})
        place.lock.write_text("process 1 on nowhere")
    (whole.replaced / "truth").mkdir(parents=True)
    (broken.final / "truth").mkdir(parents=True)
    before = sorted(path for path in whole.final.rglob("*"))
    clear_leftovers(tmp_path)
    assert not whole.work.exists()
    assert sorted(path for path in whole.final.rglob("*")) == before
    for place in (half, broken):
        assert stamped(place) == {"seed": 1}, "the next rendering goes on from it"
    assert not list(tmp_path.rglob("*.lock"))
    clear_leftovers(tmp_path / "none")


def test_a_scene_that_is_just_being_mended_stays(
    tmp_path: Path, write_tiny: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process makes a damaged scene a partial one while its lock is waited for."""
    write_tiny(tmp_path, track="dark", scene="corridor-0001")
    place = Place(tmp_path, "dark", "corridor-0001")
    write_json(place.stamp, {"seed": 1})

    @contextmanager
    def waited(path: Path, on_wait: object) -> Iterator[None]:
        place.final.rename(place.partial)
        yield

    monkeypatch.setattr(_render, "file_lock", waited)
    clear_leftovers(tmp_path)
    assert stamped(place) == {"seed": 1}
    assert (place.partial / "truth" / "manifest.json").is_file()


def test_what_cannot_be_removed_stays(
    tmp_path: Path, write_tiny: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Datasets may lie where nobody may write."""
    write_tiny(tmp_path, track="dark", scene="corridor-0001")
    place = Place(tmp_path, "dark", "corridor-0001")
    write_json(place.stamp, {"seed": 1})

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError

    with monkeypatch.context() as patch:
        patch.setattr(os, "open", refuse)
        clear_leftovers(tmp_path)
    assert place.stamp.is_file()
