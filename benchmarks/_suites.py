# SPDX-License-Identifier: Apache-2.0
"""A suite is a TOML file: which scenes, how they are rendered, which methods with which settings."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from graycard import TRACKS, RecordError, UnknownNameError, decode
from graycard.synth import RenderSettings, SceneSpec

FOLDER = Path(__file__).parent / "suites"


@dataclass(frozen=True, slots=True)
class SuiteMethod:
    """A method of a suite."""

    name: str
    """A registered name or ``module:attribute``."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Those that differ from the method's defaults."""


@dataclass(frozen=True, slots=True)
class Suite:
    """What a bench runs: every method on every scene with every seed."""

    name: str
    version: int
    title: str
    render: RenderSettings
    scenes: tuple[SceneSpec, ...]
    methods: tuple[SuiteMethod, ...]
    seeds: tuple[int, ...] = (0,)


def suite_names() -> list[str]:
    """Names of the suites that come with graycard."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_suite(name: str) -> Suite:
    """The suite of a name, or of a path that ends in ``.toml``.

    Raises:
        UnknownNameError: There is none of this name, or it names a track that does not exist.
        RecordError: The file is no TOML, or has an unknown or missing key.
    """
    own_file = name.endswith(".toml")
    path = Path(name) if own_file else FOLDER / f"{name}.toml"
    if not path.is_file():
        raise UnknownNameError("suite", name, suite_names(), "A suite of your own: a path that ends in .toml")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as cause:
        raise RecordError(f"expected TOML in {path}, got: {cause}") from cause
    suite = decode(Suite, data, RecordError, str(path))
    for scene in suite.scenes:
        check_track(scene.track)
    return suite


def check_track(name: str) -> str:
    """The name, if it is a track.

    Raises:
        UnknownNameError: It is none.
    """
    if name not in TRACKS:
        raise UnknownNameError("track", name, TRACKS)
    return name


def narrow(suite: Suite, tracks: Sequence[str] = (), methods: Sequence[str] = ()) -> Suite:
    """The part of a suite on some tracks, with some methods; a method need not be in the suite.

    Raises:
        UnknownNameError: A track does not exist.
        RecordError: The suite has no scene on these tracks.
    """
    wanted = [check_track(track) for track in tracks] or list(TRACKS)
    scenes = tuple(scene for scene in suite.scenes if scene.track in wanted)
    if not scenes:
        raise RecordError(f"expected suite {suite.name!r} to have scenes on {', '.join(wanted)}, got none")
    known = {method.name: method for method in suite.methods}
    chosen = tuple(known.get(name, SuiteMethod(name)) for name in methods) or suite.methods
    return replace(suite, scenes=scenes, methods=chosen)
