# SPDX-License-Identifier: Apache-2.0
"""A suite is a TOML file: which scenes, how they are rendered, which methods with which settings."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from graycard import TRACKS, RecordError, UnknownNameError
from graycard.benchmarks._ranges import SceneRange
from graycard.benchmarks.commands._command import Command
from graycard.benchmarks.convergence import swept
from graycard.benchmarks.secret._salt import Salt
from graycard.benchmarks.secret._scenes import SecretScenes
from graycard.dataset import SECRET_SEEDS
from graycard.io import Label, Name, from_builtins, read_toml
from graycard.methods import BUILT_IN
from graycard.methods.priors import PriorSpec
from graycard.synth import RenderSettings, SceneSpec, SecretSpec, all_families, scene_name

FOLDER = Path(__file__).parent / "suites"


@dataclass(frozen=True)
class SuiteMethod(Command):
    """A method of a suite: one that is imported, a command that is run, or predictions of other code."""

    name: Label
    """A registered name or ``module:attribute``; of a command or of predictions any other name."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Those that differ from the method's defaults."""
    label: str = ""
    """The row of a table; the name if empty. Variants of one method need labels of their own."""
    priors: PriorSpec = field(default_factory=PriorSpec)
    """Source of answers to the method's asks."""
    composes: bool = False
    """True if objects of other scenes are put in where the truth has a picture of it: each is fitted in
    the scene that it comes from, by a fit of its own beside that of the job."""
    slack: float = 1.0
    """Factor on the tolerances of a baseline: a fit of many steps ends elsewhere on another processor."""
    predictions: str = ""
    """A folder with predictions of other code, ``<track>/<scene>/`` in it, relative to where graycard runs:
    nothing is fitted, and ``name`` is that of no method. Empty: the method is fitted."""
    tracks: tuple[str, ...] = ()
    """Tracks that the row runs on; all if empty."""

    def __post_init__(self) -> None:
        if not 1 <= self.slack < math.inf:
            raise ValueError(f"expected a slack of 1 or more for {self.row}, got {self.slack}")
        for track in self.tracks:
            check_track(track)
        self.check(self.row, self.settings)
        chosen = self.label or self.composes or self.priors != PriorSpec()
        if self.run and (chosen or self.predictions):
            raise ValueError(
                f"expected a name and a command, {self.name}, got a label, priors, compositions or "
                "predictions as well: a command has none. Leave them out"
            )
        fitted = self.settings or chosen
        if self.predictions and fitted:
            raise ValueError(
                f"expected a name and a folder of submitted predictions, {self.name}, got settings, a label, "
                "priors or compositions as well: they change nothing there. Leave them out"
            )
        if (self.predictions or self.run) and self.name in BUILT_IN:
            raise ValueError(_taken(self.name, "a command" if self.run else "submitted predictions"))

    @property
    def row(self) -> str:
        """The row of a table."""
        return self.label or self.name

    def runs_on(self, track: str) -> bool:
        """Return whether the row runs on a track."""
        return not self.tracks or track in self.tracks

    @property
    def entry(self) -> str:
        """Return what is loaded, or run after ``$``; empty where predictions are submitted."""
        return "" if self.predictions else f"$ {self.run}" if self.run else self.name

    @property
    def command(self) -> Command | None:
        """Return the command; None for a method that is imported, and for predictions."""
        return self if self.run else None


@dataclass(frozen=True, slots=True)
class Suite:
    """Work of a bench: every method on every scene with every seed."""

    name: Name
    version: int
    title: str
    render: RenderSettings
    scenes: tuple[SceneSpec, ...]
    methods: tuple[SuiteMethod, ...]
    seeds: tuple[int, ...] = (0,)
    samples: Mapping[str, int] = field(default_factory=dict)
    """Light paths a pixel by track or family, where one needs more or fewer than ``render`` says."""
    ceilings: Mapping[str, float] = field(default_factory=dict)
    """Noise ceiling that each scene of a track must reach, dB."""
    reserve: SceneRange | None = None
    """Scenes that are added, in this order, where claims need more of them."""
    sealed: SceneRange | None = None
    """Scenes that nobody renders before code and claims are tagged."""
    secret: SecretScenes | None = None
    """Scenes that nobody renders without a salt, which is opened later."""

    def __post_init__(self) -> None:
        for track in self.ceilings:
            check_track(track)
        for place, samples in self.samples.items():
            if place not in TRACKS and place not in all_families():
                raise UnknownNameError("track or family", place, [*TRACKS, *all_families()])
            replace(self.render, samples=samples)  # refuses what cannot be stratified
        rows = [method.row for method in self.methods]
        places = [(scene.track, scene_name(scene)) for scene in self.scenes]
        for what, values in (("scenes", places), ("methods", rows), ("seeds", self.seeds)):
            if not values or len(set(values)) < len(values):
                raise RecordError(
                    f"expected {what} in suite {self.name!r}, each once (a second variant of a method needs "
                    f"a label of its own), got {list(values)}"
                )
        given = [method.row for method in self.methods if method.predictions]
        if given and len(self.seeds) > 1:
            raise RecordError(
                f"expected one seed in suite {self.name!r}, which has submitted predictions "
                f"({', '.join(given)}), got {list(self.seeds)}. Give the suite one"
            )
        self._check_seeds()
        self._check_ranges()

    def _check_seeds(self) -> None:
        """Refuse seeds of public scenes that are kept for secret ones."""
        public = (spec.seed for spec in self.scenes if not isinstance(spec, SecretSpec))
        if shown := [seed for seed in public if seed in SECRET_SEEDS]:
            raise RecordError(
                f"expected seeds below {SECRET_SEEDS.start} in suite {self.name!r}, got {shown[0]}. Those "
                "from there up follow from salts: choose another"
            )

    def _check_ranges(self) -> None:
        """Refuse ranges with scenes that are none, or that another part of the suite has as well."""
        kept = [spec for found in (self.reserve, self.sealed, self.secret) if found for spec in found.drawn()]
        for spec in kept:
            scene_name(spec)  # refuses families and knobs that are none
        for found, others in ((self.reserve, self.scenes), (self.sealed, (*self.scenes, *self.added))):
            if shared := [scene_name(spec) for spec in others if found and found.holds(spec)]:
                raise RecordError(
                    f"expected ranges of suite {self.name!r} apart from its scenes and from each other, got "
                    f"{', '.join(shared)} in two places. Choose other seeds"
                )

    @property
    def added(self) -> tuple[SceneSpec, ...]:
        """The scenes of the reserve, in order."""
        return self.reserve.drawn() if self.reserve else ()

    def rows_on(self, track: str) -> tuple[SuiteMethod, ...]:
        """Return the rows that run on a track."""
        return tuple(method for method in self.methods if method.runs_on(track))

    def render_of(self, scene: SceneSpec) -> RenderSettings:
        """Return how a scene of this suite is photographed."""
        of_track = self.samples.get(scene.track, self.render.samples)
        return replace(self.render, samples=self.samples.get(scene.family, of_track))


def suite_names() -> list[str]:
    """Names of the suites that come with graycard."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def suite_path(name: str) -> Path:
    """Return the file of a suite, or the path itself if it ends in ``.toml``.

    Raises:
        UnknownNameError: There is no such file.
    """
    path = Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    if len(path.name) > 200 or not path.is_file():
        raise UnknownNameError("suite", name, suite_names(), "A suite of your own: a path that ends in .toml")
    return path


def load_suite(name: str) -> Suite:
    """Return the suite of a name, or of a path that ends in ``.toml``.

    Raises:
        UnknownNameError: There is none of this name, or it names a track that does not exist.
        RecordError: The file is no TOML, has an unknown or missing key, or a sweep that is none.
    """
    path = suite_path(name)
    data = read_toml(path)
    for scene in data.get("scenes", []):
        check_track(str(scene.get("track") if isinstance(scene, dict) else scene))
    return from_builtins(Suite, swept(data, str(path)), RecordError, str(path))


def check_track(name: str) -> str:
    """Return the name, if it is a track.

    Raises:
        UnknownNameError: It is none.
    """
    if name not in TRACKS:
        raise UnknownNameError("track", name, TRACKS)
    return name


def narrow(
    suite: Suite, tracks: Sequence[str] = (), methods: Sequence[str] = (), scenes: Sequence[str] = ()
) -> Suite:
    """Return the part of a suite on some tracks and scenes, with some methods; a method need not be in the
    suite.

    Args:
        suite: The whole.
        tracks: Their names; all if empty.
        methods: Of rows, or else of methods, which stand for all of their rows; all if empty.
        scenes: Their names, as ``corridor-0003`` or ``dark/corridor-0003``; all if empty.

    Raises:
        UnknownNameError: A track or a scene does not exist.
        RecordError: The suite has no scene on these tracks, or a named row runs on none of them.
    """
    wanted = [check_track(track) for track in tracks] or list(TRACKS)
    kept = tuple(scene for scene in suite.scenes if scene.track in wanted)
    if not kept:
        raise RecordError(f"expected suite {suite.name!r} to have scenes on {', '.join(wanted)}, got none")
    kept = _on_scenes(kept, scenes) if scenes else kept
    chosen = {m.row: m for name in methods for m in _named(suite, name)}
    there = {scene.track for scene in kept}
    if idle := [m for m in chosen.values() if not any(map(m.runs_on, there))]:
        raise RecordError(
            f"expected rows that run on {', '.join(sorted(there))}, got {idle[0].row}, which runs on "
            f"{', '.join(idle[0].tracks)}. Mend --methods, --tracks or --scenes"
        )
    rows = chosen.values() or [m for m in suite.methods if any(map(m.runs_on, there))]
    return replace(suite, scenes=kept, methods=tuple(rows))


def _on_scenes(scenes: Sequence[SceneSpec], names: Sequence[str]) -> tuple[SceneSpec, ...]:
    """Return the scenes of these names, in the order of the suite.

    Raises:
        UnknownNameError: None of them has such a name.
    """
    places = [(scene, scene_name(scene)) for scene in scenes]
    for name in names:
        if not any(name in (own, f"{scene.track}/{own}") for scene, own in places):
            raise UnknownNameError("scene", name, [f"{scene.track}/{own}" for scene, own in places])
    return tuple(scene for scene, own in places if own in names or f"{scene.track}/{own}" in names)


def opened(suite: Suite) -> Suite:
    """Return the suite with its sealed scenes in place of its own.

    Raises:
        RecordError: It has none.
    """
    if suite.sealed is None:
        raise RecordError(
            f"expected a suite with a sealed range, got {suite.name!r}. Give it [sealed], or leave out "
            "--sealed"
        )
    return replace(suite, scenes=suite.sealed.drawn(), reserve=None, sealed=None, secret=None)


def with_secret(suite: Suite, salt: Salt) -> Suite:
    """Return the suite with its secret scenes behind its own.

    Raises:
        RecordError: It has none, or the salt is another.
    """
    if suite.secret is None:
        raise RecordError(
            f"expected a suite with secret scenes, got {suite.name!r}. Give it [secret], or leave out --salt"
        )
    return replace(suite, scenes=(*suite.scenes, *suite.secret.drawn(salt)))


def public(suite: Suite) -> Suite:
    """Return the suite as everybody may know it: without the scenes that a salt has opened."""
    scenes = tuple(scene for scene in suite.scenes if not isinstance(scene, SecretSpec))
    return replace(suite, scenes=scenes)


def with_predictions(suite: Suite, rows: Sequence[str]) -> Suite:
    """Return a suite with rows of predictions that other code has made.

    Args:
        suite: What the rows are added to.
        rows: ``NAME=FOLDER`` each, with ``<track>/<scene>/`` in the folder.

    Raises:
        RecordError: A row is not of this form, or one of this name is there.
    """
    for row in rows:
        suite = replace(suite, methods=(*suite.methods, _submitted(row, suite)))
    return suite


def without_compositions(suite: Suite) -> Suite:
    """Return a suite whose rows put no objects in: the scenes these come from are not needed then.

    Raises:
        RecordError: No row puts any in.
    """
    if not any(method.composes for method in suite.methods):
        raise RecordError(
            f"expected rows that put objects in, got none in {suite.name}. Leave out --no-compositions"
        )
    return replace(suite, methods=tuple(replace(method, composes=False) for method in suite.methods))


def _submitted(row: str, suite: Suite) -> SuiteMethod:
    name, _, folder = row.partition("=")
    if not name or not folder:
        raise RecordError(f"expected predictions as NAME=FOLDER, got {row!r}. Mend --predictions")
    if name in BUILT_IN or any(name in (method.row, method.name) for method in suite.methods):
        raise RecordError(f"{_taken(name)}. Mend --predictions")
    return SuiteMethod(name, predictions=folder)


def _taken(name: str, what: str = "submitted predictions") -> str:
    return (
        f"expected a name of their own for {what}, got {name!r}, which is that of a method or of a row. "
        f"Call it {name}-official, say"
    )


def _named(suite: Suite, name: str) -> list[SuiteMethod]:
    """Return the row of that name; without one all rows of that method; without any the method with its
    defaults.
    """
    rows = [m for m in suite.methods if m.row == name] or [m for m in suite.methods if m.name == name]
    return rows or [SuiteMethod(name)]
