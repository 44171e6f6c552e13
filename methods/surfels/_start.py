# SPDX-License-Identifier: Apache-2.0
"""Start of surfels: on the sparse points of a capture, or on surfaces that are known."""

from collections.abc import Sequence

import numpy as np
import torch

from graycard import Capture, MethodError, Points, srgb_encode
from graycard.methods._contract import Priors
from graycard.methods.splat import (
    SH_DC,
    Parameters,
    coefficient_count,
    parameters_of,
    surfels_from_points,
    surfels_on_surface,
)
from graycard.methods.splat import Surfels as Discs
from graycard.methods.surfels._fill import surfels_between
from graycard.methods.surfels._settings import SurfelSettings
from graycard.methods.surfels._sweep import SweptDepth

COEFFICIENTS, DETAIL, SKY = "coefficients", "detail", "sky"
"""Names of the parameters beside geometry: the harmonics of degree zero, those above, and the sky's."""
OPACITY = 0.5
"""Distance of surfels between points."""
FEWEST = 4
"""Sparse points with which a fit begins."""


def sparse_start(
    capture: Capture, settings: SurfelSettings, seed: int, known: Sequence[np.ndarray] | None = None
) -> Parameters:
    """Parameters of :func:`sparse_discs`.

    Raises:
        MethodError: There are too few points.
    """
    return with_colours(sparse_discs(capture, settings.surfels, settings.fill, seed, known), settings)


def sparse_discs(
    capture: Capture,
    count: int,
    fill: float,
    seed: int,
    known: Sequence[np.ndarray] | None = None,
    swept: Sequence[SweptDepth] | None = None,
) -> Discs:
    """Round discs where stereo finds depth, else on the sparse points, facing the cameras that found them.

    Args:
        capture: The photographs; the discs' features are their encoded colours.
        count: Discs that there may be in the end.
        fill: Share of them that begin where stereo finds depth; 0: none.
        seed: Of the fit.
        known: Of each training view the depth where it is not left to stereo, see :func:`surfels_between`.
        swept: Results of :func:`stereo_depths`, where they are there.

    Raises:
        MethodError: There are too few points.
    """
    points = capture.points()
    if len(points) < FEWEST:
        raise MethodError(
            f"expected {FEWEST} or more sparse points in the capture of {capture.scene}, got {len(points)}. "
            "Import it with its points, or render it anew"
        )
    between = surfels_between(capture, points, round(fill * count), OPACITY, seed, known=known, swept=swept)
    if between is not None:
        return between
    toward = _toward_cameras(capture, points)
    return surfels_from_points(points.positions, toward, points.colors / 255.0)


def _toward_cameras(capture: Capture, points: Points) -> np.ndarray:
    """Return the mean direction from each point to the cameras that found it, shape ``(N, 3)``, of any
    length.
    """
    eyes = np.array([view.camera.position for view in capture.views])
    toward = np.zeros_like(points.positions)
    away = eyes[points.view] - points.positions[points.point]
    np.add.at(toward, points.point, away / np.linalg.norm(away, axis=1, keepdims=True))
    unseen = np.linalg.norm(toward, axis=1) < 1e-6
    toward[unseen] = eyes.mean(axis=0) - points.positions[unseen]
    return toward


def oracle_start(capture: Capture, priors: Priors, settings: SurfelSettings, seed: int) -> Parameters:
    """Discs that cover what the training views see of the true surfaces.

    Raises:
        MethodError: Depth or normals were not handed in, or nothing is seen.
    """
    seen = [_oriented_points(capture, priors, view.name) for view in capture.train]
    points, normals, colours, sizes = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    if len(points) < FEWEST:
        raise MethodError(f"expected views that see surfaces, got {len(points)} pixels with a finite depth")
    discs = surfels_on_surface(points, normals, colours, settings.surfels, seed, sizes=sizes)
    return with_colours(discs, settings)


def _oriented_points(capture: Capture, priors: Priors, name: str) -> tuple[np.ndarray, ...]:
    """Points, unit normals, display colours and distances of the pixels of a view that see something."""
    view = capture.view(name)
    depth, normal = priors.layer(name, "depth").astype(np.float64), priors.layer(name, "normal")
    rays = view.camera.rays()
    lengths = np.linalg.norm(normal, axis=-1)
    seen = np.isfinite(depth) & (lengths > 0)
    distance = depth[seen] / (rays[seen] @ view.camera.forward)
    points = view.camera.position + distance[:, None] * rays[seen]
    shown = srgb_encode(capture.photograph(view) * capture.exposure)
    return points, normal[seen] / lengths[seen, None], shown[seen], distance


def with_colours(discs: Discs, settings: SurfelSettings) -> Parameters:
    """Parameters whose colours are the features, encoded, from everywhere.

    Their mean is the colour of the sky: it is seen where no photograph looked, and black would be a worse
    guess.
    """
    count = len(discs)
    base = (discs.features[:, None] - 0.5) / SH_DC
    detail = torch.zeros(count, coefficient_count(settings.degree) - 1, 3)
    sky = torch.zeros(coefficient_count(settings.sky_degree), 3)
    sky[0] = base.mean(dim=(0, 1))
    return parameters_of(discs, {COEFFICIENTS: base.float(), DETAIL: detail}, {SKY: sky})
