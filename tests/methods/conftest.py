# SPDX-License-Identifier: Apache-2.0
"""Surfels that are known under lamps that are known."""

import pytest

from lit_sheets import World, lit_sheets


@pytest.fixture(scope="session")
def world() -> World:
    """A floor, and a board over it."""
    return lit_sheets()
