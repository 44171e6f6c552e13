# SPDX-License-Identifier: Apache-2.0
"""Write the manifest and the card of a dataset."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from graycard._errors import DatasetError
from graycard.exchange.cards._card import data_card
from graycard.exchange.cards._croissant import croissant
from graycard.exchange.cards._survey import LICENSE, Publication, Survey, survey
from graycard.io import write_bytes, write_json

MANIFEST_NAME, CARD_NAME = "croissant.json", "DATA_CARD.md"


def write_cards(dataset: Path, out: Path, version: str, told: Publication) -> Survey:
    """Write ``croissant.json`` and ``DATA_CARD.md``, whose paths are relative to the dataset.

    Args:
        dataset: A folder with ``<track>/<scene>/``.
        out: The folder to write to: the dataset itself, where it is to be published.
        version: Version of graycard.
        told: What only the publisher knows.

    Raises:
        DatasetError: There is no scene, a manifest is damaged, or imported photographs have no licence.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    found = survey(dataset, version)
    if found.imported and not told.license:
        raise DatasetError(
            f"expected the licence of {found.imported} scenes of imported photographs, got none. Name it by "
            "--license"
        )
    today = datetime.now(UTC).date().isoformat()
    dated = replace(told, license=told.license or LICENSE, date=told.date or today)
    write_json(out / MANIFEST_NAME, croissant(found, dated))
    write_bytes(out / CARD_NAME, data_card(found, dated).encode())
    return found
