# SPDX-License-Identifier: Apache-2.0
"""The verbs that make scenes, check and show them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.table import Table

from graycard._errors import GraycardError, UnknownNameError
from graycard.cli._options import Json, option_names, optional, parse_settings, refuse
from graycard.cli._terminal import FAILED, OK, Terminal, new_table, write_optional_json
from graycard.dataset import SECRET_SEEDS, TRACKS, is_scene
from graycard.predictions import INDEX as PREDICTIONS
from graycard.processes import named

if TYPE_CHECKING:
    from graycard.synth.verify import VerifyVerdict


@dataclass(frozen=True)
class ScenesCommand:
    """List the scene families and the scenes of each suite, or the knobs of one family."""

    family: Annotated[str | None, tyro.conf.Positional, optional("[FAMILY]")] = None
    """Show the knobs of this family."""
    json: Json = None
    """Also write the list to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """List the scenes, or show one family."""
        if self.family is not None:
            return self._show(terminal, self.family)
        from graycard.benchmarks import load_suite, suite_names
        from graycard.synth import all_families, describe, scene_name

        suites = [load_suite(name) for name in suite_names()]
        table = new_table("suite", "track", "scene", "what is to be seen")
        for suite in suites:
            for spec in (*suite.scenes, *(suite.secret.drawn() if suite.secret else ())):
                table.add_row(suite.name, spec.track, scene_name(spec), describe(spec))
        terminal.out.print(table)
        known = {track: [n for n, f in all_families().items() if f.track == track] for track in TRACKS}
        write_optional_json(self.json, {"families": known, "suites": suites})
        names = ", ".join(f"{track}: {'/'.join(found)}" for track, found in known.items())
        terminal.out.print(f"scenes: {sum(len(s.scenes) for s in suites)} in {len(suites)} suites ({names})")
        return OK

    def _show(self, terminal: Terminal, name: str) -> int:
        from graycard.synth import all_families, knobs

        if name not in all_families():
            raise UnknownNameError("scene family", name, all_families())
        family = all_families()[name]
        found = knobs(family)
        table = new_table("knob", "default", "allowed", "what it does")
        for item in found:
            table.add_row(item.name, str(item.default), item.allowed, item.meaning)
        terminal.out.print(table)
        write_optional_json(
            self.json, {"family": name, "track": family.track, "title": family.title, "knobs": found}
        )
        terminal.out.print(f"scenes: {name} ({family.track}), {family.title}; {len(found)} knobs")
        return OK


@dataclass(frozen=True)
class RenderCommand:
    """Render the scenes of a suite, or one scene of a track with any seed."""

    what: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SUITE|TRACK")]
    """A suite, or one of the tracks, whose size and samples may follow: `graycard render TRACK --help`."""
    out: Annotated[Path, tyro.conf.arg(metavar="DATASET")]
    """Write to DATASET/<track>/<scene>/{capture,truth}; scenes that are there and intact are kept."""
    seed: Annotated[int | None, optional("INT")] = None
    """Seed of the scene (for a track); 0 by default."""
    family: Annotated[str | None, optional("FAMILY")] = None
    """Family of the scene (for a track); `graycard scenes` lists them. The first of the track by default."""
    knob: Annotated[tuple[str, ...], optional("NAME=VALUE ...")] = ()
    """Knobs of the family that are to differ from its defaults; `graycard scenes FAMILY` lists them."""
    json: Json = None
    """Also write the folders and their noise ceilings to this file."""

    @classmethod
    def settings_of(cls, subject: str) -> type[Any] | None:
        """Return the settings of the renderer for a track; a suite brings its own."""
        from graycard.synth import RenderSettings

        return RenderSettings if subject in TRACKS else None

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Render, view by view; a scene that is noisier than its suite allows makes the exit code 1."""
        from graycard.dataset import open_truth
        from graycard.synth import clear_leftovers, find_llvm, render_scene, scene_name

        jobs, noisy, made = self._jobs(rest, terminal), 0, []
        clear_leftovers(self.out)
        terminal.advise(find_llvm().advice)
        for number, (spec, settings, wanted) in enumerate(jobs):
            name = f"{spec.track}/{scene_name(spec)}"
            words = f"{number + 1} of {len(jobs)}: {name}" if len(jobs) > 1 else name
            with terminal.progress(f"{words}: building the scene") as progress:
                folder = render_scene(spec, settings, self.out, named(progress, words))
            ceiling = open_truth(folder / "truth", check=False).noise_ceiling or 0.0
            terminal.out.print(f"{folder.as_posix()} (noise ceiling {ceiling:.1f} dB)")
            made.append({"scene": folder, "noise_ceiling_db": ceiling, "wanted_db": wanted})
            if ceiling < wanted:
                noisy += 1
                terminal.err.print(
                    f"failed: expected a noise ceiling of {wanted:g} dB at {folder.as_posix()}"
                )
        write_optional_json(self.json, made)
        tail = f", {noisy} noisier than its suite allows: give it more samples" if noisy else ""
        terminal.out.print(f"render: {len(jobs)} scene{'s' * (len(jobs) != 1)} in {self.out}{tail}")
        return FAILED if noisy else OK

    def _jobs(self, rest: list[str], terminal: Terminal) -> list[tuple[Any, Any, float]]:
        """Return specs, the render settings of each, and the noise ceilings that they must reach.

        Raises:
            GraycardError: A scene is sealed.
        """
        from graycard.benchmarks import load_suite, refuse_sealed, suite_names

        if self.what in TRACKS:
            spec, settings = self._scene_of_track(rest)
            refuse_sealed([spec])
            return [(spec, settings, 0.0)]
        refuse(rest, "graycard render", option_names(type(self)))

        known = [*suite_names(), *TRACKS]
        if self.what not in known and not self.what.endswith(".toml"):
            raise UnknownNameError("suite or track", self.what, known)
        if self.seed is not None or self.family is not None or self.knob:
            raise GraycardError(
                "expected --seed, --family and --knob with a track only: a suite names its own scenes"
            )
        suite = load_suite(self.what)
        refuse_sealed(suite.scenes, suite)
        if suite.secret is not None:
            terminal.advise("secret scenes are left out: `graycard bench SUITE --salt FILE` renders them")
        return [(s, suite.render_of(s), suite.ceilings.get(s.track, 0.0)) for s in suite.scenes]

    def _scene_of_track(self, rest: list[str]) -> tuple[Any, Any]:
        """Return the spec of a scene of any seed, and its render settings."""
        from graycard.synth import RenderSettings, SceneSpec, all_families

        settings = parse_settings(RenderSettings, rest, f"graycard render {self.what}", type(self))
        first = next(name for name, f in all_families().items() if f.track == self.what)
        seed = self.seed or 0
        if seed < 0:
            raise GraycardError(f"expected a seed of 0 or more, got {seed}. Mend --seed")
        if seed in SECRET_SEEDS:
            raise GraycardError(f"expected a seed below {SECRET_SEEDS.start}, got {seed}. Mend --seed")
        return SceneSpec(self.what, self.family or first, seed, _knobs(self.knob)), settings


@dataclass(frozen=True)
class VerifyCommand:
    """Check the truth of a dataset by integrity, physics and a second rendering."""

    dataset: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATASET")]
    """The dataset."""
    views: int = 3
    """Views of each scene that are rendered again."""
    render: bool = True
    """--no-render: look at the files only."""
    json: Json = None
    """Also write every check to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Check; a check that failed makes the exit code 1."""
        from graycard.synth.verify import verify_dataset

        if self.views < 1:
            raise GraycardError(
                f"expected 1 or more views, got {self.views}. Mend --views, or use --no-render"
            )
        with terminal.progress(f"verifying {self.dataset}") as progress:
            verdict = verify_dataset(self.dataset, self.views, self.render, progress)
        terminal.out.print(_verdict_table(verdict))
        write_optional_json(self.json, verdict)
        for check in verdict.checks:
            if check.status == "failed":
                terminal.err.print(f"failed: {check.scene} {check.view} {check.name}: {check.reason}")
        passed, failed, skipped = (verdict.count(status) for status in ("passed", "failed", "skipped"))
        terminal.out.print(
            f"verify: {verdict.scenes} scene{'s' * (verdict.scenes != 1)}, {passed} checks passed, "
            f"{failed} failed, {skipped} skipped"
        )
        return FAILED if failed else OK


@dataclass(frozen=True)
class BoundsCommand:
    """Say how well one vector a point can tell which lights reach it, however GS-ID's is read."""

    scenes: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="SCENE ...", help_behavior_hint="(required)"),
    ]
    """DATASET/<track>/<scene>, one or more, with local lights and truth."""
    json: Json = None
    """Also write the errors to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Find the best vectors."""
        if not self.scenes:
            raise GraycardError("expected DATASET/<track>/<scene>, one or more, got none")
        from graycard.benchmarks.bounds import vector_bound

        found = [vector_bound(scene) for scene in self.scenes]
        forms = list(found[0].errors)
        table = new_table("scene", "lights", *forms)
        for row in found:
            table.add_row(row.scene, str(row.lights), *(f"{row.errors[form]:.3f}" for form in forms))
        terminal.out.print(table)
        write_optional_json(self.json, found)
        terminal.out.print(
            f"bounds: {len(found)} scenes, the error of the share of light at the best vectors"
        )
        return OK


@dataclass(frozen=True)
class LookCommand:
    """Draw a contact sheet of each scene: photographs, true layers, plan of cameras and lights."""

    dataset: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATASET|SCENE")]
    """The dataset, without scenes that are half-written; or one scene, DATASET/<track>/<scene>."""
    out: Annotated[Path | None, optional("FOLDER")] = None
    """Write the PNGs to this folder, one a scene; DATASET/look by default."""
    json: Json = None
    """Also write the list of PNGs to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Draw the contact sheets."""
        from graycard.reports import write_contact_sheets

        _refuse_predictions(self.dataset)
        dataset = self.dataset.resolve().parents[1] if is_scene(self.dataset) else self.dataset
        out = self.out or dataset / "look"
        with terminal.progress(f"drawing contact sheets of {self.dataset}") as progress:
            sheets = write_contact_sheets(self.dataset, out, progress)
        for sheet in sheets:
            terminal.out.print(sheet.as_posix())
        write_optional_json(self.json, list(sheets))
        terminal.out.print(f"look: {len(sheets)} contact sheet{'s' * (len(sheets) != 1)} in {out}")
        return OK


def _refuse_predictions(folder: Path) -> None:
    """Refuse a folder of predictions, and say how to see them.

    Raises:
        GraycardError: The folder holds some.
    """
    if (folder / PREDICTIONS).is_file():
        raise GraycardError(
            f"expected a dataset or a scene, got predictions at {folder}. Score them: `graycard score "
            f"{folder} DATASET/<track>/<scene>`; or see them in a report: `graycard bench SUITE "
            "--predictions NAME=FOLDER`, with a folder like this one at FOLDER/<track>/<scene>"
        )


def _verdict_table(verdict: VerifyVerdict) -> Table:
    """Return the worst of each check of each scene."""
    from graycard.synth.verify import worst

    table = new_table("scene", "check", "figure", "bound", "unit", "worst view", "")
    for check in worst(verdict.checks):
        figure, bound = (f"{v:.3g}" if v is not None else "" for v in (check.figure, check.bound))
        status = f"skipped: {check.reason}" if check.status == "skipped" else check.status
        table.add_row(check.scene, check.name, figure, bound, check.unit, check.view, status)
    return table


def _knobs(pairs: tuple[str, ...]) -> dict[str, Any]:
    """Return knobs by name from ``name=value``; a value that is no number is a word.

    Raises:
        GraycardError: A pair is none.
    """
    knobs: dict[str, Any] = {}
    for pair in pairs:
        name, sign, value = pair.partition("=")
        if not (name and sign and value):
            raise GraycardError(f"expected a knob as NAME=VALUE, got {pair!r}")
        knobs[name] = _number(value)
    return knobs


def _number(text: str) -> int | float | str:
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text
