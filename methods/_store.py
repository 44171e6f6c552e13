# SPDX-License-Identifier: Apache-2.0
"""A decomposition on disk: ``decomposition.json`` says what it is, ``arrays.safetensors`` holds numbers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from graycard import MethodError, read_json, write_bytes, write_json

INDEX, ARRAYS = "decomposition.json", "arrays.safetensors"


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
    contiguous = {name: np.ascontiguousarray(values) for name, values in arrays.items()}
    write_bytes(Path(folder) / ARRAYS, save(contiguous))
    write_json(Path(folder) / INDEX, {"method": method, "facts": dict(facts)})


def restore(folder: Path, method: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The facts and arrays that :func:`store` wrote.

    Raises:
        MethodError: They are missing, damaged, or of another method.
    """
    index = read_json(Path(folder) / INDEX, MethodError)
    if not isinstance(index, dict) or index.get("method") != method:
        came = index.get("method") if isinstance(index, dict) else index
        raise MethodError(f"expected a decomposition by {method!r} in {folder}, got one by {came!r}")
    try:
        return dict(index["facts"]), load_file(Path(folder) / ARRAYS)
    except (OSError, KeyError, SafetensorError) as cause:
        raise MethodError(
            f"expected a whole decomposition in {folder}, got a damaged one: {cause}"
        ) from cause
