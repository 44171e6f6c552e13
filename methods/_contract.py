# SPDX-License-Identifier: Apache-2.0
"""Contract of a method: it fits a capture and gives a decomposition, which renders layers for a camera.

A decomposition claims only what it can do: the layers in ``provides``, and the verbs of the smaller
protocols :class:`Relightable`, :class:`Composable` and :class:`Removable`. What it does not claim is "not
provided", never 0.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from graycard import Camera, Capture, Composition, EnvironmentLight, Light, MethodError, Progress
from graycard.methods._priors import Ask as Ask
from graycard.methods._priors import Composed as Composed
from graycard.methods._priors import Priors as Priors
from graycard.methods._priors import Relit as Relit

LIGHTS, RELIGHTING, COMPOSITION = "lights", "relighting", "composition"
"""Names in ``needs`` of the true lights, and the true pictures under changed ones and with an object put
in; everything else in it is the name of a layer."""


def check_layers(asked: Sequence[str], provided: Collection[str]) -> None:
    """Refuse layers that a decomposition does not provide.

    Raises:
        MethodError: One is not provided.
    """
    missing = [name for name in asked if name not in provided]
    if missing:
        raise MethodError(f"expected layers out of {sorted(provided)}, got {missing}")


@runtime_checkable
class Decomposition(Protocol):
    """Results of a fitted method for a scene."""

    @property
    def provides(self) -> frozenset[str]:
        """Names of the layers that :meth:`render` can give."""
        ...

    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Layers as ``camera`` sees them.

        Args:
            camera: Any camera, unless the method says otherwise.
            layers: Names out of ``provides``.

        Returns:
            Arrays by name, ``(H, W)`` or ``(H, W, 3)``, linear, in the unit of the layer.

        Raises:
            MethodError: A layer or the camera is not provided.
        """
        ...

    def lights(self) -> tuple[Light, ...] | None:
        """Return the lights that were found; None if the method does not look for lights."""
        ...

    def save(self, folder: Path) -> None:
        """Write the decomposition as safetensors and JSON; the method's ``load`` reads it back.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        ...


@runtime_checkable
class Surrounded(Protocol):
    """A decomposition with environments among its lights."""

    def environment(self, light: EnvironmentLight) -> np.ndarray:
        """Return the image of one of its lights, ``(H, W, 3)``, latitude-longitude, W/m²/sr."""
        ...


@runtime_checkable
class Relightable(Protocol):
    """A decomposition whose lights can be exchanged."""

    def relight(self, lights: tuple[Light, ...]) -> Decomposition | None:
        """Return the same scene under other lights.

        Args:
            lights: All lights that shine then, in true units; the ``image`` of an environment is the full
                path of its file. Those of the photographs are not to be kept.

        Returns:
            What renders ``radiance`` under them, in the gauge of its own ``base_color``: a decomposition
            whose albedo is half the true one gives half the true radiance, and the score undoes both
            alike. None for lights that the method cannot render: that is "not provided", no failure.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Guest:
    """An object of another scene, as the same method has taken that scene apart."""

    decomposition: Decomposition
    """Decomposition of that whole scene, in its world."""
    cameras: Mapping[str, Camera]
    """Masks of its training views, by their names."""
    masks: Mapping[str, np.ndarray]
    """Masks where they see the object, shape ``(H, W)``, bool: they say which one is meant, as the mask of
    a target does."""


@runtime_checkable
class Composable(Protocol):
    """A decomposition into which an object of another scene can be put."""

    def compose(self, composition: Composition, guest: Guest | None = None) -> Decomposition | None:
        """Return the same scene with an object of another one in it, lit by the lights of this one.

        Args:
            composition: Which object of which scene, and where it is put.
            guest: The object; None where its scene was not fitted.

        Returns:
            What renders ``radiance`` with it, under the lights that the method found. None for an object that
            the method does not know: that is "not provided", no failure.
        """
        ...


@runtime_checkable
class Removable(Protocol):
    """A decomposition from which an object can be taken away."""

    def remove(self, object_id: int) -> Decomposition:
        """Return the same scene without an object, its shadow and its reflection."""
        ...


@runtime_checkable
class Counting(Protocol):
    """A decomposition that counts work, so that costs can be compared without a clock."""

    def counts(self, camera: Camera) -> Mapping[str, float]:
        """Return what a picture for a camera takes, by name, as ``light evaluations``: how often light is
        found.
        """
        ...


@runtime_checkable
class Method(Protocol):
    """A way to take photographs apart."""

    @property
    def summary(self) -> str:
        """One sentence for tables."""
        ...

    @property
    def needs(self) -> tuple[str, ...]:
        """Truth that it is handed as a prior: layer names, ``lights``; empty for a method that competes."""
        ...

    @property
    def settings_type(self) -> type[Any]:
        """A frozen dataclass; its defaults are the method's defaults."""
        ...

    def fit(
        self, capture: Capture, priors: Priors, settings: Any, seed: int, progress: Progress
    ) -> Decomposition:
        """Take a capture apart.

        Args:
            capture: Photographs and cameras of the training views, cameras of the held-out ones.
            priors: What ``needs`` asks for, and what answers the method's ``asks``.
            settings: An instance of ``settings_type``.
            seed: Equal seeds give equal decompositions.
            progress: Called now and then.

        Raises:
            MethodError: The capture or the settings do not suit the method.
        """
        ...

    def load(self, folder: Path) -> Decomposition:
        """Return a decomposition that ``save`` wrote.

        Raises:
            MethodError: It is missing, damaged, or was written by another method.
        """
        ...


@dataclass(frozen=True, slots=True)
class NoSettings:
    """The settings of a method that has none."""


@runtime_checkable
class Staged(Method, Protocol):
    """A method that saves the stages of a fit, for itself when it is cut off and for others that share them.

    Its settings have ``checkpoint``. Where that ends with a slash it is a folder, in which each stage is
    saved under a name that says all that the stage depends on, and no more: so fits that differ in later
    stages alone find the earlier ones there, and end with the same bits as without. It tells the time of what
    it finds by :func:`graycard.methods.add_resumed`.
    """

    @property
    def staged(self) -> bool:
        """True."""
        ...


@runtime_checkable
class Compiled(Method, Protocol):
    """A method on the surfel engine, whose missing kernels are compiled before its clock runs."""

    @property
    def kernels(self) -> tuple[str, ...]:
        """Parts of the engine, named as in :func:`graycard.methods.splat.warm_kernels`."""
        ...


@runtime_checkable
class Asking(Method, Protocol):
    """A method that asks a prior; one without ``asks`` asks nothing."""

    @property
    def asks(self) -> tuple[Ask, ...]:
        """Kinds that it will ask for, and of which images."""
        ...


def asks_of(method: Method) -> tuple[Ask, ...]:
    """Questions to a prior; empty for one that asks nothing."""
    return method.asks if isinstance(method, Asking) else ()
