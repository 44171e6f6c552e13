# SPDX-License-Identifier: Apache-2.0
"""A decomposition on disk: ``decomposition.json`` says what it is, ``arrays.safetensors`` holds numbers."""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import load, save

from graycard import GraycardError, MethodError
from graycard.io import read_bytes, read_json, write_bytes, write_json

INDEX, ARRAYS = "decomposition.json", "arrays.safetensors"
_DAMAGE = (OSError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RuntimeError)
"""Errors of code that is handed facts and arrays of a stranger, also where they are graycard's own."""


def store(folder: Path, method: str, facts: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    """Write a decomposition; the index comes last.

    Args:
        folder: Where to.
        method: Name of the method, checked by :func:`restore`.
        facts: JSON data.
        arrays: Contiguous arrays by name.

    Raises:
        OutputError: The folder cannot be written to, or the disk is full.
    """
    data = save({name: np.ascontiguousarray(values) for name, values in arrays.items()})
    write_bytes(Path(folder) / ARRAYS, data)
    digest = hashlib.sha256(data).hexdigest()
    write_json(Path(folder) / INDEX, {"method": method, "facts": dict(facts), "sha256": digest})


def restore(folder: Path, method: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the facts and arrays that :func:`store` wrote.

    Raises:
        MethodError: They are missing, damaged, or of another method.
    """
    index = read_json(Path(folder) / INDEX, MethodError)
    if not isinstance(index, dict) or index.get("method") != method:
        came = index.get("method") if isinstance(index, dict) else index
        raise MethodError(f"expected a decomposition by {method!r} in {folder}, got one by {came!r}")
    with whole_decomposition(folder):
        data = read_bytes(Path(folder) / ARRAYS)
        if hashlib.sha256(data).hexdigest() != index["sha256"]:
            raise ValueError(f"{ARRAYS} is not the one that {INDEX} was written for")
        return dict(index["facts"]), load(data)


@contextmanager
def whole_decomposition(folder: Path) -> Iterator[None]:
    """Say of a decomposition that it is damaged where its facts or arrays are not those that are expected.

    Raises:
        MethodError: The block met a value that is missing, of another type, or of another shape.
    """
    try:
        yield
    except Exception as cause:
        if isinstance(cause, GraycardError) and not isinstance(cause, _DAMAGE):
            raise
        what = f"no {cause}" if isinstance(cause, KeyError) else str(cause).partition("\n")[0]
        raise MethodError(f"expected a whole decomposition in {folder}, got a damaged one: {what}") from cause
