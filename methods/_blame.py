# SPDX-License-Identifier: Apache-2.0
"""Whose error it is: a method's code is somebody else's, and must not end what others do."""

from collections.abc import Iterator
from contextlib import contextmanager

from graycard import GraycardError, MethodError, OutputError


@contextmanager
def blame(method: str) -> Iterator[None]:
    """Around calls of a method's code: whatever it raises is an error of the method.

    An ``OutputError`` too: where the method cannot write its own files, there may be room for those of
    others. Other errors that the user can mend pass as they are, and so does Ctrl+C.

    Args:
        method: Its name, for the message.

    Raises:
        MethodError: The method raised something that is no ``GraycardError``, or an ``OutputError``.
    """
    try:
        yield
    except KeyboardInterrupt:
        raise
    except BaseException as cause:  # SystemExit too
        if isinstance(cause, GraycardError) and not isinstance(cause, OutputError):
            raise
        raise MethodError(
            f"method {method!r} failed with {type(cause).__name__}: {words_of(cause)}"
        ) from cause


def words_of(error: BaseException) -> str:
    """Return what an exception says, as text that can be written to a file, even if saying it fails."""
    try:
        return str(error).encode(errors="replace").decode()
    except Exception:  # a method's own exception may be broken too
        return "(it cannot say what)"
