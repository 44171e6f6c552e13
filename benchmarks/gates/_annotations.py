# SPDX-License-Identifier: Apache-2.0
"""The verdict of a gate as commands by which GitHub Actions marks a failure."""

from collections.abc import Iterator

from graycard.benchmarks.gates._gate import GateVerdict

SHOWN = 9
"""Scores that are marked; GitHub shows ten annotations of a step."""


def annotations(verdict: GateVerdict) -> Iterator[str]:
    """Yield the commands that mark what is worse or missing in the log of a step and on the commit."""
    failed = [*verdict.worse, *verdict.missing]
    for change in failed[:SHOWN]:
        yield f"::error title=graycard gate::{_escaped(str(change))}"
    if len(failed) > SHOWN:
        yield f"::error title=graycard gate::{len(failed) - SHOWN} more; the summary lists them"
    if not verdict.compared and not failed:
        yield "::error title=graycard gate::nothing was compared"


def _escaped(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
