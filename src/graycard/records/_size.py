# SPDX-License-Identifier: Apache-2.0
"""Record of the size at which a run was made, where that is not the size of its suite."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Size:
    """Differences of a run from the size of its suite; by default none."""

    width: int | None = None
    """Width of all pictures, pixels; their height follows. None: as the suite has it."""
    train_views: int | None = None
    """Training views of each scene. None: as the suite has them."""
    surfels: float = 1.0
    """Factor on the surfels of each fit."""

    @property
    def words(self) -> str:
        """Differences in words, as in ``256 pixels wide, 2 times the surfels``; empty for none."""
        told = (
            f"{self.width} pixels wide" if self.width is not None else "",
            f"{self.train_views} training views" if self.train_views is not None else "",
            f"{self.surfels:g} times the surfels" if self.surfels != 1 else "",
        )
        return ", ".join(filter(None, told))
