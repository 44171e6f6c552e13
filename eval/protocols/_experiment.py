# SPDX-License-Identifier: Apache-2.0
"""One and the same albedo prediction by every protocol: how far apart the numbers are."""

from dataclasses import dataclass

import numpy as np

from graycard.eval.protocols._base import JudgedView, JudgedViews
from graycard.eval.protocols._scores import score_views
from graycard.eval.protocols.catalogue._albedo import ALBEDO
from graycard.records import Score


@dataclass(frozen=True, slots=True)
class Experiment:
    """A made-up albedo and a prediction of it with the usual faults: colour cast, baked shading, noise.

    The prediction is black outside the object.
    """

    foreground: float
    """Share of the picture that the object covers, a disc: (0, 0.78]."""
    views: int = 20
    size: int = 64
    """Side of a view in pixels."""
    patches: int = 8
    """Patches of one colour along a side."""
    darkest: float = 0.1
    brightest: float = 0.9
    """Range of the albedo, uniform."""
    gain: tuple[float, float, float] = (1.35, 1.0, 0.7)
    """Factors on R, G, B that the prediction is off by."""
    shading: float = 0.2
    """Amplitude of the smooth shading that is baked into the prediction, as a share of it."""
    periods: float = 2.0
    """Waves of that shading over the side of a view."""
    noise: float = 0.03
    """Standard deviation of what else is wrong."""
    seed: int = 1000


def albedo_views(experiment: Experiment) -> JudgedViews:
    """Return the views of an experiment, and one more that is not scored.

    Raises:
        ValueError: The disc does not fit into the picture.
    """
    if not 0 < experiment.foreground <= np.pi / 4:
        raise ValueError(f"expected a foreground in (0, 0.78], got {experiment.foreground}")
    rng = np.random.default_rng(experiment.seed)
    made = [_view(experiment, rng, f"view_{i:03d}") for i in range(experiment.views + 1)]
    return JudgedViews(tuple(made[1:]), made[0])


def protocol_spread(experiment: Experiment) -> dict[str, Score]:
    """Return the score of the one prediction by each published protocol for albedo, by name."""
    views = albedo_views(experiment)
    return {protocol.name: score_views(protocol, views) for protocol in ALBEDO}


def _view(e: Experiment, rng: np.random.Generator, name: str) -> JudgedView:
    y, x = (np.mgrid[: e.size, : e.size] + 0.5) / e.size
    mask = np.hypot(x - 0.5, y - 0.5) < np.sqrt(e.foreground / np.pi)
    colors = rng.uniform(e.darkest, e.brightest, (e.patches, e.patches, 3))
    true = colors[(y * e.patches).astype(int), (x * e.patches).astype(int)]
    predicted = true * e.gain * _smooth(e, rng, x, y)[..., None]
    predicted = np.maximum(predicted + rng.normal(0, e.noise, true.shape), 0)
    return JudgedView(name, np.where(mask[..., None], predicted, 0.0), true, mask)


def _smooth(e: Experiment, rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return a wave around 1 of random direction, with its zero in the middle of the picture."""
    turn = rng.uniform(0, 2 * np.pi)
    along = (x - 0.5) * np.cos(turn) + (y - 0.5) * np.sin(turn)
    return 1 + e.shading * np.sin(2 * np.pi * e.periods * along)
