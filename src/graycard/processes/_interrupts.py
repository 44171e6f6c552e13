# SPDX-License-Identifier: Apache-2.0
"""Let whoever clears away finish, also when told to end meanwhile."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_TOLD_TO_END = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold back SIGINT and SIGTERM until the block ends; for blocks that take seconds at most.

    Handlers are exchanged and signals not masked: any thread of the process may receive a signal, and the
    main thread handles it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # handlers run in the main thread: nothing interrupts this one
        return
    came: list[int] = []
    before = {number: signal.signal(number, lambda got, _: came.append(got)) for number in _TOLD_TO_END}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        if came:
            signal.raise_signal(came[0])
