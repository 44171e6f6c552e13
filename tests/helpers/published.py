# SPDX-License-Identifier: Apache-2.0
"""Published folders that come along."""

from pathlib import Path

from graycard.records import CLAIMS
from graycard.reports.history._keep import OWN

SECOND = OWN / "second"


def published_folders() -> list[Path]:
    """Return all published folders, of either edition of the ledger."""
    return sorted([*(path.parent for path in OWN.glob(f"*/{CLAIMS}")), *folders_of_second()])


def folders_of_second() -> list[Path]:
    """Return the published folders of the second edition."""
    return sorted(path.parent for path in SECOND.glob(f"*/{CLAIMS}"))
