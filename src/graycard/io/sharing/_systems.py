# SPDX-License-Identifier: Apache-2.0
"""Kinds of file systems: those of one machine, and those that several may share."""

import os
import re
import time
from functools import cache
from pathlib import Path

from graycard._errors import OutputError

LOCKS = "GRAYCARD_LOCKS"
"""Environment variable: ``kernel`` or ``files``, in place of what the file system's kind says."""
_LOCAL = {
    "apfs", "bcachefs", "btrfs", "erofs", "exfat", "ext2", "ext3", "ext4", "f2fs", "jfs", "ntfs3", "overlay",
    "ramfs", "reiserfs", "rootfs", "squashfs", "tmpfs", "vfat", "xfs", "zfs",
}  # fmt: skip
"""Kinds that one machine alone mounts."""
_MOUNTS = Path("/proc/self/mountinfo")
_LATE_S = 90.0
"""Time in which a file that another machine wrote shows: NFS keeps what it knows of a folder for a minute."""
_LOOK_S = 0.5


def kind_of(path: Path) -> str:
    """Return the kind of the file system that a path lies on, as ``nfs4``; empty if nobody knows."""
    folder = Path(os.path.realpath(path))
    while True:
        try:
            return _kind_of(os.stat(folder).st_dev, str(folder))
        except OSError:
            if folder == folder.parent:
                return ""
            folder = folder.parent  # what is not there yet will lie where its folder does


def is_shared(path: Path) -> bool:
    """Tell whether other machines may work below a path.

    There ``flock`` is not trusted: on NFS with ``local_lock``, or on Lustre with ``localflock``, it succeeds
    on two machines at once, and no call says so.

    Raises:
        OutputError: The environment variable :data:`LOCKS` has another value than its two.
    """
    if said := os.environ.get(LOCKS):
        if said not in ("files", "kernel"):
            raise OutputError(f"expected {LOCKS} to be files or kernel, got {said!r}. Mend or unset it")
        return said == "files"
    kind = kind_of(path)
    return bool(kind) and kind not in _LOCAL


def await_file(path: Path) -> None:
    """Wait for a file that another machine may just have written; not where one machine alone has files."""
    if path.exists() or not is_shared(path):
        return
    until = time.monotonic() + _LATE_S
    while not path.exists() and time.monotonic() < until:
        time.sleep(_LOOK_S)
        for folder in reversed(path.parents):
            _look_anew(folder)


def _look_anew(folder: Path) -> None:
    """Let the system ask the server for what a folder holds."""
    try:
        os.close(os.open(folder, os.O_RDONLY | os.O_CLOEXEC))
    except OSError:
        return


@cache
def _kind_of(device: int, folder: str) -> str:
    """Return the kind of the innermost mount around a folder; ``device`` tells later mounts apart."""
    try:
        lines = _MOUNTS.read_text(errors="replace").splitlines()
    except OSError:
        return ""
    found = ("", "")
    for line in lines:
        before, _, after = line.partition(" - ")
        point = _unescaped(before.split()[4])
        inside = folder == point or folder.startswith(point.rstrip("/") + "/")
        if inside and len(point) >= len(found[0]):  # of two at one point the later one is seen
            found = point, after.split()[0]
    return found[1]


def _unescaped(text: str) -> str:
    """Return a path of ``mountinfo``, which writes blanks in octal digits."""
    return re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), text)
