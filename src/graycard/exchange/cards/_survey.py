# SPDX-License-Identifier: Apache-2.0
"""The facts of a dataset that its manifests tell, which a manifest for others and a data card are made of."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from graycard._errors import DatasetError
from graycard._held_out import HELD_OUT
from graycard.dataset import SECRET_SEEDS, capture_folders, has_truth, is_in_display_white, open_capture
from graycard.io import MANIFEST, Manifest, read_manifest, sha256

PARTS = {"capture": "graycard-capture", "truth": "graycard-truth", HELD_OUT: "graycard-held-out"}
"""Parts of a scene, with the kind of the manifest of each."""

LICENSE = "Apache-2.0"
"""Licence of scenes that graycard renders."""


@dataclass(frozen=True, slots=True)
class ManifestFile:
    """The manifest of one part of a scene, which has the SHA-256 of each file of it."""

    path: str
    """Relative to the dataset."""
    sha256: str
    bytes: int
    """Its own size."""
    files: int
    """Files that it lists."""


@dataclass(frozen=True, slots=True)
class SceneFacts:
    """One scene."""

    track: str
    scene: str
    family: str
    """Empty for imported photographs."""
    seed: int | None
    """None where there is none, or where it is secret."""
    width: int
    height: int
    train_views: int
    test_views: int
    truth: bool
    settings: Mapping[str, Any]
    """Knobs and rendering, as the truth has them."""
    manifests: tuple[ManifestFile, ...]
    imported: bool = False
    """True for photographs of others."""

    @property
    def place(self) -> str:
        """Return its folder in the dataset."""
        return f"{self.track}/{self.scene}"


@dataclass(frozen=True, slots=True)
class Publication:
    """Facts that only the one who publishes a dataset knows."""

    license: str = ""
    """Licence of the data: a name of SPDX, or an address. Empty: that of rendered scenes."""
    url: str = "https://example.org/"
    """Address where people find the data."""
    date: str = ""
    """Day, ISO 8601."""


@dataclass(frozen=True, slots=True)
class Survey:
    """A dataset."""

    name: str
    version: str
    """Version of the graycard that describes it."""
    scenes: tuple[SceneFacts, ...]
    size: int
    """Bytes of all files of its scenes."""

    @property
    def imported(self) -> int:
        """Return the number of scenes that are photographs of others."""
        return sum(scene.imported for scene in self.scenes)

    @property
    def tracks(self) -> tuple[str, ...]:
        """Return the tracks that have scenes."""
        return tuple(dict.fromkeys(scene.track for scene in self.scenes))

    @property
    def families(self) -> tuple[str, ...]:
        """Return the families of its scenes, sorted."""
        return tuple(sorted({scene.family for scene in self.scenes if scene.family}))


def survey(dataset: Path, version: str) -> Survey:
    """Read the manifests of a dataset; its images stay unread.

    Args:
        dataset: A folder with ``<track>/<scene>/``.
        version: Version of graycard.

    Raises:
        DatasetError: There is no scene, or a manifest is damaged.
    """
    folders = capture_folders(dataset)
    if not folders or folders == [dataset.resolve()]:
        raise DatasetError(
            f"expected a dataset with <track>/<scene>/capture at {dataset}, got "
            f"{'a scene: name the folder above its track' if folders else 'none'}"
        )
    scenes = tuple(_scene(dataset, folder) for folder in folders)
    size = sum(path.stat().st_size for folder in folders for path in folder.rglob("*") if path.is_file())
    return Survey(dataset.resolve().name, version, scenes, size)


def _scene(dataset: Path, folder: Path) -> SceneFacts:
    capture = open_capture(folder / "capture", check=False)
    found = has_truth(folder)
    told = read_manifest(folder / "truth", "graycard-truth") if found else None
    settings = dict(told.settings) if told else {}
    camera = (*capture.train, *capture.test)[0].camera
    size = camera.width, camera.height, len(capture.train), len(capture.test)
    imported = is_in_display_white(folder)
    family = "" if imported else str(settings.get("family", ""))
    named = capture.track, capture.scene, family, _seed(told)
    return SceneFacts(*named, *size, found, settings, tuple(_manifests(dataset, folder)), imported)


def _seed(told: Manifest | None) -> int | None:
    seed = told.seeds.get("scene") if told else None
    return None if seed is None or seed in SECRET_SEEDS else seed  # None would be sought one by one


def _manifests(dataset: Path, folder: Path) -> list[ManifestFile]:
    found = []
    for part, kind in PARTS.items():
        path = folder / part / MANIFEST
        if path.is_file():
            where = path.relative_to(dataset).as_posix()
            listed = len(read_manifest(folder / part, kind).files)
            found.append(ManifestFile(where, sha256(path), path.stat().st_size, listed))
    return found
