# SPDX-License-Identifier: Apache-2.0
"""``gray``: what one scores without looking; every method must beat it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard import Camera, Capture, Light, Progress
from graycard.methods._contract import Priors, check_layers
from graycard.methods._store import restore, store, whole_decomposition


@dataclass(frozen=True, slots=True)
class GraySettings:
    """Settings of ``gray``."""

    reflectance: float = 0.18
    """The constant albedo: 18 % is the photographer's gray card."""

    def __post_init__(self) -> None:
        """Check the range."""
        if not 0 < self.reflectance <= 1:
            raise ValueError(f"expected a reflectance in (0, 1], got {self.reflectance}")


@dataclass(frozen=True, slots=True)
class Gray:
    """A constant albedo, a constant radiance, and normals that face the camera."""

    reflectance: float
    radiance: tuple[float, float, float]
    """Mean of the training photographs, W/m²/sr."""

    @property
    def provides(self) -> frozenset[str]:
        """Albedo, normal and radiance."""
        return frozenset({"base_color", "normal", "radiance"})

    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the constants, for any camera.

        Raises:
            MethodError: A layer is not provided.
        """
        check_layers(layers, self.provides)
        shape = (camera.height, camera.width, 3)
        images = {
            "base_color": np.full(shape, self.reflectance, np.float32),
            "normal": -camera.rays().astype(np.float32),
            "radiance": np.full(shape, self.radiance, np.float32),
        }
        return {name: images[name] for name in layers}

    def lights(self) -> tuple[Light, ...] | None:
        """None: it looks for none."""
        return None

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        store(folder, "gray", {"reflectance": self.reflectance}, {"radiance": np.array(self.radiance)})


class GrayMethod:
    """Constant 18 % albedo, normals that face the camera, the mean photograph everywhere."""

    summary = "Constant 18 % albedo, normals facing the camera, mean colour of the photographs"
    needs = ()
    settings_type = GraySettings

    def fit(
        self, capture: Capture, priors: Priors, settings: GraySettings, seed: int, progress: Progress
    ) -> Gray:
        """Average the training photographs."""
        means = [capture.photograph(view).mean(axis=(0, 1), dtype=np.float64) for view in capture.train]
        red, green, blue = np.mean(means, axis=0).tolist()
        return Gray(settings.reflectance, (red, green, blue))

    def load(self, folder: Path) -> Gray:
        """Return a saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        with whole_decomposition(folder):
            facts, arrays = restore(folder, "gray")
            if arrays["radiance"].shape != (3,):
                raise ValueError(f"expected a radiance of shape (3,), got {arrays['radiance'].shape}")
            red, green, blue = arrays["radiance"].tolist()
            return Gray(float(facts["reflectance"]), (red, green, blue))
