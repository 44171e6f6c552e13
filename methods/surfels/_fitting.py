# SPDX-License-Identifier: Apache-2.0
"""The skeleton of a method on surfels: check the capture, fit, load; and where an unfinished fit is saved."""

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar, final

import torch

from graycard import Camera, Capture, Progress
from graycard.io import to_builtins
from graycard.methods._contract import Priors
from graycard.methods.splat import (
    Checkpoint,
    DensityRules,
    FitBackend,
    LearningRateSchedule,
    Misplaced,
    Objective,
    Parameters,
    TrainConfig,
    check_saved,
    device_of,
    initial_state,
    scene_extent,
    train,
)
from graycard.methods.surfels._layered_scene import SavedScene

SAVES = 10
"""Interval: how often a fit is saved on its way."""


SettingsT = TypeVar("SettingsT")
OtherSettingsT = TypeVar("OtherSettingsT")
SceneT = TypeVar("SceneT", bound=SavedScene)


@dataclass(frozen=True, eq=False)
class FitTask(Generic[SettingsT]):
    """Everything that a fit depends on besides its method."""

    capture: Capture
    priors: Priors
    settings: SettingsT
    seed: int
    progress: Progress
    """Called now and then."""

    @property
    def extent(self) -> float:
        """Extent of the training cameras, metres: the yardstick of learning rates."""
        return scene_extent([view.camera for view in self.capture.train])

    def with_capture(self, capture: Capture) -> "FitTask[SettingsT]":
        """Return the same task on another capture, as one in other units."""
        return replace(self, capture=capture)

    def with_settings(self, settings: OtherSettingsT) -> "FitTask[OtherSettingsT]":
        """Return the same task with other settings, as one stage of a fit has them."""
        return FitTask(self.capture, self.priors, settings, self.seed, self.progress)

    def config(
        self,
        steps: int,
        rates: Mapping[str, LearningRateSchedule],
        rules: DensityRules | None = None,
        checkpoint: Checkpoint | None = None,
        misplaced: Misplaced | None = None,
    ) -> TrainConfig:
        """Return the configuration of a fit of the whole capture.

        Args:
            steps: How many.
            rates: Learning rates by the names of parameters.
            rules: When surfels come and go; None: never.
            checkpoint: Where the fit is saved; None: nowhere.
            misplaced: Which surfels go whenever some are taken away; None: only those that ``rules`` name.
        """
        backend = _backend_of(self.settings)
        return TrainConfig(steps, rates, self.extent, rules, checkpoint, misplaced=misplaced, backend=backend)

    def train(self, start: Parameters, config: TrainConfig, objective: Objective) -> Parameters:
        """Fit parameters from their start to the end of a budget.

        Raises:
            MethodError: The loss or a gradient is not finite, or the checkpoint is of another fit.
            OutputError: The checkpoint cannot be written.
        """
        return train(initial_state(start, self.seed), config, objective, self.progress).parameters


class SceneMethod(ABC, Generic[SettingsT, SceneT]):
    """A method that fits surfels; a subclass gives its names, its checks and :meth:`_fitted`."""

    name: str
    """The registered name, which saved scenes carry."""
    summary: str
    needs: tuple[str, ...] = ()
    settings_type: type[SettingsT]
    scene_type: type[SceneT]
    checks: tuple[Callable[[Capture], None], ...] = ()
    """Refuse a capture that the method cannot fit, before any time is spent."""

    @final
    def fit(
        self, capture: Capture, priors: Priors, settings: SettingsT, seed: int, progress: Progress
    ) -> SceneT:
        """Fit a scene to the training photographs.

        Args:
            capture: The photographs.
            priors: Answers to what the method asks.
            settings: Of the method.
            seed: Equal seeds give equal scenes.
            progress: Called now and then.

        Raises:
            MethodError: The capture does not suit the method, an answer of a prior is missing or not sound,
                there are too few sparse points, the checkpoint is of another fit, the back end cannot run
                here, or the loss or a gradient is not finite.
        """
        device_of(_backend_of(settings))
        for check in self.checks:
            check(capture)
        return self._fitted(FitTask(capture, priors, settings, seed, progress))

    @final
    def load(self, folder: Path) -> SceneT:
        """Return a scene that ``save`` wrote.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        return self.scene_type.load(folder, self.name)

    @abstractmethod
    def _fitted(self, task: FitTask[SettingsT]) -> SceneT:
        """Fit a capture that has passed the checks."""


def fit_checkpoint(
    method: str,
    settings: Any,
    seed: int,
    views: Iterable[tuple[Camera, torch.Tensor]],
) -> Checkpoint | None:
    """Return where a fit is saved; None if its settings name neither a file nor a folder.

    Args:
        method: Its name.
        settings: With ``checkpoint`` and ``iterations``.
        seed: Of the fit.
        views: Cameras and pictures that are fitted: a checkpoint of others is refused.
    """
    if not settings.checkpoint:
        return None
    digest = hashlib.sha256()
    for camera, picture in views:
        digest.update(camera.digest.encode() + picture.numpy().tobytes())
    every = max(1, settings.iterations // SAVES)
    identity = f"{_chosen(method, settings, seed)} {digest.hexdigest()}"
    return Checkpoint(Path(settings.checkpoint), every, identity, _is_folder(settings))


def check_checkpoint(method: str, settings: Any, seed: int) -> None:
    """Refuse the file of another fit before anything is asked of a prior or looked for in photographs.

    Args:
        method: Its name, as for :func:`fit_checkpoint`.
        settings: With ``checkpoint``.
        seed: Of the fit.

    Raises:
        MethodError: The file is damaged, or is of another method, other settings or another seed.
    """
    if settings.checkpoint and not _is_folder(settings):
        check_saved(Path(settings.checkpoint), _chosen(method, settings, seed))


def _chosen(method: str, settings: Any, seed: int) -> str:
    """Return a hash of everything that a fit depends on besides its photographs."""
    chosen = to_builtins(replace(settings, checkpoint=""))
    return hashlib.sha256(json.dumps([method, seed, chosen]).encode()).hexdigest()


def _is_folder(settings: Any) -> bool:
    return settings.checkpoint.endswith("/")


def _backend_of(settings: object) -> FitBackend:
    """Return where a fit computes: on the CPU, unless the method has a setting for it."""
    return getattr(settings, "backend", "cpu")
