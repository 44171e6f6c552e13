# SPDX-License-Identifier: Apache-2.0
"""The identity of an installed graycard: hashes that its wheel lists, and files that have them no longer."""

import base64
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.machinery import EXTENSION_SUFFIXES, SOURCE_SUFFIXES
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

import graycard
from graycard.io import sha256

_CODE = tuple(SOURCE_SUFFIXES + EXTENSION_SUFFIXES)


@dataclass(frozen=True, slots=True)
class Installed:
    """The wheel that graycard was installed from, and whether its files still are those of the wheel."""

    version: str
    sha256: str
    """Over the names and hashes of the package's files, as RECORD lists them: the same wherever the wheel is
    installed."""
    changed: tuple[str, ...]
    """Files that are not as listed, are missing, or are code that is not listed."""
    commit: str = ""
    """Commit of the repository that pip took the code from; empty where it took a wheel."""


def find_installed(root: Path | None = None) -> Installed | None:
    """Return the identity of the installed graycard that runs; None for a checkout.

    Args:
        root: Folder of the package; that of the graycard that runs by default.
    """
    root = Path(graycard.__file__).resolve().parent if root is None else root
    try:
        found = distribution("graycard")
    except PackageNotFoundError:
        return None
    listed = {
        path.relative_to(root).as_posix(): digest
        for path, digest in hashes_of(found).items()
        if path.is_relative_to(root)
    }
    if "__init__.py" not in listed:
        return None
    lines = "".join(f"{name} {digest}\n" for name, digest in sorted(listed.items()))
    whole = hashlib.sha256(lines.encode()).hexdigest()
    return Installed(found.version, whole, tuple(_changed(root, listed)), _commit(found))


def hashes_of(found: Distribution) -> dict[Path, str]:
    """Return SHA-256 of the files of an installed distribution, as it lists them."""
    return {
        Path(str(file.locate())).resolve(): base64.urlsafe_b64decode(f"{file.hash.value}==").hex()
        for file in found.files or ()
        if file.hash is not None and file.hash.mode == "sha256"
    }


def _changed(root: Path, listed: Mapping[str, str]) -> list[str]:
    here = {path.relative_to(root).as_posix() for path in root.rglob("*") if path.name.endswith(_CODE)}
    other = {name for name, digest in listed.items() if _digest(root / name) != digest}
    return sorted(other | (here - listed.keys()))


def _digest(path: Path) -> str:
    try:
        return sha256(path)
    except OSError:
        return ""


def _commit(found: Distribution) -> str:
    """Return the commit in direct_url.json, as ``pip install git+URL`` writes it (PEP 610)."""
    try:
        told = json.loads(found.read_text("direct_url.json") or "{}")
        return str(told["vcs_info"]["commit_id"])
    except (ValueError, KeyError, TypeError):
        return ""
