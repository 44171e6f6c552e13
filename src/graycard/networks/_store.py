# SPDX-License-Identifier: Apache-2.0
"""The user's cache of weights: whole files or none, and each is what its hash says."""

import hashlib
import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
from platformdirs import user_cache_path
from safetensors import SafetensorError
from safetensors.numpy import load_file, save_file

from graycard._errors import WeightsError
from graycard.io import atomic_path
from graycard.networks._sources import find_file

HOME = "GRAYCARD_WEIGHTS"
"""Environment variable that names the folder of fetched weights; without it they are in the user's cache."""


def weights_home() -> Path:
    """Return the folder of fetched weights; it need not exist."""
    chosen = os.environ.get(HOME)
    return Path(chosen) if chosen else user_cache_path("graycard") / "weights"


def weights_path(name: str) -> Path:
    """Return where a file of weights lies, or would lie."""
    return weights_home() / f"{name}.safetensors"


def digest_of(tensors: Mapping[str, np.ndarray]) -> str:
    """Return SHA-256 over names, types, shapes and values, in the order of the names, in hexadecimal."""
    found = hashlib.sha256()
    for name in sorted(tensors):
        array = np.ascontiguousarray(tensors[name])
        found.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        found.update(array.data)
    return found.hexdigest()


def write_weights(name: str, tensors: Mapping[str, np.ndarray]) -> Path:
    """Write a file of weights whole or not at all, and return its path.

    Raises:
        WeightsError: The tensors are not those that the file has to hold.
        OutputError: It cannot be written.
    """
    _check(name, tensors, "the archive")
    path = weights_path(name)
    with atomic_path(path) as partial:
        save_file(dict(tensors), partial)
    return path


def read_weights(name: str) -> Mapping[str, np.ndarray]:
    """Return the tensors of a fetched file of weights, by name, float32; they cannot be written to.

    A file is read once for as long as it stays as it is.

    Raises:
        WeightsError: It was not fetched, or is not what was fetched.
    """
    whose, _ = find_file(name)
    path = weights_path(name)
    try:
        now = path.stat()
    except OSError as cause:
        raise WeightsError(
            f"expected weights at {path}, got none. Run `graycard weights {whose.name}`"
        ) from cause
    return _read(name, path, (now.st_mtime_ns, now.st_size, now.st_ino))


@lru_cache(maxsize=4)
def _read(name: str, path: Path, _: tuple[int, ...]) -> Mapping[str, np.ndarray]:
    """Return the tensors of a file; the last argument tells its states apart."""
    whose, _file = find_file(name)
    try:
        tensors = load_file(path)
    except (SafetensorError, OSError) as cause:
        raise WeightsError(
            f"expected weights at {path}, got a damaged file ({cause}). Run `graycard weights {whose.name}`"
        ) from cause
    _check(name, tensors, str(path))
    for array in tensors.values():
        array.flags.writeable = False
    return MappingProxyType(tensors)


def is_whole(name: str) -> bool:
    """Tell whether a file of weights is there and what it has to be."""
    try:
        read_weights(name)
    except WeightsError:
        return False
    return True


def _check(name: str, tensors: Mapping[str, np.ndarray], where: str) -> None:
    """Raise WeightsError unless the tensors are those that the file of a name has to hold."""
    whose, file = find_file(name)
    if (found := digest_of(tensors)) != file.digest:
        raise WeightsError(
            f"expected the tensors of {name} with digest {file.digest[:12]}, got {found[:12]} in {where}. "
            f"Run `graycard weights {whose.name}`"
        )
