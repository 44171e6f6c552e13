# SPDX-License-Identifier: Apache-2.0
"""Secret scenes of a suite: of which kinds, how many, and which salt they follow from."""

import re
from dataclasses import dataclass

from graycard import RecordError
from graycard.benchmarks._ranges import SceneTemplate
from graycard.benchmarks.secret._salt import Salt
from graycard.dataset import SECRET_SEEDS
from graycard.synth import SecretSpec

MOST = 1000
"""Secret scenes of a suite."""
_SHA256 = re.compile("[0-9a-f]{64}")


@dataclass(frozen=True, slots=True)
class SecretScenes:
    """Scenes that nobody can render without the salt, the first of each kind first.

    Raises:
        ValueError: There are none, or the commitment is no SHA-256.
    """

    count: int
    """Number of scenes, of all kinds together."""
    commitment: str
    """SHA-256 of the salt, as ``graycard salt new`` prints it."""
    scenes: tuple[SceneTemplate, ...]
    """The kinds, one after the other."""

    def __post_init__(self) -> None:
        if not 1 <= self.count <= MOST:
            raise ValueError(f"expected 1 to {MOST} secret scenes, got {self.count}. Mend count")
        if not self.scenes:
            raise ValueError("expected one kind of secret scene or more, got none. Add some")
        if not _SHA256.fullmatch(self.commitment):
            raise ValueError(
                "expected a commitment of 64 hexadecimal digits in lower case, as `graycard salt new` prints "
                f"it, got {self.commitment[:80]!r}"
            )

    def drawn(self, salt: Salt | None = None) -> tuple[SecretSpec, ...]:
        """Return all scenes, in order.

        Args:
            salt: What their seeds follow from. None: names, kinds and knobs are right, seeds are not.

        Raises:
            RecordError: The salt is not that of the commitment.
        """
        if salt is not None:
            self.check(salt)
        return tuple(self._scene(number, salt) for number in range(self.count))

    def _scene(self, number: int, salt: Salt | None) -> SecretSpec:
        turn, kind = divmod(number, len(self.scenes))
        spec = self.scenes[kind].scene(0, turn)
        seed = SECRET_SEEDS.start if salt is None else salt.seed(spec.track, spec.family, number + 1)
        return SecretSpec(spec.track, spec.family, seed, spec.knobs, f"{spec.family}-secret-{number + 1:03d}")

    def check(self, salt: Salt) -> None:
        """Refuse a salt that is not that of the commitment.

        Raises:
            RecordError: It is another.
        """
        if salt.commitment != self.commitment:
            raise RecordError(
                f"expected the salt that the suite is committed to (SHA-256 {self.commitment[:12]}…), got "
                f"one of SHA-256 {salt.commitment[:12]}…. Name the right file with --salt"
            )
