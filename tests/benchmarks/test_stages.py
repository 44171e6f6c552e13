# SPDX-License-Identifier: Apache-2.0
"""Fits of a run that share stages: what one has saved is found by the next, and counts as time of both."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import graycard as gc
from graycard.benchmarks import FitSpec, fit_scene
from graycard.methods import add_resumed, load_method, resumed_time, settings_of

BEFORE_S = 1000.0


@dataclass(frozen=True)
class Settings:
    """Where stages are saved."""

    checkpoint: str = ""


@dataclass
class Even:
    """A decomposition that tells where its stages were."""

    checkpoint: str
    provides = frozenset({"base_color"})

    def render(self, camera: gc.Camera, layers: list[str]) -> dict[str, np.ndarray]:
        return {name: np.full((camera.height, camera.width, 3), 0.5) for name in layers}

    def lights(self) -> None:
        return None

    def save(self, folder: Path) -> None:
        folder.mkdir(exist_ok=True)
        (folder / "checkpoint").write_text(self.checkpoint)


class Unstaged:
    """A method whose setting means something else."""

    summary, needs, settings_type = "It saves nothing", (), Settings

    def fit(
        self, capture: gc.Capture, priors: object, settings: Settings, seed: int, progress: object
    ) -> Even:
        self.found(settings)
        return Even(settings.checkpoint)

    def found(self, settings: Settings) -> None:
        """Nothing."""

    def load(self, folder: Path) -> Even:
        raise NotImplementedError


class Staged(Unstaged):
    """A method that finds what another fit has left."""

    staged = True

    def found(self, settings: Settings) -> None:
        if settings.checkpoint.endswith("/"):
            left = Path(settings.checkpoint) / "stage"
            if left.exists():
                add_resumed(BEFORE_S)
            gc.write_bytes(left, b"done")


@pytest.fixture
def method(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    name = "staged_methods"
    (tmp_path / f"{name}.py").write_text(Path(__file__).read_text())
    monkeypatch.syspath_prepend(tmp_path)
    return f"{name}:{request.param}"


@pytest.mark.parametrize("method", ["Staged"], indirect=True)
def test_what_is_found_counts_as_time_of_the_fit(method: str, make_scene, tmp_path: Path) -> None:
    spec = FitSpec(method, {}, 0, make_scene(), stages=tmp_path / "stages")
    first, second = (fit_scene(spec, tmp_path / name, gc.silent).cost.wall_s for name in ("a", "b"))
    assert first < BEFORE_S / 2
    assert BEFORE_S < second < 1.5 * BEFORE_S


@pytest.mark.parametrize(
    ("method", "given"), [("Staged", ""), ("Staged", "own"), ("Unstaged", "")], indirect=["method"]
)
def test_only_who_asks_for_it_and_was_told_nothing_gets_the_folder(
    method: str, given: str, make_scene, tmp_path: Path
) -> None:
    stages = tmp_path / "stages"
    spec = FitSpec(method, {"checkpoint": given}, 0, make_scene(), stages=stages)
    fit_scene(spec, tmp_path / "p", gc.silent, tmp_path / "saved")
    told = (tmp_path / "saved" / "checkpoint").read_text()
    assert told == (f"{stages}/" if method.endswith(":Staged") and not given else given)


def test_nobody_needs_to_listen() -> None:
    add_resumed(3.0)
    with resumed_time() as outer:
        add_resumed(1.0)
        with resumed_time() as inner:
            add_resumed(2.0)
    assert (outer.seconds, inner.seconds) == (1.0, 2.0)


def test_goris_is_staged_and_what_comes_later_is_no_part_of_its_first_stage() -> None:
    method = load_method("goris")
    plain = settings_of(method, {})
    later = {
        "references": 5,
        "least_effect": 0.1,
        "distilled": True,
        "effect_mask": False,
        "hole_weight": 0.5,
    }
    assert getattr(method, "staged", False)
    assert settings_of(method, later).first == plain.first == plain
    assert settings_of(method, {"weights": 0.2}).first != plain
