# SPDX-License-Identifier: Apache-2.0
"""Arrays whose header is damaged are named, whatever NumPy raises about them."""

import gzip
import io
from pathlib import Path

import numpy as np
import pytest

from graycard import DatasetError, PredictionError
from graycard.adoption._arrays import read_array
from graycard.methods.trained._frame import read_frame

SHAPES = {
    "a number that goes on as a word": b"(24pe': (24, 28)",
    "a bracket that is never closed": b"((((24, 28, ",
    "no tuple": b"[24, 28]",
    "a call": b"exit(24, 28)",
    "a text that is never closed": b"('24, 28)",
}


def damaged(shape: bytes) -> bytes:
    """An NPY whose header names another shape, at the same length."""
    buffer = io.BytesIO()
    np.save(buffer, np.zeros((24, 28), np.float32))
    data = buffer.getvalue()
    start = data.index(b"(24, 28)")
    return data[:start] + shape + data[start + len(shape) :]


@pytest.mark.parametrize("name", SHAPES)
def test_headers_that_are_damaged(tmp_path: Path, name: str) -> None:
    data = damaged(SHAPES[name])
    (tmp_path / "depth.npy").write_bytes(data)
    (tmp_path / "depth.npy.gz").write_bytes(gzip.compress(data))
    for file in ("depth.npy", "depth.npy.gz"):
        with pytest.raises(PredictionError, match=f"expected a whole file at .*{file}"):
            read_array(tmp_path / file)
    with pytest.raises(DatasetError, match="expected a matrix at .*depth.npy"):
        read_frame("matrix", tmp_path / "depth.npy")
