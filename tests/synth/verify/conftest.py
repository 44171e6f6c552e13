# SPDX-License-Identifier: Apache-2.0
"""One small scene of each track, rendered once, and copies of it to plant faults in."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from graycard.synth import RenderSettings, SceneSpec, render_scene

SETTINGS = RenderSettings(48, 48, train_views=2, test_views=1, samples=64)
FAMILIES = {"dark": "corridor", "tabletop": "glossy-table", "multilight": "studio"}


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """``rendered(track)``: the scene's folder, rendered on first use; not to be changed."""
    dataset = tmp_path_factory.mktemp("verified")
    found: dict[str, Path] = {}

    def render(track: str) -> Path:
        if track not in found:
            found[track] = render_scene(SceneSpec(track, FAMILIES[track], 1000), SETTINGS, dataset)
        return found[track]

    return render


@pytest.fixture
def copied(rendered: Callable[[str], Path], tmp_path: Path) -> Callable[[str], Path]:
    """``copied(track)``: a copy of the scene in a dataset of its own."""

    def copy(track: str) -> Path:
        source = rendered(track)
        return Path(shutil.copytree(source, tmp_path / "dataset" / track / source.name))

    return copy
