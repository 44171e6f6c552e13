# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable
from pathlib import Path

import pytest

from sparse_points import with_points


@pytest.fixture(scope="module")
def scene(write_tiny: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_tiny(tmp_path_factory.mktemp("goris"), track="tabletop", train=4, test=1)
    with_points(folder)
    return folder
