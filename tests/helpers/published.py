# SPDX-License-Identifier: Apache-2.0
"""Published folders that come along."""

from pathlib import Path

from graycard.records import CLAIMS
from graycard.reports.history._keep import OWN

SECOND = OWN / "second"
LARGE = OWN / "large"
SIZES = OWN / "sizes"
PAPER = OWN / "paper"


def published_folders() -> list[Path]:
    """Return all published folders with a ledger: of either edition, and of larger pictures."""
    return sorted([*_with_ledger(OWN), *folders_of_second(), *folders_of_large()])


def folders_of_second() -> list[Path]:
    """Return the published folders of the second edition."""
    return _with_ledger(SECOND)


def folders_of_large() -> list[Path]:
    """Return the published folders whose pictures are larger than those of the editions."""
    return _with_ledger(LARGE)


def _with_ledger(parent: Path) -> list[Path]:
    """Return the folders in this one that have a ledger."""
    return sorted(path.parent for path in parent.glob(f"*/{CLAIMS}"))
