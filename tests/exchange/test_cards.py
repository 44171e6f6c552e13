# SPDX-License-Identifier: Apache-2.0
"""A dataset as others find it: a Croissant manifest that its own library accepts, and a card for people."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from graycard.cli import main
from graycard.dataset import IMPORTER, SECRET_SEEDS
from graycard.exchange.cards._card import LONGEST, data_card
from graycard.exchange.cards._survey import Publication, survey
from graycard.io import read_json, read_manifest, sha256, write_manifest

Capture = pytest.CaptureFixture[str]
Scenes = dict[str, Path]


@pytest.fixture
def dataset(make_scene: Callable[..., Path]) -> Path:
    make_scene(scene="corridor-0001")
    return make_scene(track="tabletop", scene="glossy-table-0002").parents[1]


def described(dataset: Path) -> Any:
    words = ["--license", "CC-BY-4.0", "--url", "https://x.org/data"]
    assert main(["export", str(dataset), "--format", "croissant", "--out", str(dataset), *words]) == 0
    return json.loads((dataset / "croissant.json").read_text())


def test_each_manifest_is_a_file_with_its_hash(dataset: Path, capsys: Capture):
    found = described(dataset)
    assert "as croissant, with a data card, 2 scenes" in capsys.readouterr().out
    files = {one["contentUrl"]: one["sha256"] for one in found["distribution"]}
    assert sorted(files) == sorted(p.relative_to(dataset).as_posix() for p in dataset.rglob("manifest.json"))
    assert all(sha256(dataset / name) == digest for name, digest in files.items())
    assert (found["license"], found["url"]) == ("CC-BY-4.0", "https://x.org/data")


def test_each_scene_is_a_record(dataset: Path):
    (scenes,) = described(dataset)["recordSet"]
    assert [(one["scenes/track"], one["scenes/scene"]) for one in scenes["data"]] == [
        ("dark", "corridor-0001"), ("tabletop", "glossy-table-0002")
    ]  # fmt: skip
    fields = {one["@id"] for one in scenes["field"]}
    assert all(one.keys() == fields for one in scenes["data"])


def test_the_card_lists_scenes_licence_and_limits(dataset: Path):
    described(dataset)
    card = (dataset / "DATA_CARD.md").read_text()
    assert card.startswith("# dataset\n")
    assert "| dark/corridor-0001 | " in card
    assert "| licence | CC-BY-4.0 |" in card
    assert "## Limits" in card


def test_a_long_card_ends(dataset: Path):
    found = survey(dataset, "1")
    many = replace(found, scenes=found.scenes[:1] * (LONGEST + 3))
    card = data_card(many, Publication())
    assert card.count("| dark/corridor-0001 |") == LONGEST
    assert "3 more are in `croissant.json`." in card


def test_a_secret_seed_stays_secret(dataset: Path):
    truth = dataset / "dark" / "corridor-0001" / "truth"
    manifest = read_manifest(truth, "graycard-truth")
    write_manifest(truth, replace(manifest, seeds={"scene": SECRET_SEEDS[5]}))
    assert str(SECRET_SEEDS[5]) not in json.dumps(described(dataset))
    assert str(SECRET_SEEDS[5]) not in (dataset / "DATA_CARD.md").read_text()


@pytest.mark.parametrize(
    ("below", "words"), [("dark/corridor-0001", "a scene: name the folder above"), ("x", "none")]
)
def test_what_is_no_dataset_is_refused(dataset: Path, below: str, words: str, capsys: Capture):
    assert main(["export", str(dataset / below), "--format", "croissant", "--out", str(dataset / "o")]) == 2
    assert words in capsys.readouterr().err
    assert not (dataset / "o").exists()


def test_the_library_of_croissant_accepts_it(dataset: Path):
    mlcroissant = pytest.importorskip("mlcroissant", reason="pip install mlcroissant")
    described(dataset)
    loaded = mlcroissant.Dataset(jsonld=dataset / "croissant.json")
    assert loaded.metadata.ctx.issues.report() == ""
    records = [*loaded.records("scenes")]
    assert len(records) == len(read_json(dataset / "croissant.json")["recordSet"][0]["data"]) == 2


def test_imported_photographs_are_not_vouched_for(dataset: Path, capsys: Capture):
    """Nobody here knows who is to be seen in photographs of others, or under which licence they are."""
    shutil.rmtree(dataset / "dark" / "corridor-0001" / "truth")
    capture = dataset / "dark" / "corridor-0001" / "capture"
    manifest = read_manifest(capture, "graycard-capture")
    write_manifest(capture, replace(manifest, generator={"name": IMPORTER}))
    assert main(["export", str(dataset), "--format", "croissant", "--out", str(dataset)]) == 2
    assert "expected the licence of 1 scenes of imported photographs, got none" in capsys.readouterr().err
    assert not (dataset / "croissant.json").exists()
    found = described(dataset)
    assert "answers for what they show" in found["rai:personalSensitiveInformation"]
    assert "taken over by graycard import" in found["rai:dataCollection"]
    assert "display white" in found["rai:dataLimitations"]
    assert "creator" not in found
    card = (dataset / "DATA_CARD.md").read_text()
    assert "cameras of 1 scenes are of others" in card
    assert "| dark/corridor-0001 | imported |" in card


def test_rendered_scenes_have_a_licence_and_show_nobody(dataset: Path):
    assert main(["export", str(dataset), "--format", "croissant", "--out", str(dataset)]) == 0
    found = json.loads((dataset / "croissant.json").read_text())
    assert found["license"] == "Apache-2.0"
    assert found["rai:personalSensitiveInformation"] == "None: no person and no place is shown."
    assert "of others" not in (dataset / "DATA_CARD.md").read_text()


def test_a_licence_is_of_a_dataset(dataset: Path, tmp_path: Path, capsys: Capture):
    scene, out = dataset / "dark" / "corridor-0001", tmp_path / "out"
    assert main(["export", str(scene), "--format", "colmap", "--out", str(out), "--license", "MIT"]) == 2
    assert "expected --license and --url with --format croissant, got colmap" in capsys.readouterr().err
    assert not out.exists()
