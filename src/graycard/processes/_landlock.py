# SPDX-License-Identifier: Apache-2.0
"""Landlock: the kernel refuses a process all files and the network but for what is listed.

It binds every thread that is started later, every program that is started, and native code, and it cannot be
lifted again. Linux has it from 5.13 on (https://docs.kernel.org/userspace-api/landlock.html); no privilege is
needed. It does not refuse ``stat`` and ``chmod``.
"""

import ctypes
import os
import stat
import struct
import sys
from collections.abc import Iterable
from functools import cache

_CREATE, _ADD, _RESTRICT = 444, 445, 446
"""Numbers of the system calls, the same on all processors (``asm-generic/unistd.h``)."""
_VERSION = 1
"""Flag of the first call: tell the version."""
_BENEATH = 1
"""Type of a rule about a file, or a folder with all below."""
_NO_NEW_PRIVILEGES = 38
"""Option of prctl (``linux/prctl.h``)."""

EXECUTE, WRITE, READ, LIST = 1 << 0, 1 << 1, 1 << 2, 1 << 3
_CHANGE_FOLDER = sum(1 << bit for bit in range(4, 13))
"""To remove and make files of all kinds in a folder."""
_REFER, _TRUNCATE, _IOCTL = 1 << 13, 1 << 14, 1 << 15
_OF_FILES = EXECUTE | WRITE | READ | _TRUNCATE | _IOCTL
"""Rights that a rule about a file may give."""
_RIGHTS = {1: EXECUTE | WRITE | READ | LIST | _CHANGE_FOLDER, 2: _REFER, 3: _TRUNCATE, 5: _IOCTL}
"""Rights by the version that brought them."""
_TCP = 0b11
"""Bind and connect, from version 4 on."""
_OUTSIDE = 0b11
"""Abstract sockets of others and signals to others, from version 6 on."""

TO_READ = READ | LIST | EXECUTE
TO_WRITE = TO_READ | WRITE | _CHANGE_FOLDER | _REFER | _TRUNCATE
OF_DEVICES = READ | WRITE | LIST | _IOCTL


@cache
def landlock_version() -> int:
    """Return the version of Landlock that the kernel has; 0 for none."""
    if not sys.platform.startswith("linux"):
        return 0
    return max(0, _libc().syscall(_CREATE, None, ctypes.c_size_t(0), ctypes.c_uint32(_VERSION)))


def restrict(rules: Iterable[tuple[str, int]]) -> int:
    """Refuse this thread, and all that it starts from now on, every file and TCP, but for what rules open.

    Args:
        rules: Paths, each with the rights on it and on all below; one that is not there is passed over.

    Returns:
        The version of Landlock that holds; 0 where the kernel has none, and nothing is refused.

    Raises:
        OSError: The kernel refuses a rule.
    """
    version = landlock_version()
    if not version:
        return 0
    rights = sum(added for since, added in _RIGHTS.items() if since <= version)
    parts = [rights, _TCP, _OUTSIDE][: 1 if version < 4 else 2 if version < 6 else 3]
    attributes = struct.pack(f"={len(parts)}Q", *parts)
    rule_set = _called(_CREATE, attributes, ctypes.c_size_t(len(attributes)), ctypes.c_uint32(0))
    try:
        for path, allowed in rules:
            _add(rule_set, path, allowed & rights)
        if _libc().prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0):
            raise OSError(ctypes.get_errno(), "expected the kernel to keep privileges as they are")
        _called(_RESTRICT, ctypes.c_int(rule_set), ctypes.c_uint32(0))
    finally:
        os.close(rule_set)
    return version


def _add(rule_set: int, path: str, allowed: int) -> None:
    """Add a rule about a path, which is followed if it is a link."""
    try:
        file = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:
        return
    try:
        if not stat.S_ISDIR(os.fstat(file).st_mode):
            allowed &= _OF_FILES
        rule = struct.pack("=Qi", allowed, file)
        _called(_ADD, ctypes.c_int(rule_set), ctypes.c_int(_BENEATH), rule, ctypes.c_uint32(0))
    finally:
        os.close(file)


def _called(number: int, *arguments: object) -> int:
    """Make a system call.

    Raises:
        OSError: The kernel refuses it.
    """
    result = _libc().syscall(number, *arguments)
    if result < 0:
        raise OSError(ctypes.get_errno(), f"Landlock: {os.strerror(ctypes.get_errno())}")
    return result


@cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)
