# SPDX-License-Identifier: Apache-2.0
"""Manifest of a dataset folder: format version, origin, and the SHA-256 of each file.

The manifest is written last, so a folder without one is half-written and is never read as data.
"""

import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from graycard._errors import DatasetError, NewerFormatError
from graycard.io._files import sha256_of_files, strange_entries
from graycard.io._json import check_version, from_builtins, read_json, write_json
from graycard.io._names import Name, RelativePath

MANIFEST = "manifest.json"
FORMAT_VERSION = 1
"""Version of the dataset format that this graycard writes, and the newest that it reads."""


@dataclass(frozen=True, slots=True)
class Manifest:
    """The index of a capture, a truth, or held-out photographs."""

    format: Literal["graycard-capture", "graycard-truth", "graycard-held-out"]
    format_version: int
    track: Name
    scene: Name
    generator: Mapping[str, Any]
    """Who made it: names and versions, renderer variant."""
    seeds: Mapping[str, int]
    settings: Mapping[str, Any]
    """Scene knobs and render settings; empty in a capture, which must not tell the scene."""
    files: Mapping[RelativePath, str] = field(default_factory=dict)
    """SHA-256 of each file by its path relative to the folder."""


def write_manifest(folder: Path, manifest: Manifest) -> Manifest:
    """Hash every file below ``folder`` and write its manifest, last of all."""
    files = sha256_of_files(folder, skip=lambda name: name == MANIFEST)
    sealed = replace(manifest, files=files)
    write_json(folder / MANIFEST, sealed)
    return sealed


def read_manifest(folder: Path, kind: str) -> Manifest:
    """Return the manifest of a folder; its files are not yet checked.

    Raises:
        DatasetError: There is none, it is of another kind, or of a newer format version.
    """
    path = Path(folder) / MANIFEST
    if not path.is_file():
        raise DatasetError(
            f"expected a dataset folder with {MANIFEST} at {folder}, got "
            f"{'a folder without one: its rendering was cut off' if Path(folder).is_dir() else 'nothing'}. "
            f"Run `graycard render` (again){_command(Path(folder))}"
        )
    data = read_json(path, DatasetError)
    check_version(data, FORMAT_VERSION, path, NewerFormatError)
    manifest = from_builtins(Manifest, data, DatasetError, str(path))
    if manifest.format != kind:
        raise DatasetError(f"expected a {kind} folder at {folder}, got a {manifest.format} folder")
    return manifest


def _command(folder: Path) -> str:
    """Return the command that makes a scene that is not there, if its path tells family and seed."""
    if folder.exists() or len(folder.parts) < 4:
        return ""
    scene = re.fullmatch(r"([a-z]+(?:-[a-z]+)*)-(\d+)", folder.parent.name)
    track, dataset = folder.parents[1].name, shlex.quote(str(folder.parents[2]))
    return f": graycard render {track} --family {scene[1]} --seed {scene[2]} --out {dataset}" if scene else ""


def damaged_files(folder: Path, manifest: Manifest) -> dict[str, str]:
    """Files that are missing, differ from the manifest, or are not in it, each with what is wrong."""
    found = sha256_of_files(Path(folder), skip=lambda name: name == MANIFEST)
    faults = {name: "missing" for name in manifest.files if name not in found} | strange_entries(Path(folder))
    for name, digest in found.items():
        expected = manifest.files.get(name)
        if expected is None:
            faults[name] = f"not in {MANIFEST}"
        elif digest != expected:
            faults[name] = f"expected SHA-256 {expected[:12]}…, got {digest[:12]}…"
    return faults


def check_files(folder: Path, manifest: Manifest) -> None:
    """Prove that each file is the one that was written.

    Raises:
        DatasetError: A file is missing or differs; the message names it.
    """
    faults = damaged_files(folder, manifest)
    if faults:
        name, fault = next(iter(faults.items()))
        raise DatasetError(
            f"expected the files of {folder} to be as they were written, got {len(faults)} that are not, "
            f"the first {name}: {fault}. Run `graycard render` again: it makes the damaged files anew"
        )
