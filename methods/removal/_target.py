# SPDX-License-Identifier: Apache-2.0
"""The object that a capture names: its masks, and which surfels are its."""

from collections.abc import Sequence

import numpy as np
import torch
from scipy.ndimage import binary_dilation
from scipy.spatial import Delaunay, QhullError
from skimage.morphology import disk

from graycard import Camera, Capture, MethodError
from graycard.methods.splat import Surfels, share_inside

_FAR = 1.5
"""Quartile ranges beyond the quartiles: a surfel further out is a stray one (Tukey 1977)."""
_FLAT = 0.5
"""Threshold: share of the largest quartile range, the least along other axes: a thin object may have a
part on top."""


def target_masks(capture: Capture, grow: float = 0.0) -> list[np.ndarray]:
    """Return where the training views see the object, one mask a view, shape ``(H, W)``, bool.

    Args:
        capture: The photographs.
        grow: By which masks will be widened, a share of the width: something has to be left then.

    Raises:
        MethodError: The capture names none, no view sees it, a view sees nothing else, or a mask is not of
            the size of its view.
    """
    if capture.target is None:
        raise MethodError(
            f"expected a capture that names an object to remove, got {capture.scene} without one. Fit a "
            "scene of the tabletop track, or import masks with the photographs"
        )
    masks = [capture.target_mask(view) for view in capture.train]
    check_masks(capture, masks, grow)
    return masks


def check_masks(capture: Capture, masks: Sequence[np.ndarray], grow: float) -> None:
    """Refuse masks that do not show an object in a room.

    Args:
        capture: The photographs.
        masks: One a training view.
        grow: As of :func:`target_masks`.

    Raises:
        MethodError: As of :func:`target_masks`.
    """
    for view, mask in zip(capture.train, masks, strict=True):
        size = view.camera.height, view.camera.width
        if mask.shape != size:
            raise MethodError(f"expected the mask of view {view.name} of shape {size}, got {mask.shape}")
        if widened(mask, grow).all():
            raise MethodError(
                f"expected a mask of the object in view {view.name}, got one of the whole picture (widened "
                f"by {grow:g} of its width): nothing would be left. Mend the mask, or leave the view out"
            )
    if not any(mask.any() for mask in masks):
        raise MethodError(
            f"expected an object that some training view of {capture.scene} sees, got empty masks only. "
            "Look at capture/masks"
        )


def widened(mask: np.ndarray, grow: float) -> np.ndarray:
    """Return a mask with what is next to it, by a share of the width; an empty one stays empty."""
    radius = round(grow * mask.shape[1])
    return binary_dilation(mask, disk(radius)) if radius else mask


def target_surfels(
    surfels: Surfels, cameras: Sequence[Camera], masks: Sequence[np.ndarray], least: float
) -> torch.Tensor:
    """Return which surfels are the object's: those that its masks show, and those inside of their hull.

    Args:
        surfels: N of them.
        cameras: Of the views.
        masks: Of the object, one a view, shape ``(H, W)``, bool.
        least: Share of what a surfel gives to pictures that lies in masks.

    Returns:
        Shape ``(N,)``, bool.

    Raises:
        MethodError: None is the object's, or all are.
    """
    theirs = with_hull(surfels, share_inside(surfels, cameras, masks) >= least)
    check_some(theirs, f"in the masks of the object with a share of {least:g} or more", "least_inside")
    return theirs


def with_hull(surfels: Surfels, found: torch.Tensor) -> torch.Tensor:
    """Return the surfels that were found to be the object's, and those inside of their hull.

    What no photograph shows, as the inside of the object, is nowhere in masks: all surfels in the convex hull
    of the others are the object's too (Gaussian Grouping: Ye et al. 2024), strays cut before.

    Args:
        surfels: N of them.
        found: Shape ``(N,)``, bool.

    Returns:
        Shape ``(N,)``, bool.
    """
    return found | torch.from_numpy(_inside_hull(surfels.centres.detach().numpy(), found.numpy()))


def check_some(theirs: torch.Tensor, how: str, setting: str) -> None:
    """Refuse an object without surfels, and one that is everything.

    Args:
        theirs: Which surfels are the object's, shape ``(N,)``, bool.
        how: They were told from others.
        setting: That says where the line is.

    Raises:
        MethodError: None is the object's, or all are.
    """
    if not theirs.any() or theirs.all():
        raise MethodError(
            f"expected some of {len(theirs)} surfels {how}, got {'all' if theirs.any() else 'none'}. Look at "
            f"the masks, change {setting}, or give the fit more iterations"
        )


def _inside_hull(places: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return which places lie in the convex hull of those chosen; none where they span no volume."""
    try:
        return Delaunay(without_strays(places[chosen])).find_simplex(places) >= 0
    except (QhullError, ValueError):  # too few, or all in a plane
        return np.zeros(len(places), bool)


def without_strays(places: np.ndarray) -> np.ndarray:
    """Return the places ``(M, 3)`` of an object but those that lie far off."""
    if not len(places):
        return places
    low, high = np.percentile(places, [25, 75], axis=0)
    reach = _FAR * np.maximum(high - low, _FLAT * (high - low).max())
    return places[np.all((places >= low - reach) & (places <= high + reach), axis=1)]
