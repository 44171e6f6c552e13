# SPDX-License-Identifier: Apache-2.0
"""The one family of errors that a user can mend; everything else is a bug of ours."""

from collections.abc import Iterable
from difflib import get_close_matches

LONGEST = 4000
"""Characters of a message: what came may be a text of megabytes."""


class GraycardError(Exception):
    """Something the user can mend; the message says what was expected, what came, what to do."""

    def __str__(self) -> str:
        """Return the message, without its middle where it is too long to be read."""
        whole = super().__str__()
        if len(whole) <= LONGEST:
            return whole
        return f"{whole[: LONGEST // 2]} […] {whole[-LONGEST // 2 :]}"


class UnknownNameError(GraycardError):
    """A suite, scene, track, method or layer that does not exist."""

    def __init__(self, kind: str, name: str, known: Iterable[str], advice: str = "") -> None:
        known = sorted(known)
        near = get_close_matches(name, known, n=1, cutoff=0.4)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        tail = f". {advice}" if advice else ""
        listing = ", ".join(known) or "none"
        super().__init__(f"expected a {kind} that exists, got {name!r}{hint}. Known: {listing}{tail}")
        self._made_of = (kind, name, known, advice)

    def __reduce__(self) -> tuple[type, tuple[str, str, list[str], str]]:
        """Survive the way back from a worker process: by default only the message would come."""
        return type(self), self._made_of


class DatasetError(GraycardError):
    """A dataset folder is missing, damaged, half-written, or of another format version."""


class NewerFormatError(DatasetError):
    """A dataset of a format that only a newer graycard reads."""


class PredictionError(GraycardError):
    """A predictions folder does not follow the documented format."""


class MethodError(GraycardError):
    """A method could not be loaded, or was used for what it does not provide."""


class RecordError(GraycardError):
    """A JSON record (settings, scores, run, baseline) is missing, damaged or misspelt."""


class NewerRecordError(RecordError):
    """A JSON record of a format that only a newer graycard reads."""


class OlderRecordError(RecordError):
    """A JSON record of a format that only an older graycard wrote."""


class OutputError(GraycardError):
    """Nothing can be written where the user asked for it."""


class WeightsError(GraycardError):
    """Pretrained weights that the user named are missing or damaged."""


class RenderError(GraycardError):
    """The renderer is not usable on this machine in the way that was asked for."""
