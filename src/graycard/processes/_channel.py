# SPDX-License-Identifier: Apache-2.0
"""Messages between two processes of which one is not trusted: JSON and arrays of numbers, never objects."""

import json
import math
import select
import socket
import struct
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from graycard import GraycardError
from graycard.io import parse_json, to_builtins

_HEAD = struct.Struct(">Q")
_LONGEST_TEXT = 2**28
"""Bytes of the JSON of a message."""
_KINDS = "fiub"
"""Kinds of numbers that arrays may have: real numbers and truth values, as ``numpy.dtype.kind``."""
_LOOK_S = 0.2
"""Seconds between two looks whether the other side is still there."""


class ChannelError(Exception):
    """The other side ended, or sent what is no message."""


@dataclass(frozen=True, slots=True)
class Message:
    """One message."""

    kind: str
    data: Any = None
    """Data as in JSON."""
    arrays: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Numbers of any shape, by name."""


class Channel:
    """A socket that carries messages; several threads may send and ask."""

    def __init__(self, connection: socket.socket, is_alive: Callable[[], bool] = lambda: True) -> None:
        """Carry messages over a socket.

        Args:
            connection: A stream; it is closed with the channel.
            is_alive: Says whether the other side can still send; its children may keep the socket open.
        """
        self._socket, self._is_alive = connection, is_alive
        self._sending, self._asking = threading.Lock(), threading.RLock()

    def send(self, message: Message) -> None:
        """Send a message.

        Raises:
            ChannelError: The other side is gone.
            TypeError: An array is not of real numbers.
        """
        arrays = {name: np.ascontiguousarray(values) for name, values in message.arrays.items()}
        for name, values in arrays.items():
            if values.dtype.kind not in _KINDS:
                raise TypeError(f"expected real numbers in {name}, got {values.dtype}")
        layout = [
            [name, values.dtype.newbyteorder("<").str, np.shape(message.arrays[name])]
            for name, values in arrays.items()
        ]
        head = json.dumps(
            {"kind": message.kind, "data": to_builtins(message.data), "arrays": layout}
        ).encode()
        try:
            with self._sending:
                self._socket.sendall(_HEAD.pack(len(head)) + head)
                for values in arrays.values():
                    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
                    self._socket.sendall(little.reshape(-1).view(np.uint8).data)
        except OSError as cause:
            raise ChannelError("the other side is gone") from cause

    def receive(self) -> Message:
        """Return the next message.

        Raises:
            ChannelError: The other side has ended, or sent what is no message.
        """
        with self._asking:
            return self._received()

    def _received(self) -> Message:
        (length,) = _HEAD.unpack(self._exactly(_HEAD.size))
        if length > _LONGEST_TEXT:
            raise ChannelError(f"expected a message of at most {_LONGEST_TEXT} bytes, got {length}")
        try:
            found = parse_json(self._exactly(length).decode())
            kind, data, layout = found["kind"], found["data"], found["arrays"]
            arrays = {str(name): self._array(dtype, shape) for name, dtype, shape in layout}
        except (GraycardError, ValueError, TypeError, KeyError, MemoryError) as cause:
            raise ChannelError(f"expected a message, got none: {cause}") from cause
        return Message(str(kind), data, arrays)

    def ask(self, message: Message) -> Message:
        """Send a message and return the answer; what other threads ask waits.

        Raises:
            ChannelError: As of :meth:`send` and :meth:`receive`.
        """
        with self._asking:
            self.send(message)
            return self.receive()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _array(self, dtype: Any, shape: Any) -> np.ndarray:
        """Return the numbers of an array.

        Raises:
            ValueError: They are no real numbers, or more than there can be.
        """
        kind = np.dtype(str(dtype))
        if kind.kind not in _KINDS or not all(isinstance(n, int) and n >= 0 for n in shape):
            raise ValueError(f"expected real numbers and a shape, got {dtype} and {shape}")
        values = np.empty(math.prod(shape), kind)
        self._fill(values.view(np.uint8).data)
        return values.astype(kind.newbyteorder("="), copy=False).reshape(shape)

    def _exactly(self, count: int) -> bytearray:
        data = bytearray(count)
        self._fill(memoryview(data))
        return data

    def _is_ready(self, seconds: float) -> bool:
        """Wait for something to read, so long at most."""
        poll = select.poll()
        poll.register(self._socket, select.POLLIN)
        return bool(poll.poll(1000 * seconds))

    def _fill(self, target: memoryview) -> None:
        """Fill a buffer.

        Raises:
            ChannelError: The other side has ended.
        """
        done = 0
        while done < len(target):
            while not self._is_ready(_LOOK_S):
                if not self._is_alive() and not self._is_ready(0):  # what it sent before it ended counts
                    raise ChannelError("the other side has ended")
            try:
                count = self._socket.recv_into(target[done:])
            except OSError:
                count = 0
            if not count:
                raise ChannelError("the other side has closed its end")
            done += count
