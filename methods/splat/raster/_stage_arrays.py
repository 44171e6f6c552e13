# SPDX-License-Identifier: Apache-2.0
"""The arrays that one stage of the engine hands to the next."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from graycard import Camera
from graycard.methods.splat.raster._blocks import GROUP, LANES, PIXELS, SIXTEEN
from graycard.methods.splat.raster._tiles import TileLists


class Discs(NamedTuple):
    """N surfels as kernels read them, in one floating dtype."""

    centres: np.ndarray
    """Shape ``(N, 3)``, world."""
    rotations: np.ndarray
    """Shape ``(N, 4)``, quaternions."""
    scales: np.ndarray
    """Shape ``(N, 2)``."""
    opacities: np.ndarray
    """Shape ``(N,)``."""
    offsets: np.ndarray
    """Shape ``(N, 2)``, pixels."""


class View(NamedTuple):
    """A camera as kernels read it."""

    pose: np.ndarray
    """Shape ``(4, 4)``, world to camera."""
    K: np.ndarray
    """Shape ``(3, 3)``."""
    to_rays: np.ndarray
    """Its inverse."""
    width: float
    """Width of the image, pixels, as is the height."""
    height: float


class Prepared(NamedTuple):
    """Arrays of N surfels for the pixel kernels."""

    rows: np.ndarray
    """Float32, flat, ``COLUMNS`` a surfel."""
    bounds: np.ndarray
    """Int32 ``(N, 4)``, pixels."""
    features: np.ndarray
    """Float32, flat, ``channels`` a surfel."""
    channels: int
    """Their number, at least one."""


class Canvas(NamedTuple):
    """Outputs of the forward kernel for of an image without geometry."""

    image: np.ndarray
    """Float32 ``(H, W, channels)``."""
    transmittance: np.ndarray
    """Float32 ``(H, W)``: what is left of the light from behind."""
    masks: np.ndarray
    """Uint16 ``(pairs,)``, written where drawn: the blocks that a surfel covers in a tile."""
    drawn: np.ndarray
    """Int32 ``(tiles,)``: how many of a tile's list were looked at."""
    visits: np.ndarray
    """Int32 ``(tiles,)``: how often a surfel was evaluated on a block."""


class Upstream(NamedTuple):
    """Derivatives of the loss by two of a ``Canvas``, contiguous float32."""

    image: np.ndarray
    transmittance: np.ndarray


class UpstreamShape(NamedTuple):
    """Derivatives of the loss by the maps of a ``Shape``, and what the way back needs with them."""

    normals: np.ndarray
    """Float32, flat, three a surfel, in the world."""
    normal: np.ndarray
    """This and the next two as in ``Shape``."""
    moments: np.ndarray
    ranks: np.ndarray
    to_normal: np.ndarray
    """Contiguous float32, as are the next three."""
    to_depth: np.ndarray
    to_distortion: np.ndarray
    to_median: np.ndarray


class Pairs(NamedTuple):
    """The pairs of surfels and tiles, and room for their gradients."""

    start: np.ndarray
    """See in ``TileLists``."""
    listed: np.ndarray
    """``TileLists.surfels``."""
    slots: np.ndarray
    """Int64 ``(N + 1,)``, where the pairs of each surfel begin."""
    to_geometry: np.ndarray
    """Float32, flat, ``LANES`` a pair, to be written."""


class Channels(NamedTuple):
    """Slots of channels and normals that have no room beside the geometry."""

    to_channels: np.ndarray
    """Float32, flat, ``stride`` a pair, to be written: channels, then, from ``first_normal`` on, normals."""
    stride: int
    """A multiple of ``GROUP``."""


class Found(NamedTuple):
    """Parameters of N surfels for the pixel kernels."""

    rows: np.ndarray
    """Float32 ``(N, COLUMNS)``, see ``_coefficients``."""
    slots: np.ndarray
    """Int64 ``(N + 1,)``, where the pairs of each surfel begin."""
    to_geometry: np.ndarray
    """Float32, flat: gradients of the pairs, ``LANES`` each."""


@dataclass(frozen=True)
class Scene:
    """Inputs of drawing, as contiguous arrays of one floating dtype."""

    centres: np.ndarray
    """Shape ``(N, 3)``; this and the next three as in ``Surfels``."""
    rotations: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    features: np.ndarray
    """Shape ``(N, padded_channels(C))``, float32."""
    offsets: np.ndarray
    """Shape ``(N, 2)``, pixels."""
    camera: Camera
    shaped: bool
    """True if normals, depths and distortion are drawn as well."""

    @property
    def discs(self) -> Discs:
        """The surfels without features."""
        return Discs(self.centres, self.rotations, self.scales, self.opacities, self.offsets)

    @cached_property
    def view(self) -> View:
        """The camera."""
        K, size = np.ascontiguousarray(self.camera.K), (self.camera.width, self.camera.height)
        return View(self.camera.world_to_camera, K, np.linalg.inv(K), float(size[0]), float(size[1]))

    @property
    def size(self) -> tuple[int, int]:
        """Height and width, pixels."""
        return self.camera.height, self.camera.width

    @property
    def templates(self) -> tuple[tuple[int, ...] | None, tuple[int, ...] | None]:
        """``template`` and ``sixteen`` of the kernels."""
        channels = self.features.shape[1]
        return (0,) * (channels % GROUP) or None, SIXTEEN if channels >= GROUP else None


@dataclass(frozen=True)
class Projected:
    """Outputs of ``_project_forward.project``, see there."""

    rows: np.ndarray
    bounds: np.ndarray
    depths: np.ndarray
    normals: np.ndarray


@dataclass(frozen=True)
class Lists:
    """Lists: which surfels touch which tiles."""

    tiles: TileLists
    slots: np.ndarray
    """Shape ``(N + 1,)``, int64: where the pairs of each surfel begin, in an order of pairs by surfel."""


class Shape(NamedTuple):
    """Geometry that was drawn; the first four are maps."""

    normal: np.ndarray
    depth: np.ndarray
    distortion: np.ndarray
    median_depth: np.ndarray
    moments: np.ndarray
    """Flat, float32: for each block of each tile four vectors, the sums of w, w z, w / z and w / z^2."""
    ranks: np.ndarray
    """Flat, float32, a vector a block: place in the tile's list of the surfel of the median depth, or -1."""


@dataclass(frozen=True)
class Drawn:
    """Outputs of ``_forward.forward``, see there."""

    image: np.ndarray
    transmittance: np.ndarray
    masks: np.ndarray
    drawn: np.ndarray
    visits: np.ndarray
    shape: Shape | None

    @property
    def canvas(self) -> Canvas:
        """The arrays without the shape."""
        return Canvas(self.image, self.transmittance, self.masks, self.drawn, self.visits)

    @property
    def forward_lanes(self) -> int:
        """Pixels at which surfels were evaluated."""
        return LANES * int(self.visits.sum())

    def backward_lanes(self, lists: Lists) -> int:
        """Pixels at which surfels are evaluated again, on the way back."""
        ends = lists.tiles.start[:-1] + self.drawn
        spans = zip(lists.tiles.start[:-1], ends, strict=True)
        return LANES * sum(int(np.bitwise_count(self.masks[first:past]).sum()) for first, past in spans)


@dataclass(frozen=True)
class Slots:
    """Outputs of ``_backward.backward``, see there."""

    geometry: np.ndarray
    channels: np.ndarray | None
    stride: int


class Gradients(NamedTuple):
    """Derivatives of the loss, shaped and typed as what they are of; features in float32."""

    centres: np.ndarray
    rotations: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    features: np.ndarray
    offsets: np.ndarray


def working_bytes(*stages: object) -> int:
    """Memory of all arrays that the results of stages hold, nested ones included."""
    total = 0
    for stage in stages:
        values = stage if isinstance(stage, tuple) else list(vars(stage).values())
        arrays = [value for value in values if isinstance(value, np.ndarray)]
        nested = [value for value in values if isinstance(value, TileLists | Shape)]
        total += sum(array.nbytes for array in arrays) + working_bytes(*nested)
    return total


def vectors(count: int, width: int) -> np.ndarray:
    """Rows of float32 that begin with lines of the cache, for widths that are multiples of ``LANES``."""
    return rows_in(np.empty(count * width + LANES, np.float32), count, width)


def rows_in(room: np.ndarray, count: int, width: int) -> np.ndarray:
    """Return the rows of :func:`vectors` in the memory of a flat array of float32.

    Raises:
        ValueError: It has no room for them.
    """
    first = (-room.ctypes.data % 64) // 4
    return room[first : first + count * width].reshape(count, width)


def empty_shape(size: tuple[int, int], tiles: int) -> Shape:
    """Room for what is drawn beside channels, to be written."""
    depth, distortion, median = (np.empty(size, np.float32) for _ in range(3))
    moments, ranks = (vectors(tiles, count * PIXELS).reshape(-1) for count in (4, 1))
    return Shape(np.empty((*size, 3), np.float32), depth, distortion, median, moments, ranks)
