# SPDX-License-Identifier: Apache-2.0
"""Specification of a scene: which family, which seed, which knobs, and how it is photographed."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

from graycard import Sensor
from graycard.dataset import SECRET_SEEDS
from graycard.io import IN_MEMORY, MOST_PIXELS, Name

GENERATOR_VERSION = 7
"""Raised whenever the same spec gives other pictures, or files that hold other layers."""

NEEDED_VERSION = 2
"""Raised whenever files of scenes with ``training_layers = "needed"`` hold other layers, and no others do."""

BANDS_VERSION = 1
"""Raised whenever pictures that are traced in bands change, and no others do."""

MOST_PATHS = 2**24
"""Light paths of an independent image that are followed at once: 256 x 256 pixels with 256 samples.

Larger pictures are traced in bands of rows. With another number they differ: raise ``BANDS_VERSION`` then.
"""
DIRECTIONS = 256
"""Directions at each pixel that an albedo is found from, stratified: a matte surface is known exactly,
LambertGGX and rough conductors to about 1/500, the principled material, whose lobes cannot be asked for one
by one, to about 1/100.
"""
TRAINING_DIRECTIONS = 64
"""The same of a training view with the needed layers alone: gauges are means over many pixels."""
SUB_BUFFERS = 4
"""A radiance is the mean of this many independent images, and its variance is found from their spread."""


@dataclass(frozen=True, slots=True)
class CaptureSettings:
    """Capture settings of a scene; truth is as it is.

    Raises:
        ValueError: A number is out of its range.
    """

    points: int = 2000
    """Most sparse points, as structure from motion would find them; a dark or smooth scene has fewer."""
    point_noise: float = 0.5
    """Standard deviation of where a point is found in a photograph, pixels."""
    outliers: float = 0.015
    """Share of the points that are wrong matches."""
    bits: int = 0
    """Bits of photographs, sRGB-encoded; 0 keeps linear light without rounding."""
    shot_noise: float = 0.0
    """Electrons that a pixel counts at white, such as 8000; 0 for light without noise."""
    read_noise: float = 0.0
    """Standard deviation of reading a pixel, electrons."""
    exposure_spread: float = 0.0
    """Most stops by which a view is exposed longer or shorter than the scene; the factor is told."""

    def __post_init__(self) -> None:
        Sensor(self.bits, self.shot_noise, self.read_noise)  # checks them
        for name in ("points", "point_noise", "exposure_spread"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise ValueError(f"expected {name} to be 0 or more, got {value}")
        if not 0 <= self.outliers < 1:
            raise ValueError(f"expected outliers to be a share from 0 to below 1, got {self.outliers}")


TrainingLayers = Literal["all", "needed"]


@dataclass(frozen=True, slots=True)
class RenderSettings:
    """Render settings.

    Raises:
        ValueError: A number is out of its range, or ``samples`` is not 4 times a square.
    """

    width: int = 112
    """Pixels."""
    height: int = 112
    """Pixels."""
    train_views: int = 8
    test_views: int = 3
    samples: int = 64
    """Light paths per pixel: 4 times a square, since they are stratified in four independent images."""
    max_depth: int = 5
    """Most segments of a light path; 2 is direct light only, 1 shows the sources alone."""
    relighting: bool = True
    """True if the held-out views are made under changed lights too."""
    composition: bool = True
    """True if they are made with an object of another scene in them too, where lights stand still."""
    capture: CaptureSettings = field(default_factory=CaptureSettings)
    """Products of the rendered pictures."""
    training_samples: int = 0
    """Light paths per pixel of training views, whose noise photographs show; 0 for as many as of others."""
    training_layers: TrainingLayers = "all"
    """Layers of training views: ``all``, or what methods, gauges and priors need. Those are the
    radiance, what is seen at the pixel centres, and the scene without its target."""

    def __post_init__(self) -> None:
        for name, low in (
            ("width", 4),
            ("height", 4),
            ("train_views", 2),
            ("test_views", 1),
            ("max_depth", 1),
        ):
            if getattr(self, name) < low:
                raise ValueError(f"expected {name} to be {low} or more, got {getattr(self, name)}")
        if self.width * self.height > MOST_PIXELS:
            size = f"{self.width}x{self.height}"
            raise ValueError(f"expected pictures of {MOST_PIXELS} pixels at most, got {size}")
        _check_samples("samples", self.samples)
        if self.training_samples:
            _check_samples("training_samples", self.training_samples)
        if self.training_layers not in get_args(TrainingLayers):
            names = " or ".join(get_args(TrainingLayers))
            raise ValueError(f"expected training_layers to be {names}, got {self.training_layers!r}")

    def for_split(self, split: str) -> "RenderSettings":
        """Return the settings with the samples of the views of a split, ``train`` or ``test``."""
        if split == "test" or not self.training_samples:
            return self
        return replace(self, samples=self.training_samples)

    def directions(self, split: str) -> int:
        """Return the directions that albedos of a split, ``train`` or ``test``, are found from."""
        few = split == "train" and self.training_layers == "needed"
        return TRAINING_DIRECTIONS if few else DIRECTIONS

    @property
    def centre_samples(self) -> int:
        """Light paths for what is estimated at a pixel's centre: about a quarter, and 4 times a square too.

        There is no edge and no texture to average over, so that less gives the same noise.
        """
        return SUB_BUFFERS * max(1, math.isqrt(self.samples // SUB_BUFFERS) // 2) ** 2

    @property
    def in_bands(self) -> bool:
        """Tell whether some pictures have more light paths than are followed at once."""
        most = max(DIRECTIONS, max(self.samples, self.training_samples) // SUB_BUFFERS)
        return self.width * self.height * most > MOST_PATHS

    @property
    def views(self) -> int:
        """Number of all views."""
        return self.train_views + self.test_views


def _check_samples(name: str, samples: int) -> None:
    share, rest = divmod(samples, SUB_BUFFERS)
    if samples < SUB_BUFFERS or rest or math.isqrt(share) ** 2 != share:
        raise ValueError(
            f"expected {name} to be {SUB_BUFFERS} times a square (16, 36, 64, 100, 144, 256 ...), "
            f"got {samples}"
        )


@dataclass(frozen=True, slots=True)
class SceneSpec:
    """One scene: everything in it follows from this record.

    Raises:
        ValueError: The seed is negative.
    """

    track: Name
    family: Name
    seed: int
    knobs: Mapping[str, Any] = field(default_factory=dict)
    """Values that differ from the family's defaults, by name."""

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"expected a seed of 0 or more, got {self.seed}")


@dataclass(frozen=True, slots=True)
class SecretSpec(SceneSpec):
    """A scene whose seed is known to those alone who hold the salt of a suite.

    Neither its text nor its JSON has the seed.

    Raises:
        ValueError: The seed is none of :data:`graycard.dataset.SECRET_SEEDS`, or there is no name.
    """

    seed: int = field(repr=False, metadata=IN_MEMORY)
    name: Name = ""
    """Name of the scene's folder, in place of one that has the seed in it."""

    def __post_init__(self) -> None:
        if self.seed not in SECRET_SEEDS or not self.name:
            raise ValueError("expected a seed of secret scenes and a name, got others")
