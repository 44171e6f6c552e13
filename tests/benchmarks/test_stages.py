# SPDX-License-Identifier: Apache-2.0
"""Fits of a run that share stages: what one has saved is found by the next, and counts as time of both."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from graycard import Camera, Capture, MethodError
from graycard.benchmarks import FitSpec, fit_scene
from graycard.benchmarks._introduction import Introduction
from graycard.benchmarks._runner import _stages
from graycard.io import silent, write_bytes
from graycard.methods import add_resumed, load_method, resumed_time, settings_of

BEFORE_S, BEFORE_MIB = 1000.0, 1e6


@dataclass(frozen=True)
class Settings:
    """Where stages are saved."""

    checkpoint: str = ""


@dataclass
class Even:
    """A decomposition that tells where its stages were."""

    checkpoint: str
    provides = frozenset({"base_color"})

    def render(self, camera: Camera, layers: list[str]) -> dict[str, np.ndarray]:
        return {name: np.full((camera.height, camera.width, 3), 0.5) for name in layers}

    def lights(self) -> None:
        return None

    def save(self, folder: Path) -> None:
        folder.mkdir(exist_ok=True)
        (folder / "checkpoint").write_text(self.checkpoint)


class Unstaged:
    """A method whose setting means something else."""

    summary, needs, settings_type = "It saves nothing", (), Settings

    def fit(self, capture: Capture, priors: object, settings: Settings, seed: int, progress: object) -> Even:
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
                add_resumed(BEFORE_S, BEFORE_MIB)
            write_bytes(left, b"done")


class Off(Unstaged):
    """A method that says it has no stages."""

    staged = False


class Peeks(Unstaged):
    """A method that looks for what others have left."""

    staged = True

    def found(self, settings: Settings) -> None:
        (Path(settings.checkpoint).parents[1] / "other" / "stage").read_text()


@pytest.fixture
def method(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    name = "staged_methods"
    (tmp_path / f"{name}.py").write_text(Path(__file__).read_text())
    monkeypatch.syspath_prepend(tmp_path)
    return f"{name}:{request.param}"


@pytest.mark.parametrize("method", ["Staged"], indirect=True)
def test_what_is_found_counts_as_time_of_the_fit(method: str, make_scene, tmp_path: Path) -> None:
    spec = FitSpec(method, {}, 0, make_scene(), stages=tmp_path / "stages" / "code" / "capture")
    first, second = (fit_scene(spec, tmp_path / name, silent).cost for name in ("a", "b"))
    assert first.wall_s < BEFORE_S / 2
    assert first.peak_memory_mib < BEFORE_MIB
    assert BEFORE_S < second.wall_s < 1.5 * BEFORE_S
    assert second.peak_memory_mib == BEFORE_MIB


@pytest.mark.parametrize(
    ("method", "given"), [("Staged", ""), ("Staged", "own"), ("Unstaged", "")], indirect=["method"]
)
def test_only_who_asks_for_it_and_was_told_nothing_gets_the_folder(
    method: str, given: str, make_scene, tmp_path: Path
) -> None:
    stages = tmp_path / "stages" / "code" / "capture"
    spec = FitSpec(method, {"checkpoint": given}, 0, make_scene(), stages=stages)
    fit_scene(spec, tmp_path / "p", silent, tmp_path / "saved")
    told = (tmp_path / "saved" / "checkpoint").read_text()
    assert told == (f"{stages}/" if method.endswith(":Staged") and not given else given)


def test_nobody_needs_to_listen() -> None:
    add_resumed(3.0)
    with resumed_time() as outer:
        add_resumed(1.0)
        with resumed_time() as inner:
            add_resumed(2.0, 7.0)
            add_resumed(3.0, 5.0)
    assert (outer.seconds, inner.seconds, inner.peak_mib) == (1.0, 5.0, 7.0)


@pytest.mark.parametrize("method", ["Off"], indirect=True)
def test_who_says_that_it_is_not_staged_is_not(method: str, make_scene, tmp_path: Path) -> None:
    stages = tmp_path / "stages" / "code" / "capture"
    fit_scene(FitSpec(method, {}, 0, make_scene(), stages=stages), tmp_path / "p", silent, tmp_path / "s")
    assert (tmp_path / "s" / "checkpoint").read_text() == ""


@pytest.mark.parametrize("method", ["Peeks"], indirect=True)
def test_stages_of_others_are_closed(method: str, make_scene, tmp_path: Path) -> None:
    (tmp_path / "stages" / "other").mkdir(parents=True)
    (tmp_path / "stages" / "other" / "stage").write_text(
        "what a row that was handed the truth has made of it"
    )
    stages = tmp_path / "stages" / "code" / "capture"
    with pytest.raises(MethodError, match="truth is closed"):
        fit_scene(FitSpec(method, {}, 0, make_scene(), stages=stages), tmp_path / "p", silent)


def test_stages_are_found_by_the_same_code_on_the_same_capture_alone(make_scene, tmp_path: Path) -> None:
    def place(code: str, scene: Path, threads: int = 1) -> Path:
        return _stages(tmp_path, Introduction("", (), {}, (), f"graycard 0.1.0 {code}"), scene, threads)

    scene, other = make_scene(), make_scene(scene="tiny-0001")
    assert place("a1", scene) == place("a1", scene)
    assert len({place("a1", scene), place("a2", scene), place("a1", other), place("a1", scene, 2)}) == 4


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
