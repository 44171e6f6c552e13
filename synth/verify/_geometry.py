# SPDX-License-Identifier: Apache-2.0
"""Checks of positions, depths and normals against the camera, within a view and between views."""

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from graycard.synth.verify._check import At, Check
from graycard.synth.verify._subject import TruePicture

_RELATIVE = 1e-4
"""Tolerance of a distance: float32 positions of a scene some metres wide are known to a tenth of that."""

_SMOOTH = np.cos(np.radians(8.0))
"""Cosine between neighbouring normals up to which a surface is smooth enough for finite differences."""

_STEP = 0.3
"""Height of a step between parallel faces, over the width of a pixel there, that turns a slope of finite
differences by 9 degrees. A sphere has as much curvature where normals of neighbours differ by 17 degrees."""


def check_geometry(picture: TruePicture) -> Iterator[Check]:
    """Position, depth, distance and normal of one view."""
    if not picture.seen.any():
        yield picture.at.skip("position on the ray", "no object is seen")
        return
    yield from _check_along_rays(picture)
    yield _check_pixel_centres(picture)
    yield from _check_normals(picture)
    yield _check_slopes(picture)


def _check_along_rays(picture: TruePicture) -> Iterator[Check]:
    """Position = camera + distance x ray, depth = distance x cos: three layers, one geometry."""
    layers, camera, seen = picture.layers, picture.camera, picture.seen
    distance, depth = layers["distance"][seen].astype(float), layers["depth"][seen].astype(float)
    rays = picture.rays[seen]
    expected = camera.position + distance[:, None] * rays
    found = layers["position"][seen].astype(float)
    off = np.linalg.norm(found - expected, axis=-1) / np.maximum(distance, 1e-9)
    told = f"position = camera + distance x ray; {_moved(found - expected, distance)}"
    yield picture.at.judge("position on the ray", float(off.max()), _RELATIVE, "of the distance", told)
    cosine = rays @ camera.forward
    off = np.abs(depth / np.maximum(distance * cosine, 1e-9) - 1)
    told = _looks_like_depth(depth / distance, cosine)
    yield picture.at.judge("depth along the axis", float(off.max()), _RELATIVE, "relative", told)


def _moved(offsets: np.ndarray, distance: np.ndarray) -> str:
    """Return what a displacement of the positions looks like."""
    middle = np.median(offsets, axis=0)
    if np.abs(offsets - middle).max() < 1e-3 * max(float(np.median(distance)), 1e-9):
        return f"looks like a world moved by {np.round(middle, 3).tolist()} m"
    return "looks like another camera, swapped views, mirrored axes or another unit"


def _looks_like_depth(quotient: np.ndarray, cosine: np.ndarray) -> str:
    factor = float(np.median(quotient / cosine))
    if np.abs(quotient - 1).max() < 1e-3:
        return "depth = distance x cos; looks like depth stored along the ray"
    if np.abs(quotient / cosine / factor - 1).max() < 1e-3:
        return f"depth = distance x cos; looks like a depth in another unit, factor {factor:.4g}"
    return "depth = distance x cos, of the same surface"


def _check_pixel_centres(picture: TruePicture) -> Check:
    """Each position projects to the centre of its pixel, (j + 0.5, i + 0.5)."""
    at, _ = picture.camera.project(picture.layers["position"][picture.seen].astype(float))
    rows, columns = np.nonzero(picture.seen)
    off = at - np.stack([columns, rows], axis=-1) - 0.5
    x, y = np.median(off, axis=0)
    told = f"pixel centres lie at +0.5; looks like a shift by ({x:+.2f}, {y:+.2f}) px"
    return picture.at.judge("position at the pixel centre", float(np.abs(off).max()), 0.02, "px", told)


def _check_normals(picture: TruePicture) -> Iterator[Check]:
    normal = picture.layers["normal"][picture.seen].astype(float)
    length = np.linalg.norm(normal, axis=-1)
    told = "normals are of unit length; looks like an average over several surfaces, or a scaled range"
    yield picture.at.judge("normal of unit length", float(np.abs(length - 1).max()), 1e-4, "1", told)
    away = float(((normal * picture.rays[picture.seen]).sum(-1) > 1e-4).mean())
    told = "normals face the camera; looks like normals inside out, or not in the world's axes"
    yield picture.at.judge("normal faces the camera", away, 0.0, "of the pixels", told)


def _check_slopes(picture: TruePicture) -> Check:
    """Check that the normal of a smooth surface is the cross product of the differences of its positions."""
    smooth = _smooth_interior(picture)
    if smooth.sum() < 30:
        return picture.at.skip(
            "normal across the surface", "fewer than 30 pixels of smooth surfaces are seen"
        )
    position = picture.layers["position"].astype(float)
    down, right = (np.gradient(position, axis=axis)[smooth] for axis in (0, 1))
    across = np.cross(right, down)
    across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-30)
    cosine = np.abs((across * picture.layers["normal"][smooth]).sum(-1))
    off = float((np.degrees(np.arccos(np.clip(cosine, 0, 1))) > 10).mean())
    told = "the normal is across the surface to 10°; looks like a mirrored axis, or normals in camera axes"
    return picture.at.judge("normal across the surface", off, 0.02, "of the smooth pixels", told)


def _smooth_interior(picture: TruePicture) -> np.ndarray:
    """Pixels whose neighbours show the same object with nearly the same normal and no step in depth."""
    ids, normal = picture.layers["object_id"].astype(np.int64), picture.layers["normal"]
    depth = np.where(picture.seen, picture.layers["depth"], 0).astype(float)
    near = np.divide(1, depth, out=np.zeros_like(depth), where=depth > 0)  # linear in pixels on a plane
    focal = picture.camera.K[[1, 0], [1, 0]]
    smooth = picture.seen.copy()
    for shift, axis in ((1, 0), (-1, 0), (1, 1), (-1, 1)):
        cosine = (normal * np.roll(normal, shift, axis)).sum(-1)
        smooth &= (ids == np.roll(ids, shift, axis)) & (cosine > _SMOOTH)
        smooth &= np.abs(np.roll(depth, shift, axis) - depth) < 0.2 * depth
        smooth &= np.abs(_curvature(near, axis)) * depth * focal[axis] < _STEP
    smooth[[0, -1]] = smooth[:, [0, -1]] = False
    return smooth


def _curvature(values: np.ndarray, axis: int) -> np.ndarray:
    """Second difference: large where two walls of one object meet or one part hides another."""
    return ndimage.correlate1d(values, [1.0, -2.0, 1.0], axis=axis)


def check_between(a: TruePicture, b: TruePicture, at: At) -> Iterator[Check]:
    """Check that what one view sees is where another view can see it: nothing hangs in front of what that one
    sees.

    Each point of ``a`` is projected into ``b``. If it is nearer than all that ``b`` sees around that pixel,
    ``b`` looked through it. Where ``b`` sees that very point, it sees the same object there.
    """
    where, depth = b.camera.project(a.layers["position"][a.seen].astype(float))
    ahead = depth > 1e-3
    column, row = (np.where(ahead, np.floor(where[:, k]), -1) for k in (0, 1))
    inside = (column >= 1) & (row >= 1) & (column < b.camera.width - 1) & (row < b.camera.height - 1)
    if inside.sum() < 30:
        yield at.skip("position in other views", "the views have fewer than 30 points in common")
        return
    place = row[inside].astype(int), column[inside].astype(int)
    seen = ndimage.minimum_filter(b.layers["depth"], size=3)[place].astype(float)
    margin = 3 * seen / b.camera.K[0, 0] + 1e-3 * seen
    through = float((depth[inside] < seen - margin).mean())
    told = "nothing hangs where another view looks through; looks like a view with another world or camera"
    yield at.judge("position in other views", through, 0.02, "of the common points", told)
    yield _check_same_object(a, b, at, inside, place)


def _check_same_object(
    a: TruePicture, b: TruePicture, at: At, inside: np.ndarray, place: tuple[np.ndarray, np.ndarray]
) -> Check:
    apart = np.linalg.norm(b.layers["position"][place] - a.layers["position"][a.seen][inside], axis=-1)
    footprint = b.layers["distance"][place] / b.camera.K[0, 0]
    same = b.seen[place] & (apart < footprint)
    if same.sum() < 30:
        return at.skip("object in other views", "fewer than 30 points are seen by both views")
    ids = a.layers["object_id"][a.seen][inside][same], b.layers["object_id"][place][same]
    other = float((ids[0] != ids[1]).mean())
    # objects touch, and two points of one footprint may lie on both sides of the seam
    told = "a point is of one object in all views; looks like ids that were counted anew in a view"
    return at.judge("object in other views", other, 0.18, "of the common points", told)
