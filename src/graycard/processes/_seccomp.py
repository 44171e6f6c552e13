# SPDX-License-Identifier: Apache-2.0
"""Seccomp: the kernel refuses a process the system calls by which it could talk past Landlock.

Landlock closes TCP alone, and not what ends in TCP by another door: MPTCP, fast open, listening without an
address. It leaves UDP, Unix sockets with a path, and what no folder holds: shared memory of System V, message
queues, keys and extended attributes, by which one fit could tell another. The filter binds what is forked and
started from now on, and cannot be lifted (https://docs.kernel.org/userspace-api/seccomp_filter.html).

CUDA does not start without a Unix socket that it binds and listens on (seen with driver 580). Where a GPU of
NVIDIA is, such sockets may be made, and every call that would reach another through them is refused.
"""

import ctypes
import errno
import platform
import struct
import sys
from collections.abc import Iterator

_SET_FILTER, _FILTER = 22, 2
"""Option of prctl, and mode that it sets (``linux/prctl.h``, ``linux/seccomp.h``)."""
_NO_NEW_PRIVILEGES = 38
_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000 | errno.EACCES
_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06
"""Instructions of classic BPF: load a word, jump if it equals or is at least a number, return."""
_NUMBER, _ARCHITECTURE = 0, 4
"""Places of the call's number and of its processor in what a filter sees."""
_FIRST_ARGUMENT, _ADDRESS = 16, (48, 52)
"""Places of a call's first argument, and of both halves of its fifth."""
_UNIX = 1
"""Family of sockets of this machine (``sys/socket.h``)."""
_X32 = 0x40000000
"""Bit of calls of a second kind on x86-64, whose numbers are others."""
_COMMON = (425, 463, 466)
"""io_uring_setup, which does all others by another door; setxattrat, removexattrat."""
_CALLS = {
    # socket, shmget, semget, msgget, mq_open, (l, f)setxattr, (l, f)removexattr, add_key, request_key, keyctl
    "x86_64": (0xC000003E, (41, 29, 64, 68, 240, 188, 189, 190, 197, 198, 199, 248, 249, 250)),
    "aarch64": (0xC00000B7, (198, 194, 190, 186, 180, 5, 6, 7, 14, 15, 16, 217, 218, 219)),
}
"""Number of each processor, and numbers of the refused calls on it (``asm/unistd.h``)."""


_SOCKET, _SEND_TO = {"x86_64": 41, "aarch64": 198}, {"x86_64": 44, "aarch64": 206}
_REACHING = {
    # connect, sendmsg, sendmmsg, accept, accept4
    "x86_64": (42, 46, 307, 43, 288),
    "aarch64": (203, 211, 269, 202, 242),
}
"""Calls besides ``sendto`` by which a socket reaches another."""


def refuse_calls(*, unix_sockets: bool = False) -> bool:
    """Refuse this thread, and all that it starts from now on, sockets and memory that others can reach.

    A pair of sockets (``socketpair``) and pipes stay.

    Args:
        unix_sockets: Whether Unix sockets may be made, bound and listened on. They cannot be connected, send
            to no address, and accept nobody.

    Returns:
        Whether it holds: on Linux, on processors whose calls are known here.
    """
    machine = platform.machine()
    architecture, calls = _CALLS.get(machine, (0, ()))
    if not sys.platform.startswith("linux") or not calls or sys.maxsize < 2**32:
        return False
    refused, judged = (*calls, *_COMMON), b""
    if unix_sockets:
        refused = (*(call for call in refused if call != _SOCKET[machine]), *_REACHING[machine])
        judged = b"".join(_unix_alone(_SOCKET[machine], _SEND_TO[machine]))
    code = b"".join(_instructions(architecture, refused, judged))
    instructions = ctypes.create_string_buffer(code, len(code))
    program = struct.pack("@HP", len(code) // 8, ctypes.addressof(instructions))
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0):
        return False
    return libc.prctl(_SET_FILTER, ctypes.c_ulong(_FILTER), program, 0, 0) == 0


def _unix_alone(socket: int, send_to: int) -> Iterator[bytes]:
    """Yield what refuses sockets of other families, and sending to an address, by the number of a call."""
    yield _coded(_EQUAL, socket, no=4)
    yield _coded(_LOAD, _FIRST_ARGUMENT)
    yield _coded(_EQUAL, _UNIX, yes=1)
    yield _coded(_RETURN, _REFUSE)
    yield _coded(_RETURN, _ALLOW)
    yield _coded(_EQUAL, send_to, no=5)
    yield _coded(_LOAD, _ADDRESS[0])
    yield _coded(_EQUAL, 0, no=2)
    yield _coded(_LOAD, _ADDRESS[1])
    yield _coded(_EQUAL, 0, yes=1)
    yield _coded(_RETURN, _REFUSE)


def _instructions(architecture: int, calls: tuple[int, ...], judged: bytes) -> Iterator[bytes]:
    """Yield the filter: calls of other processors and those listed are refused, all others allowed.

    Args:
        architecture: Number of the processor.
        calls: Those that are refused whatever their arguments.
        judged: Instructions that refuse others by their arguments.
    """
    yield _coded(_LOAD, _ARCHITECTURE)
    yield _coded(_EQUAL, architecture, yes=1)
    yield _coded(_RETURN, _REFUSE)
    yield _coded(_LOAD, _NUMBER)
    yield _coded(_AT_LEAST, _X32, yes=len(calls))
    for place, number in enumerate(calls, 1):
        yield _coded(_EQUAL, number, yes=len(calls) - place, no=int(place == len(calls)))
    yield _coded(_RETURN, _REFUSE)
    yield judged
    yield _coded(_RETURN, _ALLOW)


def _coded(code: int, operand: int, yes: int = 0, no: int = 0) -> bytes:
    """Return one instruction, which skips ``yes`` others where a comparison holds, and ``no`` where not."""
    return struct.pack("=HBBI", code, yes, no, operand)
