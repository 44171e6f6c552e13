# SPDX-License-Identifier: Apache-2.0
"""A scene whose truth has all that published code predicts, and predictions near to it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from changed_scene import enrich
from other_outputs import add_metal, write_own


@pytest.fixture(scope="session")
def adopted_scene(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    return add_metal(enrich(write_tiny(tmp_path_factory.mktemp("adopted"), train=4, test=3)))


@pytest.fixture(scope="session")
def own(tmp_path_factory: pytest.TempPathFactory, adopted_scene: Path) -> Path:
    return write_own(tmp_path_factory.mktemp("own") / "mine", adopted_scene)
