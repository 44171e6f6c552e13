# SPDX-License-Identifier: Apache-2.0
"""Start of lamps: of many places the few whose light, with its shadows, explains the photographs.

Pictures are linear in light. On pixels whose place, normal and material are about known, what a lamp of
strength 1 at each of many places would give is found with rays, and non-negative least squares tells how
strong each has to be: nearly all come out dark (inferred; the paper says nothing of where lamps begin).
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.optimize import nnls
from scipy.sparse import csr_matrix
from torch.nn.functional import normalize

from graycard.methods.gsid._bounces import Bounces
from graycard.methods.gsid._model import SOFTEN
from graycard.methods.gsid._settings import GsidSettings, Visibility
from graycard.methods.gsid._visibility import vector_visibility
from graycard.methods.shading import (
    Lamps,
    Material,
    arriving,
    lamp_visibility,
    lit_by_lamps,
    lit_by_surroundings,
    look_up,
    surroundings_of,
)
from graycard.methods.splat import Surfels

SAMPLES = 2000
"""Pixels that are explained."""
GRID = 9
"""Places along the longest side of the box in which lamps are looked for."""
INFLATED = 1.4
"""Sides of that box, over those of the box around surfaces and cameras."""
COVERED = 0.5
"""Share of a pixel that surfels must cover."""
SHAPES = (0.0, 4.0)
"""Sharpnesses of the lobes that a lamp may begin with: alike all round, and a beam to the middle of what is
seen."""
DIM = 0.5
"""Threshold, a share of the mean brightness: pixels that are darker do not count for more, since bounced
light rules there."""
DOUBT = 0.6
"""Doubt of the sky while places of lamps are looked for: as if this share of the samples, by weight, had been
seen black under it alone. What no lamp explains exactly, with shadows and materials that are about known, a
sky of six colours explains in part: without a doubt it hides lamps. Strengths are then solved without doubt:
a fit that begins with a sky held down does not bring it back."""
LEAST_SKY = 0.05
"""Share of the mean radiance that each face of the sky begins with at least. A much darker one stays dark, as
its logarithm moves by small steps."""
HALVINGS = 2
"""Share of the step by which places are looked for between those of the grid."""
_AT_ONCE = 64
"""Places whose light is found at once."""
_SEEN = 0.05
"""Share of the samples that a place must see."""
CLEAR = 0.25
"""Shares of the extent: a lamp hangs at least this far from what is seen. One that is nearer lights next to
nothing and would explain whatever is wrong there."""
_AROUND = 20
"""Samples that may be nearer."""


@dataclass(frozen=True, eq=False)
class Samples:
    """P pixels out of all training views."""

    points: torch.Tensor
    """Shape ``(P, 3)``, world, metres."""
    normal: torch.Tensor
    eye: torch.Tensor
    material: Material
    open: torch.Tensor
    """Shape ``(P,)``: share of the sky's light that arrives."""
    shadow: torch.Tensor
    """Shape ``(P, 3)``: drawn vectors, of any length, see :class:`GsidSettings`."""
    shown: torch.Tensor
    """Shape ``(P, 3)``: what the photographs show, linear, exposed."""
    eyes: torch.Tensor
    """Shape ``(V, 3)``: the cameras' places, metres."""


@dataclass(frozen=True, eq=False)
class ByWay:
    """Light that comes to P pixels by way of other surfaces."""

    bounces: Bounces
    shares: csr_matrix
    """Shape ``(P, M)``: see :meth:`Sight.shares`."""
    albedo: torch.Tensor
    """Shape ``(M, 3)``, of what is matte, of the nodes."""
    open: torch.Tensor
    """Shape ``(M,)``: share of the sky's light that arrives at the nodes."""

    def returned(self, direct: torch.Tensor, diffuse: torch.Tensor) -> torch.Tensor:
        """Return what pixels return of it, shape ``(P, ..., 3)``.

        Args:
            direct: Shape ``(M, ...)``: irradiance of the nodes straight from each light, grey.
            diffuse: Shape ``(P, 3)``: albedo of the pixels.
        """
        columns, found = direct.reshape(len(direct), -1).numpy(), []
        for channel in range(3):
            sent = self.bounces.sent_on(columns, self.albedo[:, channel : channel + 1].numpy())
            arrived = torch.from_numpy(self.shares @ sent)
            found.append(arrived * diffuse[:, channel : channel + 1] / torch.pi)
        return torch.stack(found, dim=-1).reshape(len(diffuse), *direct.shape[1:], 3)


@dataclass(frozen=True, eq=False)
class FirstLights:
    """Lamps, and a sky of six colours, exposed."""

    positions: torch.Tensor
    """Shape ``(k, 3)``, metres."""
    intensities: torch.Tensor
    """Shape ``(k, S, 3)``: of a lobe of each of the first S of the :data:`SHAPES`, on its axis."""
    middle: torch.Tensor
    """Shape ``(3,)``, metres: where the lobes look."""
    sky: torch.Tensor
    """Shape ``(6, 3)``: radiance of the faces of the cubemap, above 0."""


@dataclass(frozen=True, eq=False)
class Search:
    """Looks for lights that explain samples."""

    samples: Samples
    surfels: Surfels
    """Surfels in the way of light."""
    settings: GsidSettings
    extent: float
    """Extent of the scene, metres."""
    by_way: ByWay | None = None
    """Transport of light from surface to surface; None: without it."""

    def places(self) -> torch.Tensor:
        """Return places of up to ``settings.lamps`` lamps that explain the samples, ``(k, 3)``, metres."""
        look, samples = self._look(traced=True), self.samples
        sky, shown = _sky_columns(samples, self.by_way).mean(dim=-1), samples.shown.mean(dim=-1)
        places, spacing = _grid(samples)
        places = places[_distance(places, samples) > CLEAR * self.extent]
        if self.settings.lamps == 0:
            places = places[:0]
        columns, seen = look.columns(places)
        places, columns = places[seen > _SEEN], columns[:, seen > _SEEN]
        levels, _ = _explained(columns.mean(dim=-1)[..., None], sky[..., None], shown[..., None], DOUBT)
        given = (levels[..., 0] * columns.mean(dim=(0, 3))).sum(dim=1)
        merged = _merged(places, given, 1.6 * spacing, self.settings.lamps)
        return _refined(look, merged, sky, spacing / 2)

    def lights_at(self, places: torch.Tensor, *, traced: bool) -> FirstLights:
        """Lamps at places ``(k, 3)`` and a sky, as strong as explains the samples best.

        Args:
            places: Metres.
            traced: Whether rays find what is in the way of lamps; else what the fit begins with does: vectors
                where it has some.
        """
        look, shown = self._look(traced=traced), self.samples.shown
        sent, sky = _explained(look.columns(places)[0], _sky_columns(self.samples, self.by_way), shown, 0)
        return FirstLights(places, sent, look.middle, sky.clamp(min=LEAST_SKY * float(shown.mean())))

    def _look(self, *, traced: bool) -> "_Look":
        form = self.settings.visibility
        form = "traced" if traced and form != "none" else form
        middle = self.samples.points.median(dim=0).values
        return _Look(self.samples, middle, self.surfels, form, self.settings.lobes, self.extent, self.by_way)


def _refined(look: "_Look", places: torch.Tensor, sky: torch.Tensor, step: float) -> torch.Tensor:
    """Places between those of the grid: each in turn goes a step along an axis wherever less is left then.

    Args:
        look: What lamps give.
        places: Shape ``(k, 3)``, metres.
        sky: Shape ``(P, 6)``, grey.
        step: Metres, halved :data:`HALVINGS` times.
    """
    if not len(places):
        return places
    shown = look.samples.shown.mean(dim=-1)
    places, ways = places.clone(), torch.cat([torch.eye(3), -torch.eye(3)])
    columns = look.columns(places)[0].mean(dim=-1)
    for size in [step / 2**level for level in range(HALVINGS + 1) for _ in range(2)]:
        tried = places[:, None] + size * ways
        others = look.columns(tried.flatten(0, 1))[0].mean(dim=-1).unflatten(1, tried.shape[:2])
        least = _left_over(columns, sky, shown)
        for lamp in range(len(places)):
            for way in range(len(ways)):
                moved = columns.clone()
                moved[:, lamp] = others[:, lamp, way]
                left = _left_over(moved, sky, shown)
                if left < least:
                    least, columns, places[lamp] = left, moved, tried[lamp, way]
    return places


def _grid(samples: Samples) -> tuple[torch.Tensor, float]:
    """Places in a box around what is seen and the cameras, shape ``(C, 3)``, and how far apart, metres."""
    inside = torch.cat([samples.points, samples.eyes])
    low, high = inside.quantile(0.005, dim=0), inside.quantile(0.995, dim=0)
    low, high = torch.minimum(low, samples.eyes.amin(dim=0)), torch.maximum(high, samples.eyes.amax(dim=0))
    middle, half = (low + high) / 2, (high - low) / 2 * INFLATED
    spacing = float(2 * half.max() / (GRID - 1))
    counts = (2 * half / spacing).floor().long() + 1
    axes = [
        m + (torch.arange(int(n)) - (int(n) - 1) / 2) * spacing for m, n in zip(middle, counts, strict=True)
    ]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 3), spacing


def _distance(places: torch.Tensor, samples: Samples) -> torch.Tensor:
    """Return how far places are from what is seen, but for a few samples, shape ``(C,)``, metres."""
    count = min(_AROUND, len(samples.points))
    return torch.cdist(places, samples.points).kthvalue(count, dim=1).values


@dataclass(frozen=True, eq=False)
class _Look:
    """Effects of lamps at any place."""

    samples: Samples
    middle: torch.Tensor
    surfels: Surfels
    form: Visibility
    """Model of what is in the way of lamps."""
    lobes: int
    extent: float
    by_way: ByWay | None

    def columns(self, places: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Light of lobes of 1 W/sr, ``(P, C, S, 3)``, and the share of the samples that each place sees."""
        parts = [self._columns(some) for some in places.split(_AT_ONCE)]
        columns, seen = zip(*parts, strict=True)
        return torch.cat(columns, dim=1), torch.cat(seen)

    def _columns(self, places: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        samples = self.samples
        arrival = arriving(self._lamps(places, 0.0), samples.points, SOFTEN * self.extent)
        reached = torch.ones(len(samples.points), len(places))
        if self.form == "traced":
            reached = lamp_visibility(self.surfels, samples.points, places, self.extent)
        elif self.form != "none":
            reached = vector_visibility(self.form, samples.shadow, arrival.toward)
        arrival = arrival._replace(facing=arrival.facing * reached[..., None])
        even = lit_by_lamps(samples.material, samples.normal, samples.eye, arrival).whole
        shapes = SHAPES[: self.lobes]
        beams = [self._lamps(places, sharpness).intensity(-arrival.toward) for sharpness in shapes]
        found = torch.stack([even * beam for beam in beams], dim=2)
        if self.by_way is not None:
            sight = self.by_way.bounces.seen_from
            direct = sight.lit_by(self._lamps(places, 0.0), SOFTEN * self.extent)[..., 0]
            away = normalize(sight.nodes[:, None] - places, dim=-1)
            beams = [self._lamps(places, sharpness).intensity(away)[..., 0] for sharpness in shapes]
            on_nodes = torch.stack([direct * beam for beam in beams], dim=2)
            found = found + self.by_way.returned(on_nodes, samples.material.diffuse)
        return found, reached.mean(dim=0)

    def _lamps(self, places: torch.Tensor, sharpness: float) -> Lamps:
        ones = torch.ones(len(places), 1, 3)
        axes = (self.middle - places)[:, None] + 1e-3
        return Lamps(places, axes, torch.full((len(places), 1), sharpness), ones)


def _sky_columns(samples: Samples, by_way: ByWay | None) -> torch.Tensor:
    """Light that each face of the cubemap gives with a radiance of 1, shape ``(P, 6, 3)``."""
    columns = []
    for face in range(6):
        sky = torch.zeros(6, 1, 1, 3)
        sky[face] = 1
        surroundings = surroundings_of(sky)
        lit = lit_by_surroundings(samples.material, samples.normal, samples.eye, surroundings)
        columns.append(lit.whole * samples.open[:, None])
        if by_way is not None:
            facing = by_way.bounces.seen_from.facing
            direct = by_way.open * look_up(surroundings.irradiance, facing)[..., 0]
            columns[-1] = columns[-1] + by_way.returned(direct, samples.material.diffuse)
    return torch.stack(columns, dim=1)


def _explained(
    lamps: torch.Tensor, sky: torch.Tensor, shown: torch.Tensor, doubt: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Strengths ``(C, S, channels)`` and the sky's ``(6, channels)``: non-negative least squares.

    Errors count in shares of a pixel's brightness, as far as that is above a share of the mean. The sky is
    held down by ``doubt``, see :data:`DOUBT`; without any the strengths of exact columns are exact.
    """
    weights = 1 / (shown.mean(dim=-1) + DIM * shown.mean())
    found = [
        _solved(lamps[..., channel], sky[..., channel], shown[:, channel], weights, doubt)[0]
        for channel in range(shown.shape[-1])
    ]
    strengths = torch.from_numpy(np.stack(found, axis=-1)).float()
    return strengths[:-6].reshape(*lamps.shape[1:3], shown.shape[-1]), strengths[-6:]


def _left_over(lamps: torch.Tensor, sky: torch.Tensor, shown: torch.Tensor) -> float:
    """Return what grey columns do not explain at best: root of the sum of squares."""
    return _solved(lamps, sky, shown, 1 / (shown + DIM * shown.mean()), DOUBT)[1]


def _solved(
    lamps: torch.Tensor, sky: torch.Tensor, shown: torch.Tensor, weights: torch.Tensor, doubt: float
) -> tuple[np.ndarray, float]:
    """Strengths of columns of one channel, ``(P, C, S)`` and ``(P, 6)``, and what is left."""
    columns = torch.cat([lamps.flatten(1), sky], dim=1) * weights[:, None]
    held = torch.diag(doubt * columns.norm(dim=0))[-sky.shape[1] :]
    target = torch.cat([shown * weights, torch.zeros(len(held))])
    return nnls(torch.cat([columns, held]).double().numpy(), target.double().numpy())


def _merged(places: torch.Tensor, given: torch.Tensor, reach: float, most: int) -> torch.Tensor:
    """Middles of groups of places, brightest first, shape ``(k, 3)``.

    Args:
        places: Shape ``(C, 3)``.
        given: Shape ``(C,)``: mean brightness that each gives.
        reach: Metres: how far places of one group are from its brightest.
        most: Groups.
    """
    found: list[tuple[float, torch.Tensor]] = []
    left = given.clone()
    while bool((left > 0).any()):
        near = ((places - places[left.argmax()]).norm(dim=-1) <= reach) & (left > 0)
        found.append(
            (float(left[near].sum()), (left[near, None] * places[near]).sum(dim=0) / left[near].sum())
        )
        left[near] = 0
    found.sort(key=lambda group: -group[0])
    return torch.stack([place for _, place in found[:most]]) if found else torch.zeros(0, 3)


def enough_cover(alpha: torch.Tensor) -> torch.Tensor:
    """Pixels that surfels cover well enough to be explained, bool, of the same shape."""
    return alpha > COVERED
