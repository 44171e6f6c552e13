# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels that a confined process uses or makes, in the cache of all processes."""

import os
import shutil
from collections.abc import Iterable
from pathlib import Path

from graycard import OutputError
from graycard.io import atomic_path, file_lock
from graycard.methods._kernel_places import kernel_root


def note_use(folders: Iterable[str]) -> None:
    """Note that folders of kernels are in use; unknown names are passed over."""
    root = kernel_root(os.environ.get("NUMBA_CACHE_DIR"))
    for name in folders:
        place = root / Path(str(name)).name
        if place.is_dir() and not place.is_symlink():
            os.utime(place)


def keep_kernels(made: Path, since: float) -> None:
    """Take kernels that a confined process has compiled into the cache of all processes.

    Compiled kernels are code: take only those of processes in which graycard's own code ran.

    Args:
        made: The folder of compiled kernels of that process, with links to those that it found.
        since: When it found them, seconds since 1970: what others have changed after that stays.
    """
    root = kernel_root(os.environ.get("NUMBA_CACHE_DIR"))
    new = [path for path in made.glob("*/*.nbi") if path.is_file() and not path.is_symlink()]
    if not new:
        return
    try:
        with file_lock(root / "keeping", lambda who: None):
            for index in new:
                _keep(index, root / index.parent.name / index.name, since)
    except (OSError, OutputError):
        return  # a cache is not worth a fit: the next one compiles again


def _keep(index: Path, target: Path, since: float) -> None:
    """Take the kernels of one function, its index last; two processes may have compiled different ones."""
    if target.exists() and target.stat().st_mtime > since:
        return
    stem = index.name.removesuffix("nbi")
    data = [p for p in index.parent.glob(f"{stem}*.nbc") if p.is_file() and not p.is_symlink()]
    for path in (*data, index):
        with atomic_path(target.with_name(path.name)) as partial:
            shutil.copyfile(path, partial)
