# SPDX-License-Identifier: Apache-2.0
"""What methods count is part of the cost of a fit."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from graycard import Camera, MethodError, open_capture
from graycard.benchmarks import FitSpec, fit_scene
from graycard.io import from_builtins, silent, to_builtins
from graycard.methods import NoSettings
from graycard.records import Cost


@dataclass
class Counts:
    """A decomposition that counts as many things as a view has letters in its name."""

    odd: bool
    provides = frozenset({"base_color"})

    def render(self, camera: Camera, layers: list[str]) -> dict[str, np.ndarray]:
        return {name: np.full((camera.height, camera.width, 3), 0.5) for name in layers}

    def lights(self) -> None:
        return None

    def save(self, folder: Path) -> None:
        raise NotImplementedError

    def counts(self, camera: Camera) -> Mapping[str, float]:
        turned = camera.position[0]
        return {"steps" if not self.odd or turned < 1 else "strides": float(turned)}


class Counting:
    """A method whose decomposition counts."""

    summary, needs, settings_type = "It counts", (), NoSettings
    odd = False

    def fit(self, *_: object) -> Counts:
        return Counts(self.odd)

    def load(self, folder: Path) -> Counts:
        raise NotImplementedError


class Odd(Counting):
    """It counts other things in other views."""

    odd = True


@pytest.fixture
def method(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    name = "counting_methods"
    (tmp_path / f"{name}.py").write_text(Path(__file__).read_text())
    monkeypatch.syspath_prepend(tmp_path)
    return f"{name}:{request.param}"


@pytest.mark.parametrize("method", ["Counting"], indirect=True)
def test_the_mean_over_held_out_views_is_kept(method: str, make_scene, tmp_path: Path) -> None:
    scene = make_scene()
    cost = fit_scene(FitSpec(method, {}, 0, scene), tmp_path / "p", silent).cost
    views = open_capture(scene / "capture").test
    assert cost.counts == {"steps": pytest.approx(np.mean([v.camera.position[0] for v in views]))}
    assert from_builtins(Cost, to_builtins(cost)) == cost


@pytest.mark.parametrize("method", ["Odd"], indirect=True)
def test_other_counts_in_other_views_are_refused(method: str, make_scene, tmp_path: Path) -> None:
    with pytest.raises(MethodError, match="expected the same counts of each view"):
        fit_scene(FitSpec(method, {}, 0, make_scene()), tmp_path / "p", silent)


def test_a_method_that_counts_nothing_has_no_counts(make_scene, tmp_path: Path) -> None:
    assert fit_scene(FitSpec("gray", {}, 0, make_scene()), tmp_path / "p", silent).cost.counts == {}
