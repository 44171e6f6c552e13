# SPDX-License-Identifier: Apache-2.0
"""Light that goes from surface to surface, as matte surfaces send it on (radiosity: Goral et al. 1984).

The paper has no such light; a room has. Without it lamps that are fitted to photographs have to light corners
which no lamp reaches: non-negative least squares then finds lamps where there are none (inferred).

Which surfaces a point sees does not depend on light, so rays are traced once. They end at the nearest of some
surfels, the nodes, which stand for all others.
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree

from graycard.methods.shading import (
    SKY_DIRECTIONS,
    SLACK,
    Shining,
    Surroundings,
    arriving,
    hemisphere,
    lamp_visibility,
    look_up,
)
from graycard.methods.splat import Surfels, build_bvh, trace_rays

NODES = 1500
"""Surfels that stand for all."""
BOUNCES = 4
"""Times that light is sent on: of a white room of albedo 0.7 a quarter is still on its way after four."""


@dataclass(frozen=True, eq=False)
class Bounces:
    """Visibility between N surfels."""

    nodes: np.ndarray
    """Shape ``(M,)``: numbers of the surfels that stand for all."""
    between: csr_matrix
    """Shape ``(M, M)``: share of a node's irradiance that comes from each, were all as bright."""
    onto: csr_matrix
    """Shape ``(N, M)``: the same for every surfel."""
    seen_from: "Sight"
    """For other points."""

    def sent_on(self, direct: np.ndarray, albedo: np.ndarray) -> np.ndarray:
        """All that nodes send: what falls on them, straight and by way of others, times albedo.

        Args:
            direct: Shape ``(M, C)``: irradiance straight from the lights; any number of columns.
            albedo: Shape ``(M, C)`` or ``(M, 1)``.

        Returns:
            Radiosity, shape ``(M, C)``, of the unit of ``direct``.
        """
        total = albedo * direct
        for _ in range(BOUNCES - 1):
            total = albedo * (direct + self.between @ total)
        return total


@dataclass(frozen=True, eq=False)
class Sight:
    """Visible nodes: which nodes points see."""

    surfels: Surfels
    extent: float
    nodes: torch.Tensor
    """Shape ``(M, 3)``: their places, metres."""
    facing: torch.Tensor
    """Shape ``(M, 3)``: their normals, unit, to the side that is lit."""

    @torch.no_grad()
    def lit_by(self, lamps: Shining, soften: float, reached: torch.Tensor | None = None) -> torch.Tensor:
        """Irradiance of the nodes straight from each of K lamps, shape ``(M, K, 3)``.

        Args:
            lamps: K of them.
            soften: Metres, see :func:`graycard.methods.shading.arriving`.
            reached: Shape ``(M, K)``: share of each lamp's light that arrives; None: rays find it.
        """
        if reached is None:
            reached = lamp_visibility(self.surfels, self.nodes, lamps.positions, self.extent)
        arrival = arriving(lamps, self.nodes, soften)
        cosine = (arrival.toward * self.facing[:, None]).sum(dim=-1).relu()
        return arrival.facing * (cosine * reached)[..., None]

    def shares(self, points: torch.Tensor, normals: torch.Tensor) -> csr_matrix:
        """Share of each node in the irradiance of points, were all as bright, shape ``(P, M)``.

        A ray that meets the dark side of a surface brings nothing.

        Args:
            points: Shape ``(P, 3)``, metres.
            normals: Shape ``(P, 3)``, unit.
        """
        with torch.no_grad():
            rays = hemisphere(points, normals, self.extent)
            met = trace_rays(
                self.surfels,
                rays,
                self.surfels.centres.new_zeros(len(self.surfels), 0),
                bvh=build_bvh(self.surfels),
                near=SLACK * self.extent,
            )
        places = (rays.origins + met.depth[:, None] * rays.directions).numpy()
        nearest = np.asarray(KDTree(self.nodes.numpy()).query(places)[1])
        lit = (rays.directions.numpy() * self.facing.numpy()[nearest]).sum(axis=1) < 0
        brought = np.where(lit, 1 - met.transmittance.numpy(), 0) / SKY_DIRECTIONS
        rows = np.repeat(np.arange(len(points)), SKY_DIRECTIONS)
        kept = brought > 0
        shape = (len(points), len(self.nodes))
        return csr_matrix((brought[kept].astype(np.float32), (rows[kept], nearest[kept])), shape=shape)


def bounces_between(surfels: Surfels, normals: torch.Tensor, extent: float) -> Bounces:
    """Find what surfels see of each other; the same surfels see the same.

    Args:
        surfels: N of them.
        normals: Shape ``(N, 3)``, world, unit, to the side that is lit.
        extent: Of the scene, metres.
    """
    count = min(NODES, len(surfels))
    nodes = np.sort(np.random.default_rng(0).choice(len(surfels), count, replace=False))
    sight = Sight(surfels, extent, surfels.centres[nodes], normals[nodes])
    onto = sight.shares(surfels.centres, normals)
    return Bounces(nodes, onto[nodes], onto, sight)


@torch.no_grad()
def bounced_light(
    bounces: Bounces,
    albedo: torch.Tensor,
    lamps: Shining,
    surroundings: Surroundings,
    opened: torch.Tensor,
    soften: float,
    *,
    reached: torch.Tensor | None = None,
) -> torch.Tensor:
    """Irradiance of all surfels by way of other surfaces, light by light, without gradient.

    Args:
        bounces: Of the scene.
        albedo: Shape ``(N, 3)``, of what is matte.
        lamps: K of them.
        surroundings: In the unit of the lamps.
        opened: Shape ``(N,)``: share of the sky's light that arrives at each surfel.
        soften: Metres, see :func:`graycard.methods.shading.arriving`.
        reached: Shape ``(M, K)``: share of each lamp's light that arrives at the nodes; None: rays find it.

    Returns:
        Shape ``(N, K + 1, 3)``: of the lamps, then of the surroundings.
    """
    chosen = torch.from_numpy(bounces.nodes)
    by_lamps = bounces.seen_from.lit_by(lamps, soften, reached)
    by_sky = opened[chosen, None] * look_up(surroundings.irradiance, bounces.seen_from.facing)
    direct = torch.cat([by_lamps, by_sky[:, None]], dim=1)
    lights = direct.shape[1]
    sent = bounces.sent_on(direct.flatten(1).numpy(), albedo[chosen].repeat(1, lights).numpy())
    return torch.from_numpy(bounces.onto @ sent).reshape(-1, lights, 3)
