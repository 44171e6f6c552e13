# SPDX-License-Identifier: Apache-2.0
"""Fit the weights of graycard's own network to views of training scenes; cut off, it goes on where it was."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import load_file, save_file

from graycard import GraycardError
from graycard.benchmarks.training._batches import random_views
from graycard.benchmarks.training._looks import Errors, Look, Views, errors_of_constants, errors_of_network
from graycard.benchmarks.training._loss import loss_of, weighted
from graycard.io import Progress, atomic_path, from_builtins, read_json, sha256, write_json
from graycard.methods.priors.network import GeometryNet, inputs_of


@dataclass(frozen=True, slots=True)
class TrainSettings:
    """Settings of a training.

    Raises:
        ValueError: A number is out of its range.
    """

    steps: int = 1500
    batch: int = 8
    """Views in a step."""
    rate: float = 1.5e-3
    """Highest rate of AdamW; it rises over a twentieth of the steps and falls by a cosine to 0."""
    decay: float = 0.01
    """Weight decay."""
    look_every: int = 150
    """Steps between two looks at the validation views."""
    seed: int = 0
    bf16: bool = True
    """Take convolutions in bfloat16: twice as fast where the processor has it, else slow."""

    def __post_init__(self) -> None:
        for name in ("steps", "batch", "look_every"):
            if getattr(self, name) < 1:
                raise ValueError(f"expected {name} to be 1 or more, got {getattr(self, name)}")


@dataclass(slots=True)
class TrainRecord:
    """Record of a training, kept beside its weights."""

    settings: TrainSettings
    training: tuple[str, ...]
    """Names of the scenes that the weights were fitted to."""
    validation: tuple[str, ...]
    """Names of the scenes of the curves."""
    views: tuple[int, int]
    """Numbers of training and of validation views."""
    parameters: int = 0
    seconds: float = 0.0
    """Seconds of one thread, looks included."""
    looks: tuple[Look, ...] = ()
    last: Look | None = None
    """At the weights in the file; its step is less than that of the settings where the fit was cut off."""
    constant: Errors = field(default_factory=dict)
    """Errors of the best constant of each validation view, against which curves are held."""
    weights: str = ""
    """SHA-256 of the file of weights."""


@dataclass(slots=True)
class _State:
    """State that a training goes on from."""

    net: GeometryNet
    optimizer: torch.optim.AdamW
    record: TrainRecord
    step: int = 0
    losses: list[float] = field(default_factory=list)


def train(
    training: Mapping[str, Views],
    validation: Mapping[str, Views],
    settings: TrainSettings,
    out: Path,
    progress: Progress,
    seconds: float = float("inf"),
) -> TrainRecord:
    """Fit the network, or go on with a training that was cut off.

    Batches depend on seed and step alone, so a training that was cut off ends as it would have. Bits differ
    between processors.

    Args:
        training: Views of :func:`read_views` by name of their scene.
        validation: Those of the curves; the part of a name before the first ``/`` is the track.
        settings: How.
        out: ``own.safetensors``, ``own.json`` with the record and ``own.state.safetensors`` are written here,
            when it is cut off, too.
        progress: Told about each look.
        seconds: After this time, and one step, the training is cut off; run it again to go on.

    Returns:
        The record; ``last.step`` tells how far the training came.

    Raises:
        GraycardError: The folder holds a training of other settings or scenes.
        OutputError: The folder cannot be written to.
    """
    began = time.perf_counter()
    data = _joined(training)
    state = _state(training, validation, settings, out)
    before = state.record.seconds
    while state.step < settings.steps:
        state.losses.append(_step(state, data, settings))
        state.step += 1
        if state.step % settings.look_every == 0 or state.step == settings.steps:
            look = _look(state, validation)
            state.record.looks += (look,)
            state.losses = []
            progress(state.step / settings.steps, f"step {state.step}, loss {look.loss:.3f}")
        if time.perf_counter() - began > seconds:
            break
    state.record.last = _look(state, validation) if state.losses else state.record.looks[-1]
    state.record.seconds = before + time.perf_counter() - began
    _write_weights(state, out)
    _keep(state, out)
    return state.record


def _look(state: _State, validation: Mapping[str, Views]) -> Look:
    """Return the training's loss and errors at this step."""
    return Look(state.step, float(np.mean(state.losses)), errors_of_network(state.net, validation))


def _joined(scenes: Mapping[str, Views]) -> Views:
    """Return the views of all scenes, one behind the other.

    Raises:
        GraycardError: There is no scene.
    """
    if not scenes:
        raise GraycardError("expected one or more training scenes, got none")
    names = next(iter(scenes.values()))
    return {name: np.concatenate([scene[name] for scene in scenes.values()]) for name in names}


def _step(state: _State, data: Views, settings: TrainSettings) -> float:
    """One step; return its loss."""
    rng = np.random.default_rng([settings.seed, state.step])
    batch = random_views(data, settings.batch, rng)
    for group in state.optimizer.param_groups:
        group["lr"] = settings.rate * _share(state.step, settings.steps)
    with torch.autocast("cpu", torch.bfloat16, enabled=settings.bf16):
        told = state.net(inputs_of(batch["image"], batch["rays"]))
    loss = weighted(loss_of(told, batch))
    state.optimizer.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(state.net.parameters(), 1.0)
    state.optimizer.step()
    return float(loss.detach())


def _share(step: int, steps: int) -> float:
    """Return the rate of a step, of the highest."""
    rise = max(steps / 20, 1)
    return min((step + 1) / rise, 1) * 0.5 * (1 + np.cos(np.pi * step / steps))


def _state(
    training: Mapping[str, Views], validation: Mapping[str, Views], settings: TrainSettings, out: Path
) -> _State:
    """Return the state to go on from: a new one, or the one that is kept in a folder."""
    torch.manual_seed(settings.seed)
    net = GeometryNet()
    optimizer = torch.optim.AdamW(net.parameters(), lr=settings.rate, weight_decay=settings.decay)
    counts = tuple(sum(len(v["image"]) for v in part.values()) for part in (training, validation))
    record = TrainRecord(settings, tuple(training), tuple(validation), (counts[0], counts[1]))
    record.parameters = sum(p.numel() for p in net.parameters())
    state = _State(net, optimizer, record)
    if _state_file(out).exists():
        _restore(state, out)
    state.record.constant = errors_of_constants(validation)
    return state


def _state_file(out: Path) -> Path:
    return out / "own.state.safetensors"


def _restore(state: _State, out: Path) -> None:
    """Read what was kept.

    Raises:
        GraycardError: It is of a training of other settings or scenes.
    """
    found = from_builtins(TrainRecord, read_json(out / "own.json"), GraycardError, str(out / "own.json"))
    same = ("settings", "training", "validation", "views", "parameters")
    if any(getattr(found, name) != getattr(state.record, name) for name in same):
        raise GraycardError(
            f"expected {out} to be free or to hold a training of these settings and scenes, got another one. "
            "Choose another output folder"
        )
    kept = load_file(_state_file(out))
    names = list(state.net.state_dict())
    state.net.load_state_dict({name: kept[f"net.{name}"] for name in names})
    moments: dict[int, Any] = {
        n: {key: kept[f"{key}.{name}"].clone() for key in ("exp_avg", "exp_avg_sq", "step")}
        for n, name in enumerate(names)
    }
    groups = state.optimizer.state_dict()["param_groups"]
    state.optimizer.load_state_dict({"state": moments, "param_groups": groups})
    state.record, state.step = found, int(kept["steps"])
    state.losses = kept["losses"].tolist()


def _keep(state: _State, out: Path) -> None:
    """Write the record and all that is needed to go on."""
    kept = {f"net.{name}": values.detach() for name, values in state.net.state_dict().items()}
    for name, parameter in state.net.named_parameters():
        moments = state.optimizer.state[parameter]
        kept |= {f"{key}.{name}": moments[key] for key in ("exp_avg", "exp_avg_sq", "step")}
    kept |= {"steps": torch.tensor(state.step), "losses": torch.tensor(state.losses)}
    with atomic_path(_state_file(out)) as partial:
        save_file(kept, partial)
    write_json(out / "own.json", state.record)


def _write_weights(state: _State, out: Path) -> None:
    """Write the weights in float16, and their hash into the record."""
    path = out / "own.safetensors"
    with atomic_path(path) as partial:
        halves = {name: values.half().contiguous() for name, values in state.net.state_dict().items()}
        save_file(halves, partial, {"network": "graycard own"})  # one word: the order of several is chance
    state.record.weights = sha256(path)
