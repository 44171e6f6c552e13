# SPDX-License-Identifier: Apache-2.0
"""Benches on scenes that no renderer makes: all look the same, and each bears the name of its spec."""

import socket
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from graycard import Progress
from graycard.benchmarks import Plan, _runner, load_suite, run_until_decided
from graycard.benchmarks._jobs import RenderJob
from graycard.io import peak_memory_mib, read_manifest, silent, to_builtins, write_manifest
from graycard.processes import AUDIT_HOOK, Channel, ChannelError, Outcome
from graycard.records import RunRecord
from graycard.synth import SceneSpec, scene_name
from graycard.synth.families import resolved_knobs

SUITE = """
name = "tiny-reserve"
version = 1
title = "Two dark rooms, and more where claims need them"
[reserve]
seeds = [501, {last}]
scenes = [
    {{ track = "dark", family = "corridor", knobs = {{ gloss = [0.0, 0.25] }} }},
    {{ track = "dark", family = "shelf-room" }},
]
[sealed]
seeds = [601, 602]
scenes = [{{ track = "dark", family = "corridor" }}]
[render]
[[scenes]]
track = "dark"
family = "corridor"
seed = 1
[[scenes]]
track = "dark"
family = "shelf-room"
seed = 2
[[methods]]
name = "truth"
[[methods]]
name = "gray"
[[methods]]
name = "gray"
label = "gray-dark"
settings = {{ reflectance = 0.09 }}
[[methods]]
name = "input"
[[methods]]
name = "retinex"
"""

CLAIMS = """
name = "tiny-claims"
version = 1
title = "A paper of few words"
track = "dark"
suite = "tiny-reserve"
bound = "truth"
trivial = "gray"
[[claims]]
id = "T1"
sentence = "Gray is nearer to the albedo than the photographs."
source = "Table 1"
[[claims.checks]]
id = "albedo"
says = "Albedo PSNR is higher"
rule = "better"
rows = ["gray", "input"]
quantity = { metric = "albedo.psnr.channel" }
expects = "higher"
[[claims.checks]]
id = "told"
says = "Retinex does as well"
rule = "better"
rows = ["retinex", "input"]
quantity = { metric = "albedo.psnr.channel" }
expects = "higher"
decides = false
"""
"""One claim that is true on all scenes, with a check beside it that decides nothing."""

TIE = """
[[claims]]
id = "T2"
sentence = "One gray is nearer than another, but for a gain."
source = "Table 2"
[[claims.checks]]
id = "albedo"
says = "Albedo PSNR is higher"
rule = "better"
rows = ["gray", "gray-dark"]
quantity = { metric = "albedo.psnr.channel" }
expects = "higher"
scenes = { families = ["corridor"] }
"""
"""One more, about corridors alone, that no number of scenes decides."""


def write_reserve_suite(folder: Path, last: int = 510) -> Path:
    """Write the suite with a reserve of seeds from 501 on."""
    path = folder / "tiny-reserve.toml"
    path.write_text(SUITE.format(last=last))
    return path


def write_claims(folder: Path, *texts: str) -> str:
    """Write a file of claims, and return its path as text."""
    path = folder / "tiny-claims.toml"
    path.write_text("".join(texts or (CLAIMS,)))
    return str(path)


def pursued(folder: Path, most: int, *claims: str, last: int = 510, seeds: str = "[0]") -> RunRecord:
    """Add scenes until claims are decided, in ``folder / "run"``, or go on there."""
    path = write_reserve_suite(folder, last)
    path.write_text(path.read_text().replace("version = 1", f"version = 1\nseeds = {seeds}", 1))
    plan = Plan(most, (write_claims(folder, *claims),))
    return run_until_decided(load_suite(str(path)), folder / "run", 1, silent, plan)


def made_without_renderer(patch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]) -> list[str]:
    """Let benches find each scene as if it had been rendered before, and fit in this process, unconfined.

    Returns:
        The names of scenes that were asked for, in order.
    """
    run_here(patch)
    asked: list[str] = []

    def find(job: RenderJob) -> Outcome:
        name = scene_name(job.spec)
        asked.append(name)
        folder = job.dataset / job.spec.track / name
        if not folder.is_dir():
            write_tiny(job.dataset, track=job.spec.track, scene=name)
            _sign(folder, job.spec, job)
        return Outcome(reused=True, value=folder)

    patch.setattr("graycard.benchmarks.planning._rendering.find_rendered", find)
    return asked


def run_here(patch: pytest.MonkeyPatch) -> None:
    """Let benches render, fit and score in this process, unconfined: workers take longer to start."""
    patch.setattr(_runner, "run_all", _run_here)
    served_here(patch)


def served_here(patch: pytest.MonkeyPatch) -> None:
    """Let threads of this process do what confined processes do otherwise."""
    patch.setattr("graycard.methods.confined._start.started", _Here)


class _Here:
    """A thread in the place of a confined process, which would take ten times as long as the fit itself."""

    guard = AUDIT_HOOK

    def __init__(self, served: str) -> None:
        module, _, name = served.partition(":")
        self.served: Callable[[Channel], None] = getattr(import_module(module), name)
        ours, theirs = socket.socketpair()
        self.channel = Channel(ours)
        self.thread = threading.Thread(target=self._serve, args=(Channel(theirs),), daemon=True)
        self.thread.start()

    def _serve(self, channel: Channel) -> None:
        with suppress(ChannelError):
            self.served(channel)
        channel.close()

    def confine(self, *_: object) -> None:
        """Nothing is closed."""

    def refusals(self) -> tuple[str, ...]:
        return ()

    def cpu_s(self) -> None:
        """Tell none: the thread's time is that of the whole process."""

    def peak_mib(self) -> float:
        return peak_memory_mib()

    def end(self) -> int:
        self.channel.close()
        self.thread.join()
        return 0


def _run_here(
    work: Callable[[Any], Outcome],
    jobs: Sequence[Any],
    at_a_time: int,
    progress: Progress,
    find: Callable[[Any], Outcome | None] = lambda job: None,
    *_: Any,
    **__: Any,
) -> list[Outcome]:
    """Do jobs one after the other, as workers would."""
    return [find(job) or work(job) for job in jobs]


def _sign(folder: Path, spec: SceneSpec, job: RenderJob) -> None:
    """Write what a scene was made from into its truth."""
    made = {"family": spec.family, "knobs": resolved_knobs(spec), "render": job.settings}
    manifest = read_manifest(folder / "truth", "graycard-truth")
    signed = replace(manifest, settings=to_builtins(made), seeds={"scene": spec.seed})
    write_manifest(folder / "truth", signed)
