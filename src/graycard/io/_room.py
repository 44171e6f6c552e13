# SPDX-License-Identifier: Apache-2.0
"""Room for what a fit keeps of each view: memory up to a limit, then files that the system maps.

A photograph of 800 x 800 pixels takes 8 MB, with its layers some ten times as much, and a capture may have
hundreds. The system reads pages of a mapped file when they are needed, and drops them when memory is short.
Files lie in the folder of temporary files, ``TMPDIR``: on a disk, for what lies in memory itself (``tmpfs``)
is not dropped.
"""

from __future__ import annotations

import math
import resource
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast

import numpy as np

from graycard.io._memory import hand_back_freed_memory, keep_freed_memory
from graycard.resources import free_memory

if TYPE_CHECKING:
    import torch

SHARE = 1 / 32
"""Share of the free memory that one kind of record may take: a fit has six to nine of them at a time."""
SMALL = 1 << 16
"""Bytes up to which an array always stays in memory, such as a camera's."""

RecordT = TypeVar("RecordT")


class Room:
    """Keeps arrays and tensors of one kind of record, such as the photographs of a fit.

    ``with Room() as room:`` goes round a loop that reads such records and does little else. There memory of
    what went into files is handed back to the system at once. Elsewhere arrays are made faster without.
    """

    def __init__(self, limit: int | None = None) -> None:
        """Make room.

        Args:
            limit: Bytes that may stay in memory; None: a share of what this process may use.
        """
        self.left = int(SHARE * _memory()) if limit is None else limit
        self.fails = False
        self._reads = self._hands_back = False
        self._met: dict[int, Any] = {}

    def __enter__(self) -> Self:
        """Begin to read records."""
        self._reads = True
        return self

    def __exit__(self, *raised: object) -> None:
        """Keep freed memory again for the next array."""
        if self._hands_back:
            keep_freed_memory()
        self._reads = self._hands_back = False

    def keep(self, record: RecordT) -> RecordT:
        """Return a record with the same values, which are in memory or in a file.

        Where no file can be written, as on a full disk, they stay in memory, and so does all that follows.

        Args:
            record: An array, a tensor, or a dataclass, tuple or mapping of such. What is neither, arrays of
                kinds that torch has not, and tensors on a GPU stay as they are. Fits on a GPU copy what they
                look at to its memory. Files have no name, and go with their arrays.

        Raises:
            ValueError: A tensor has a gradient.
        """
        self._met = {}
        kept = cast(RecordT, self._kept(record))
        self._met = {}
        return kept

    def joined(self, parts: Iterable[np.ndarray]) -> np.ndarray:
        """Return what arrays hold, one after another along their first axis, as :func:`numpy.concatenate`.

        Args:
            parts: One or more, as what each view knows. They are taken one by one, and take room until they
                are joined: a generator need not hold them all.

        Raises:
            ValueError: Types or shapes differ.
        """
        left = self.left
        kept = [self.keep(part) for part in parts]
        taken = left - self.left
        if len({(part.dtype, part.shape[1:]) for part in kept}) != 1:
            raise ValueError(f"expected parts of one type and shape, got {[p.shape for p in kept]}")
        found = None
        if _is_mappable(kept[0]) and not self._fits(sum(part.nbytes for part in kept)):
            found = self._in_file(kept)
        self.left += taken
        return np.concatenate(kept) if found is None else found.numpy()

    def _kept(self, record: Any) -> Any:
        if _is_tensor(record) or isinstance(record, np.ndarray):
            if id(record) not in self._met:  # a record may hold the same values twice
                array = isinstance(record, np.ndarray)
                self._met[id(record)] = self._array(record) if array else self._tensor(record)
            return self._met[id(record)]
        if is_dataclass(record) and not isinstance(record, type):
            parts = {one.name: getattr(record, one.name) for one in fields(record) if one.init}
            changed = {name: new for name, old in parts.items() if (new := self._kept(old)) is not old}
            return replace(record, **changed) if changed else record
        if isinstance(record, Mapping):
            found = {name: self._kept(value) for name, value in record.items()}
            return found if any(found[name] is not record[name] for name in found) else record
        if isinstance(record, tuple):
            values = [self._kept(value) for value in record]
            if all(new is old for new, old in zip(values, record, strict=True)):
                return record
            return type(record)(*values) if hasattr(record, "_fields") else tuple(values)
        return record

    def _tensor(self, values: torch.Tensor) -> torch.Tensor:
        if values.requires_grad:
            raise ValueError("expected tensors without gradient, got one that has it")
        if values.device.type != "cpu" or self._fits(values.numel() * values.element_size()):
            return values
        found = self._in_file([values.numpy()])
        return values if found is None else found

    def _array(self, values: np.ndarray) -> np.ndarray:
        if not _is_mappable(values) or self._fits(values.nbytes):
            return values
        found = self._in_file([values])
        return values if found is None else found.numpy()

    def _in_file(self, parts: Sequence[np.ndarray]) -> torch.Tensor | None:
        """Return what is mapped; None, from the first time on, where that fails."""
        if self.fails:
            return None
        try:
            found = mapped(parts)
        except (OSError, RuntimeError):  # torch raises the latter where the system maps no more
            self.fails = True
            return None
        if self._reads:  # memory is short, and the values that were mapped leave a hole
            self._hands_back = hand_back_freed_memory()
        return found

    def _fits(self, size: int) -> bool:
        """Take room for so many bytes, if they stay in memory."""
        if SMALL < size <= self.left:
            self.left -= size
            return True
        return size <= SMALL


def _memory() -> int:
    """Return the memory that this process may still use, in bytes: the limit of a fit counts, too."""
    limit, _ = resource.getrlimit(resource.RLIMIT_DATA)
    return free_memory() if limit == resource.RLIM_INFINITY else min(limit, free_memory())


def _is_tensor(record: object) -> bool:
    """Tell whether a record is a tensor; there is none where nobody has imported torch, which takes long."""
    torch = sys.modules.get("torch")
    return torch is not None and isinstance(record, torch.Tensor)


def _is_mappable(values: np.ndarray) -> bool:
    """Tell whether torch has the kind of an array."""
    return type(values) is np.ndarray and values.dtype.kind in "biuf" and values.dtype.isnative


def mapped(parts: Sequence[np.ndarray]) -> torch.Tensor:
    """Return a tensor of what arrays hold, one after another, in C order, whose memory is a nameless file.

    The file is written before it is mapped: a write to a page for which the disk has no room would end the
    process.

    Args:
        parts: One or more of one type, whose shapes differ along the first axis alone.

    Raises:
        OSError: The folder of temporary files cannot be written to, or the disk is full.
        RuntimeError: The system maps no more files.
    """
    import torch  # NumPy's way to map a file holds it open, and a process may open a thousand

    dtype = torch.from_numpy(np.empty(0, parts[0].dtype)).dtype
    shape = (sum(map(len, parts)), *parts[0].shape[1:])
    with tempfile.NamedTemporaryFile(prefix="graycard-view-") as file:
        for part in parts:
            file.write(np.ascontiguousarray(part).data)
        file.flush()
        found = torch.from_file(file.name, True, math.prod(shape), dtype=dtype).view(shape)
    return found
