# SPDX-License-Identifier: Apache-2.0
"""The object's shadow, which GOR-IS leaves: what share of the light it blocked, and surfaces without it.

A step beyond the paper. Matte surfaces return the light that reaches them. Rays from each point over its
surface tell which directions the object hides and which others do. One light from far away, the same for all
points, is found so that what reaches points explains how bright they are. Without the object a point is then
as much brighter as more of this light reaches it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.optimize import nnls
from scipy.spatial import KDTree

from graycard.io import Room
from graycard.methods._tensors import float_tensor
from graycard.methods.goris._model import (
    BRIGHTEST,
    DIFFUSE,
    SURROUNDINGS,
    Buffers,
    drawn_buffers,
)
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.goris._training_views import TrainingView
from graycard.methods.removal import widened
from graycard.methods.shading import look_up, solid_angles, texel_directions
from graycard.methods.splat import (
    NEAR_DISTANCE,
    SH_DC,
    Parameters,
    Rays,
    Surfels,
    build_bvh,
    gather,
    surfels_of,
    trace_rays,
)
from graycard.methods.surfels import COEFFICIENTS, DETAIL, srgb_decode_tensor, srgb_encode_tensor

SIZE = 9
"""Texels along the side of a face of the light that is found: 10 degrees each."""
LEAST_COSINE = 0.1
"""Between a ray and the normal: at lower angles a ray meets the uneven surface that it starts on."""
VIEWS, POINTS = 5, 7000
"""Numbers of training views and, about, of their pixels that are looked at."""
LEAST_HIDDEN = 0.003
"""Share of an even sky that the object hides from a point that tells of the light: others are of other
surfaces, whose reflectance is another."""
FEWEST = 50
"""Points without which no light is found."""
_LEAST_SPREAD = 1e-4
"""Least spread of unexplained brightness, so that an even light on an even surface has one solution."""
DOUBT = 10.0
"""Weight of the light being what it was expected to be, times the variance of the logarithm of what points
differ by from what is explained, beside the mean weight of a texel in the points: the more uneven a surface,
the less is it believed."""
EVEN = 0.4
"""Deviation of the logarithm of brightness, beyond which a point counts less and less (Cauchy): reflectance
is not the same everywhere."""
ROUNDS = 3
"""Number of times that the points' weights are updated."""
LEAST_LEFT = 0.25
"""Share of the light that the object is believed to leave a point at least: no point gets brighter than by
the inverse, where next to nothing is known of it."""
_DEVIATION = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
_DARK = 1e-4
_SURE = 1e-3
_COVERED = 0.9
"""Coverage of a pixel by surfels from which on it shows one surface."""
_REACH = 3.5
"""Standard deviations within which a disc's alpha counts: 1/255 is met at 3.3."""


@dataclass(frozen=True, eq=False)
class Sight:
    """Shares of K directions all around that P points see; float32."""

    cosines: torch.Tensor
    """Shape ``(P, K)``: between direction and normal, 0 below :data:`LEAST_COSINE`."""
    others: torch.Tensor
    """Shape ``(P, K)``: what passes all surfels but the object's; 0 where the cosine is."""
    target: torch.Tensor
    """Shape ``(P, K)``: what passes the object."""

    @property
    def emptied(self) -> torch.Tensor:
        """Shape ``(P, K)``: weights of light from the directions, without the object."""
        return self.cosines * self.others

    @property
    def whole(self) -> torch.Tensor:
        """Return the shares with the object in place, shape ``(P, K)``."""
        return self.emptied * self.target

    def of(self, points: torch.Tensor) -> "Sight":
        """Return the shares of the points in a mask ``(P,)``."""
        return Sight(self.cosines[points], self.others[points], self.target[points])

    def weighted(self, sizes: torch.Tensor) -> "Sight":
        """Return the shares with directions weighted by sizes ``(K,)``, sr."""
        return Sight(self.cosines * sizes, self.others, self.target)

    def left(self, light: torch.Tensor) -> torch.Tensor:
        """Share of light that the object leaves each point, by colour, shape ``(P, 3)``, 0 to 1.

        Args:
            light: Shape ``(K, 3)``: of the directions, any unit.
        """
        emptied = self.emptied @ light
        return torch.where(emptied > 0, self.whole @ light / emptied.clamp(min=1e-12), 1.0).clamp(0, 1)


def light_directions() -> tuple[torch.Tensor, torch.Tensor]:
    """Directions of the light's texels, shape ``(K, 3)``, unit, and the size of each, shape ``(K,)``, sr."""
    directions = texel_directions(SIZE).reshape(-1, 3)
    return float_tensor(directions), float_tensor(np.tile(solid_angles(SIZE), (6, 1, 1)).ravel())


@dataclass(frozen=True, eq=False)
class Hiders:
    """Surfels in the way of light."""

    target: Surfels
    """The object's surfels."""
    others: Surfels
    """All others: the surfaces that rays start on, too."""
    near: float
    """Metres, from which on others count."""

    def passed(self, rays: Rays, *, target: bool) -> torch.Tensor:
        """Share of light that passes the object, or all others, along R rays, shape ``(R,)``."""
        surfels = self.target if target else self.others
        nothing = surfels.centres.new_zeros(len(surfels), 0)
        near = NEAR_DISTANCE if target else self.near
        return trace_rays(surfels, rays, nothing, bvh=build_bvh(surfels), near=near).transmittance


def cosines_of(normals: torch.Tensor, directions: torch.Tensor) -> torch.Tensor:
    """Cosines between normals ``(P, 3)`` and directions ``(K, 3)``, 0 below :data:`LEAST_COSINE`."""
    cosines = normals @ directions.T
    return torch.where(cosines > LEAST_COSINE, cosines, 0.0)


@torch.no_grad()
def sight_of(points: torch.Tensor, normals: torch.Tensor, directions: torch.Tensor, hiders: Hiders) -> Sight:
    """Trace rays from points in all directions.

    Args:
        points: Shape ``(P, 3)``, world, metres.
        normals: Shape ``(P, 3)``, unit, to the side that is lit.
        directions: Shape ``(K, 3)``, unit.
        hiders: What is in the way.
    """
    cosines = cosines_of(normals, directions)
    rows, columns = cosines.nonzero(as_tuple=True)
    rays = Rays(points[rows].contiguous(), directions[columns].contiguous())
    others, target = torch.zeros_like(cosines), torch.zeros_like(cosines)
    others[rows, columns] = hiders.passed(rays, target=False)
    target[rows, columns] = hiders.passed(rays, target=True)
    return Sight(cosines, others, target)


@torch.no_grad()
def blocked_light(
    points: torch.Tensor,
    normals: torch.Tensor,
    directions: torch.Tensor,
    light: torch.Tensor,
    hiders: Hiders,
) -> torch.Tensor:
    """Light that would reach points but for the object, shape ``(P, 3)``.

    As :class:`Sight` has it, but rays are traced only where they pass the object's bounding sphere: pictures
    have many pixels.

    Args:
        points: Shape ``(P, 3)``, world, metres.
        normals: Shape ``(P, 3)``, unit.
        directions: Shape ``(K, 3)``, unit.
        light: Shape ``(K, 3)``, times the size of each direction.
        hiders: What is in the way.
    """
    cosines = cosines_of(normals, directions)
    centres, scales = hiders.target.centres, hiders.target.scales
    middle = (centres.amin(dim=0) + centres.amax(dim=0)) / 2
    radius = ((centres - middle).norm(dim=1) + _REACH * scales.amax(dim=1)).amax()
    toward = middle - points
    along = toward @ directions.T
    square = (toward**2).sum(dim=1, keepdim=True)
    near = (square - along**2 < radius**2) & ((along > 0) | (square < radius**2))
    rows, columns = (near & (cosines > 0)).nonzero(as_tuple=True)
    found = points.new_zeros(len(points), 3)
    if not len(rows):
        return found
    rays = Rays(points[rows].contiguous(), directions[columns].contiguous())
    hidden = 1 - hiders.passed(rays, target=True)
    (hit,) = (hidden > _SURE).nonzero(as_tuple=True)
    rows, columns, hidden = rows[hit], columns[hit], hidden[hit]
    passed = hiders.passed(Rays(rays.origins[hit], rays.directions[hit]), target=False)
    weights = cosines[rows, columns] * hidden * passed
    return found.index_add(0, rows, weights[:, None] * light[columns])


def light_found(sight: Sight, brightness: torch.Tensor, expected: torch.Tensor) -> torch.Tensor:
    """Find the light from far away that explains how bright points of a surface are.

    Least squares of relative errors, none of the light below 0, in rounds in which points that are far off
    count less. The less the points tell of a direction, the more its light is what was expected, times one
    factor a colour.

    Args:
        sight: Of P points; directions count as much as they weigh in ``cosines``.
        brightness: Shape ``(P, 3)``, linear.
        expected: Shape ``(K, 3)``, above 0, any unit.

    Returns:
        Shape ``(K, 3)``: light times mean reflectance.
    """
    seen, told = sight.whole.double().numpy(), brightness.double().clamp(min=_DARK).numpy()
    prior, found = expected.double().numpy(), []
    for colour in range(3):
        light = prior[:, colour]
        light = light * np.median(told[:, colour] / np.maximum(seen @ light, _DARK))
        found.append(_explained(seen, told[:, colour], light))
    return float_tensor(np.stack(found, axis=1))


def _explained(seen: np.ndarray, told: np.ndarray, expected: np.ndarray) -> np.ndarray:
    light = expected
    for _ in range(ROUNDS):
        drawn = np.maximum(seen @ light, _DARK)
        off = np.log(told / drawn)
        off -= np.median(off)
        weights = 1 / drawn / (1 + (off / EVEN) ** 2)
        rows = seen * weights[:, None]
        normal = rows.T @ rows
        spread = _DEVIATION * np.median(np.abs(off))
        doubt = DOUBT * max(spread, _LEAST_SPREAD) ** 2 * np.trace(normal) / len(normal)
        root = np.linalg.cholesky(normal + doubt * np.eye(len(normal))).T
        light, _ = nnls(root, np.linalg.solve(root.T, rows.T @ (told * weights) + doubt * expected))
    return light


def scattered(buffers: Buffers, settings: GorisSettings) -> torch.Tensor:
    """Diffuse radiance of pixels, rough ones' too, shape ``(H, W, 3)``, linear, exposed."""
    rough = srgb_decode_tensor(buffers.rough)
    if settings.composite == "paper":
        return rough
    share = buffers.glossy[..., None]
    return share * buffers.diffuse + (1 - share) * rough


@dataclass(frozen=True, eq=False)
class Unshaded:
    """A scene without the object and its shadow."""

    parameters: Parameters
    """Surfels without the object, brightened."""
    added: list[np.ndarray]
    """Radiance that the shadow took from each view, shape ``(H, W, 3)``, linear, exposed, 0 or more."""


@torch.no_grad()
def without_shadow(
    target: Surfels,
    left: Parameters,
    shots: Sequence[TrainingView],
    settings: GorisSettings,
    extent: float,
) -> Unshaded:
    """Remove the object's shadow.

    Args:
        target: The object's surfels.
        left: N others with light transport, and the environment.
        shots: The training views.
        settings: Of the method.
        extent: Of the scene, metres.
    """
    hiders = Hiders(target, surfels_of(left.surfels), settings.near * extent)
    room = Room()
    drawn = [
        room.keep(drawn_buffers(left.all, shot.photograph.camera, shot.photograph.sky, settings))
        for shot in shots
    ]
    maps = shares_left(drawn, shots, left.shared[SURROUNDINGS].exp(), hiders, settings)
    added = [
        room.keep(
            (scattered(one, settings) * (1 / share.clamp(min=LEAST_LEFT) - 1)).numpy().astype(np.float64)
        )
        for one, share in zip(drawn, maps, strict=True)
    ]
    filled = torch.zeros(len(left), 4)
    for shot, share in zip(shots, maps, strict=True):
        image = torch.cat([1 - share, torch.ones_like(share[..., :1])], dim=-1)
        filled += gather(hiders.others, shot.photograph.camera, image)
    return Unshaded(brightened(left, 1 - filled[:, :3] / filled[:, 3:].clamp(min=_SURE)), added)


def shares_left(
    drawn: Sequence[Buffers],
    shots: Sequence[TrainingView],
    sky: torch.Tensor,
    hiders: Hiders,
    settings: GorisSettings,
) -> list[torch.Tensor]:
    """Shares of the light that the object leaves pixels, by colour, one a view, shape ``(H, W, 3)``, 0 to 1.

    Args:
        drawn: The training views without the object.
        shots: The same views.
        sky: Shape ``(6, S, S, 3)``: the environment map, from which the light is expected.
        hiders: What is in the way.
        settings: Of the method.
    """
    directions, sizes = light_directions()
    points, normals, brightness = _evidence(drawn, shots, settings)
    seen = sight_of(points, normals, directions, hiders).weighted(sizes)
    hidden = 1 - seen.left(torch.ones(len(directions), 1))[:, 0]
    telling = hidden > LEAST_HIDDEN
    if int(telling.sum()) < FEWEST:
        return [torch.ones_like(one.diffuse) for one in drawn]
    light = light_found(seen.of(telling), brightness[telling], look_up(sky, directions))
    reached, tree = seen.emptied @ light, KDTree(points.numpy())
    light = light * sizes[:, None]
    found, room = [], Room()
    for one in drawn:
        places, facing = one.points.reshape(-1, 3), one.normal.reshape(-1, 3)
        blocked = blocked_light(places, facing, directions, light, hiders)
        nearest = torch.from_numpy(tree.query(places.numpy())[1])
        share = 1 - blocked / reached[nearest].clamp(min=_DARK).maximum(blocked)
        covered = one.drawn.alpha.flatten()[:, None] > _COVERED
        found.append(room.keep(torch.where(covered, share, 1.0).reshape(one.diffuse.shape)))
    return found


def _evidence(
    drawn: Sequence[Buffers], shots: Sequence[TrainingView], settings: GorisSettings
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Places, normals and diffuse radiance of pixels that do not show the object, each ``(P, 3)``."""
    chosen = range(0, len(shots), max(1, len(shots) // VIEWS))
    pixels = sum(shots[number].target.numel() for number in chosen)
    every, parts = max(1, round((pixels / POINTS) ** 0.5)), []
    for number in chosen:
        one = drawn[number]
        beside = shots[number].target.numpy() > 0
        seen = (one.drawn.alpha > _COVERED) & ~torch.from_numpy(widened(beside, settings.grow))
        layers = one.points, one.normal, scattered(one, settings)
        parts.append([layer[::every, ::every][seen[::every, ::every]] for layer in layers])
    points, normals, brightness = (torch.cat(part) for part in zip(*parts, strict=True))
    return points, normals, brightness


@torch.no_grad()
def brightened(parameters: Parameters, left: torch.Tensor) -> Parameters:
    """Surfels that get all of the light of which the object left them a share.

    Args:
        parameters: N surfels.
        left: Shape ``(N, 3)``; below :data:`LEAST_LEFT` it counts as that.
    """
    own, left = dict(parameters.surfels), left.clamp(min=LEAST_LEFT)
    diffuse = _lit(BRIGHTEST * own[DIFFUSE].sigmoid(), left)
    own[DIFFUSE] = torch.logit(diffuse / BRIGHTEST, eps=_SURE)
    base = SH_DC * own[COEFFICIENTS][:, 0] + 0.5
    new = _lit(base, left)
    own[COEFFICIENTS] = ((new - 0.5) / SH_DC)[:, None]
    own[DETAIL] = own[DETAIL] * torch.where(base > 0, new / base, 1.0)[:, None]
    return Parameters(own, parameters.shared)


def _lit(encoded: torch.Tensor, left: torch.Tensor) -> torch.Tensor:
    """Return encoded colours without the shadow; what is black stays as it is."""
    return torch.where(
        encoded > 0, srgb_encode_tensor(srgb_decode_tensor(encoded.clamp(min=0)) / left), encoded
    )
