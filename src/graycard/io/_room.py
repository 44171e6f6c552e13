# SPDX-License-Identifier: Apache-2.0
"""Room for what a fit keeps of each view: memory up to a limit, then files that the system maps.

A photograph of 800 x 800 pixels takes 8 MB, with its layers some ten times as much, and a capture may have
hundreds. The system reads pages of a mapped file when they are needed, and drops them when memory is short.
"""

from __future__ import annotations

import resource
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from graycard.io._files import output_error
from graycard.io._memory import hand_back_freed_memory
from graycard.resources import usable_memory

if TYPE_CHECKING:
    import torch

SHARE = 1 / 32
"""Share of the usable memory that one kind of record may take: a fit has about six of them at a time."""
SMALL = 1 << 16
"""Bytes up to which an array always stays in memory, such as a camera's."""

RecordT = TypeVar("RecordT")


class Room:
    """Keeps arrays and tensors of one kind of record, such as the photographs of a fit."""

    def __init__(self, limit: int | None = None) -> None:
        """Make room.

        Args:
            limit: Bytes that may stay in memory; None: a share of what this process may use.
        """
        self.left = int(SHARE * _memory()) if limit is None else limit

    def keep(self, record: RecordT) -> RecordT:
        """Return a record with the same values, which are in memory or in a file.

        Args:
            record: An array, a tensor without gradient, or a dataclass, tuple or mapping of such. What is
                neither, and what is on a GPU, stays as it is. Files are those of this process alone, have no
                name, and go with their arrays.

        Raises:
            OutputError: The folder of temporary files cannot be written to, or the disk is full.
        """
        return cast(RecordT, self._kept(record))

    def _kept(self, record: Any) -> Any:
        if _is_tensor(record):
            of_cpu = record.device.type == "cpu"
            fits = not of_cpu or self._fits(record.numel() * record.element_size())
            return record if fits else mapped(record.detach().numpy())
        if isinstance(record, np.ndarray):
            return record if self._fits(record.nbytes) else mapped(record).numpy()
        if is_dataclass(record) and not isinstance(record, type):
            parts = {one.name: getattr(record, one.name) for one in fields(record) if one.init}
            found = {name: self._kept(value) for name, value in parts.items()}
            changed = {name: value for name, value in found.items() if value is not parts[name]}
            return replace(record, **changed) if changed else record
        if isinstance(record, Mapping):
            return {name: self._kept(value) for name, value in record.items()}
        if isinstance(record, tuple):
            values = [self._kept(value) for value in record]
            return type(record)(*values) if hasattr(record, "_fields") else tuple(values)
        return record

    def _fits(self, size: int) -> bool:
        """Take room for so many bytes, if they stay in memory."""
        if SMALL < size <= self.left:
            self.left -= size
            return True
        return size <= SMALL


def _memory() -> int:
    """Return the memory that this process may use, in bytes: the limit of a fit counts, too."""
    limit, _ = resource.getrlimit(resource.RLIMIT_DATA)
    return usable_memory() if limit == resource.RLIM_INFINITY else min(limit, usable_memory())


def _is_tensor(record: object) -> bool:
    """Tell whether a record is a tensor; there is none where nobody has imported torch, which takes long."""
    torch = sys.modules.get("torch")
    return torch is not None and isinstance(record, torch.Tensor)


def mapped(values: np.ndarray) -> torch.Tensor:
    """Return a tensor of the same values, in C order, whose memory is a file without a name.

    The file is written before it is mapped: a write to a page for which the disk has no room would end the
    process.

    Raises:
        OutputError: The folder of temporary files cannot be written to, or the disk is full.
    """
    import torch  # NumPy's way to map a file holds it open, and a process may open a thousand

    hand_back_freed_memory()  # memory is short, and the values that are mapped leave a hole
    dtype = torch.from_numpy(np.empty(0, values.dtype)).dtype
    try:
        with tempfile.NamedTemporaryFile(prefix="graycard-view-") as file:
            file.write(np.ascontiguousarray(values).data)
            file.flush()
            return torch.from_file(file.name, True, values.size, dtype=dtype).view(values.shape)
    except OSError as cause:
        raise output_error(Path(tempfile.gettempdir()), cause) from cause
