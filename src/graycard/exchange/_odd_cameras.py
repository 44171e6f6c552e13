# SPDX-License-Identifier: Apache-2.0
"""Cameras and points that are numbers and no more: what looks wrong in them, in rows that warn."""

from collections.abc import Iterator, Sequence

import numpy as np

from graycard.exchange._cameras import PosedPhotograph
from graycard.exchange._doctor import ImportRow, some
from graycard.exchange._lens import FisheyeLens
from graycard.points import Points

MARGIN = 0.05
"""Share of a picture's side within which of its border a principal point looks like another unit."""
WIDEST = np.radians(150)
"""Angle across the width, from which a lens that is no fisheye looks like one of another unit."""
FAR = 1000.0
"""Distances from the middle of the others, in their median, from which a place looks wrong."""


def odd_cameras(shots: Sequence[PosedPhotograph], points: Points | None) -> Iterator[ImportRow]:
    """Yield rows about intrinsics, poses and points that no photographs are taken with.

    Args:
        shots: With the cameras that the files name.
        points: Those of the capture.
    """
    off = [shot.name for shot in shots if not _is_centred(shot)]
    if off:
        said = f"principal point at the border of the picture or outside: are cx and cy pixels? {some(off)}"
        yield ImportRow("cameras", len(off), said, warns=True)
    wide = [shot.name for shot in shots if _angle(shot) > WIDEST and not isinstance(shot.lens, FisheyeLens)]
    if wide:
        said = f"see more than {np.degrees(WIDEST):.0f}° across: are focal lengths pixels? {some(wide)}"
        yield ImportRow("cameras", len(wide), said, warns=True)
    places = np.array([shot.camera.position for shot in shots])
    if len(places) > 1 and np.ptp(places, axis=0).max() <= 1e-9 * np.abs(places).max(initial=1):
        yield ImportRow(
            "cameras", len(shots), "all at one place: no depth can be found from there", warns=True
        )
    far = [shot.name for shot, is_far in zip(shots, _far(places), strict=True) if is_far]
    if far:
        yield ImportRow("cameras", len(far), f"far from all others: {some(far)}", warns=True)
    if points is not None and (lost := int(_far(points.positions).sum())):
        yield ImportRow("points", lost, "far from all others", warns=True)


def _is_centred(shot: PosedPhotograph) -> bool:
    share = shot.camera.K[:2, 2] / shot.size
    return bool((np.abs(share - 0.5) <= 0.5 - MARGIN).all())


def _angle(shot: PosedPhotograph) -> float:
    return float(2 * np.arctan(0.5 * shot.size[0] / shot.camera.K[0, 0]))


def _far(places: np.ndarray) -> np.ndarray:
    """Return which places, ``(N, 3)``, are far from the middle of all of them, shape ``(N,)``, bool."""
    if len(places) < 3:
        return np.zeros(len(places), bool)
    distances = np.linalg.norm(places - np.median(places, axis=0), axis=1)
    typical = float(np.median(distances))
    return distances > FAR * typical if typical > 0 else np.zeros(len(places), bool)
