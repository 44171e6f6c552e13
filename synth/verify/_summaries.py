# SPDX-License-Identifier: Apache-2.0
"""Checks of what an index says of all views together, and of the sparse points of the capture."""

from collections.abc import Iterator, Sequence

import numpy as np

from graycard import Points
from graycard.colour import display_variance
from graycard.synth._spec import CaptureSettings
from graycard.synth.verify._check import Check
from graycard.synth.verify._subject import Subject, TruePicture

_NOISES = 3.0
"""Bound of a point in a photograph: the median distance to where it projects to is below 1 in Gaussian
noise."""

_SHALLOW = 0.2
"""Share of points, beside the wrong matches, that may lie on no surface: rays meet at few degrees."""

_NEAR = 0.2
"""Tolerance of a distance: what a pixel of noise makes of a depth where rays meet at a few degrees."""


class Summary:
    """Sums: what is added up over the views, one after another, so that one at a time is in memory."""

    def __init__(self, subject: Subject, settings: CaptureSettings) -> None:
        self._subject, self._settings = subject, settings
        self._noise: dict[str, list[float]] = {"train": [], "test": []}
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._points = subject.capture.points()
        self._near = np.zeros(len(self._points), bool)

    def add(self, picture: TruePicture) -> None:
        """Take a view into account whose layers are whole."""
        exposure = self._subject.truth.exposure
        noise = display_variance(picture.layers["radiance"], picture.layers["radiance.var"], exposure)
        self._noise[picture.view.split].append(float(noise.mean()))
        places = picture.layers["position"][picture.seen].astype(float)
        places = np.concatenate([places, picture.camera.position[None]])
        self._low = np.minimum(self._low, places.min(axis=0))
        self._high = np.maximum(self._high, places.max(axis=0))
        if picture.view.split == "train":
            self._near |= _on_surface(self._points, picture, self._settings.point_noise)

    def checks(self) -> Iterator[Check]:
        """Yield the checks, where all views were added."""
        if sum(map(len, self._noise.values())) < len(self._subject.truth.views):
            for name in ("noise ceiling", "diameter"):
                yield self._subject.at.skip(name, "not all views are whole")
            return
        yield from self._check_ceiling()
        at, diameter = self._subject.at, float(np.linalg.norm(self._high - self._low))
        off = abs(self._subject.truth.diameter / diameter - 1)
        told = f"the box around the cameras and all that they see has a diagonal of {diameter:.4f} m"
        yield at.judge("diameter", off, 1e-4, "relative", told)
        yield from self._check_points()

    def _check_ceiling(self) -> Iterator[Check]:
        truth, train, test = self._subject.truth, self._noise["train"], self._noise["test"]
        if truth.photograph_ceiling is None:
            yield self._ceiling("noise ceiling", truth.noise_ceiling, [*train, *test])
            return
        yield self._ceiling("noise ceiling", truth.noise_ceiling, test)
        yield self._ceiling("noise ceiling of photographs", truth.photograph_ceiling, train)

    def _ceiling(self, name: str, said: float | None, noise: Sequence[float]) -> Check:
        at, found = self._subject.at, float(-10 * np.log10(max(np.mean(noise), 1e-12)))
        if said is None:
            return at.fail(name, f"truth.json gives the noise ceiling of {found:.3f} dB, got none")
        told = f"the noise of the views allows {found:.3f} dB; looks like the variance of another rendering"
        return at.judge(name, abs(said - found), 1e-3, "dB", told)

    def _check_points(self) -> Iterator[Check]:
        at, points, views = self._subject.at, self._points, self._subject.capture.views
        if len(points) < 20:
            yield at.skip("sparse points", f"there are {len(points)} points")
            return
        off = np.full(len(points.point), np.inf)
        for index in np.unique(points.view):
            here = points.view == index
            pixel, depth = views[index].camera.project(points.positions[points.point[here]])
            off[here] = np.where(depth > 0, np.linalg.norm(pixel - points.pixel[here], axis=-1), np.inf)
        told = "points project to where they are found; looks like points of another world or camera"
        bound = _NOISES * self._settings.point_noise + 0.1
        yield at.judge("sparse points in photographs", float(np.median(off)), bound, "px", told)
        told = "points lie on what their views see; looks like points of another world or unit"
        share = float((~self._near).mean())
        bound = self._settings.outliers + _SHALLOW
        yield at.judge("sparse points on surfaces", share, bound, "of the points", told)


def _on_surface(points: Points, picture: TruePicture, noise: float) -> np.ndarray:
    """Return whether each point lies near the surface that is seen around its pixel, ``(N,)``, bool."""
    near = np.zeros(len(points), bool)
    here = points.view == picture.number
    number = points.point[here]
    column, row = np.floor(points.pixel[here]).astype(int).T
    height, width = picture.seen.shape
    row, column = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
    apart = np.linalg.norm(picture.layers["position"][row, column] - points.positions[number], axis=-1)
    distance = picture.layers["distance"][row, column]
    reach = distance * (_NEAR * noise + 4 * max(noise, 1) / picture.camera.K[0, 0])
    near[number] = picture.seen[row, column] & (apart < reach)
    return near
