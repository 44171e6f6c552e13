# SPDX-License-Identifier: Apache-2.0
"""A salt: random bytes in a file that its owner alone may read, known to others by their SHA-256."""

import hashlib
import hmac
import os
import secrets
import stat
import sys
from dataclasses import dataclass, field
from pathlib import Path

from graycard import OutputError, RecordError
from graycard.dataset import SECRET_SEEDS
from graycard.io import output_error

BYTES = 32
"""Length of a salt: nobody finds it by trying."""
_RULE = "graycard-secret-1"
"""Name and version of the way in which seeds follow from a salt."""


@dataclass(frozen=True, slots=True)
class Salt:
    """The bytes that seeds follow from.

    Raises:
        ValueError: They are not as many as they should be.
    """

    content: bytes = field(repr=False)

    def __post_init__(self) -> None:
        if len(self.content) != BYTES:
            raise ValueError(f"expected a salt of {BYTES} bytes, got {len(self.content)}")

    @property
    def commitment(self) -> str:
        """SHA-256 of the salt in hexadecimal: what a suite publishes before the salt is opened."""
        return hashlib.sha256(self.content).hexdigest()

    def seed(self, track: str, family: str, number: int) -> int:
        """Return the seed of a secret scene: the first 63 bits of HMAC-SHA256 over kind and number.

        Args:
            track: Of the scene.
            family: Of the scene.
            number: Its place among the secret scenes of the suite, from 1 on.
        """
        kind = f"{_RULE}/{track}/{family}/{number}"
        digest = hmac.digest(self.content, kind.encode(), "sha256")
        return SECRET_SEEDS.start + (int.from_bytes(digest[:8]) >> 1)


def write_salt(path: Path) -> Salt:
    """Draw a new salt and write it to a file that its owner alone may read.

    Raises:
        OutputError: There is a file already, or the folder cannot be written to.
    """
    salt = Salt(secrets.token_bytes(BYTES))
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
    except FileExistsError as cause:
        raise OutputError(
            f"expected a new file for a salt, got {path}, which is there already. Choose another: a salt "
            "that is overwritten takes its secret scenes with it"
        ) from cause
    except OSError as cause:
        raise output_error(path, cause) from cause
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(f"{salt.content.hex()}\n")
    return salt


def read_salt(path: Path) -> Salt:
    """Return the salt in a file.

    Raises:
        RecordError: There is no such file, or it holds something else than the bytes in hexadecimal.
    """
    expected = f"expected a salt at {path}: {2 * BYTES} hexadecimal digits"
    mend = "Name the file that `graycard salt new` wrote"
    if Path(path).exists() and not Path(path).is_file():
        raise RecordError(f"{expected}, got what is no file. {mend}")  # a pipe waits, a device has no end
    try:
        with Path(path).open("rb") as file:
            text = file.read(1000).decode("ascii").strip()
    except OSError as cause:
        raise RecordError(f"{expected}, got {cause.strerror or cause}. {mend}") from cause
    except UnicodeDecodeError as cause:
        raise RecordError(f"{expected}, got a file that is no text. {mend}") from cause
    digits = len(text)
    if digits != 2 * BYTES:
        raise RecordError(f"{expected}, got {digits} characters. {mend}")
    try:
        return Salt(bytes.fromhex(text))
    except ValueError as cause:  # not quoted: it may be a salt with a slip of the pen
        raise RecordError(f"{expected}, got other characters. {mend}") from cause


def is_exposed(path: Path) -> bool:
    """Tell whether others than the owner may read a file; false where files have no such rights."""
    return sys.platform != "win32" and bool(Path(path).stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO))
