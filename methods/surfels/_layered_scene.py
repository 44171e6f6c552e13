# SPDX-License-Identifier: Apache-2.0
"""The skeleton of a decomposition into surfels: render named layers, save, load."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self, final

import numpy as np
import torch

from graycard import Camera
from graycard.methods._contract import Decomposition, check_layers
from graycard.methods._store import restore, store, whole_decomposition
from graycard.methods.splat import Parameters

_ANY = Camera.from_fov(4, 4, 60.0, np.eye(4))
"""A camera of few pixels."""


class SceneContents(NamedTuple):
    """A scene as it lies on disk."""

    method: str
    """Name of the method that made it."""
    facts: dict[str, Any]
    """JSON data."""
    arrays: dict[str, np.ndarray]
    """Arrays by name."""


class SavedScene(ABC):
    """A scene that is saved as safetensors and JSON, with a PLY for viewers of Gaussian splats."""

    @final
    def save(self, folder: Path) -> None:
        """Write safetensors and JSON, and ``surfels.ply`` for viewers of Gaussian splats.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        store(folder, *self._contents())
        self._export(Path(folder) / "surfels.ply")

    @final
    @classmethod
    def load(cls, folder: Path, method: str) -> Self:
        """Return the scene that a method has saved.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        with whole_decomposition(folder):
            found = cls._restored(SceneContents(method, *restore(folder, method)), folder)
            for scene in found._scenes():  # what cannot be drawn is damaged: here it can be said
                scene.render(_ANY, sorted(scene.provides))
            return found

    @property
    @abstractmethod
    def provides(self) -> frozenset[str]:
        """Names of the layers that :meth:`render` gives."""

    @abstractmethod
    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Render layers for any camera.

        Raises:
            MethodError: A layer is not provided.
        """

    def _scenes(self) -> tuple[Decomposition, ...]:
        """Return everything that is drawn: this scene, unless it is one of several."""
        return (self,)  # pyright: ignore[reportReturnType] - subclasses have lights(), too

    @abstractmethod
    def _contents(self) -> SceneContents:
        """Return everything that :meth:`_restored` needs."""

    @classmethod
    @abstractmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        """Build the scene from its contents; ``folder`` is for messages.

        Raises:
            MethodError: The contents are damaged.
        """

    @abstractmethod
    def _export(self, path: Path) -> None:
        """Write the surfels as a PLY that viewers of Gaussian splats read.

        Raises:
            OutputError: The file cannot be written, or the disk is full.
        """


@dataclass(frozen=True, eq=False)
class LayeredScene(SavedScene):
    """Surfels that render layers for any camera; a subclass says which layers and how."""

    parameters: Parameters

    @final
    @torch.no_grad()
    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Render layers for any camera; a lamp on the camera goes with it.

        Where surfels cover less than half of a pixel its depth is +inf. Where there is none at all, its
        normal faces the camera.

        Args:
            camera: Any.
            layers: Names out of :attr:`provides`.

        Returns:
            Arrays by name, ``(H, W)`` or ``(H, W, 3)``, float32, linear, in the unit of the layer.

        Raises:
            MethodError: A layer is not provided.
        """
        check_layers(layers, self.provides)
        images = self._images(camera, layers)
        return {name: images[name] for name in layers}

    @abstractmethod
    def _images(self, camera: Camera, layers: Sequence[str]) -> Mapping[str, np.ndarray]:
        """Render the layers, and others where they cost nothing; gradients are off."""
