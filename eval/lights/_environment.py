# SPDX-License-Identifier: Apache-2.0
"""Scores of the surroundings that a method predicts: lights without a place."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from graycard import PredictionError, Predictions, Truth
from graycard.eval.lights._metrics import ENVIRONMENT_METRICS
from graycard.eval.lights._scores import INDEX, distant, light_score
from graycard.eval.lights._spheres import exposure_for, render_spheres
from graycard.eval.measures._psnr import psnr
from graycard.eval.metrics._image_metric import display
from graycard.records import Score

Spheres = Mapping[str, np.ndarray]
(RECORD,) = ENVIRONMENT_METRICS


def score_environments(predictions: Predictions, truth: Truth) -> list[Score]:
    """The score of the environment, where the scene has one.

    Raises:
        DatasetError: The true lights or their images are missing or broken.
    """
    true = distant(truth.lights())
    if not true:
        return []
    wanted = _together([render_spheres(truth.environment(light)) for light in true])
    try:
        lights = predictions.lights()
        if lights is None or not distant(lights):
            what = f"there is no {INDEX}" if lights is None else f"{INDEX} has no environment"
            return [light_score(RECORD, 1, "not provided", reason=what)]
        found = [render_spheres(predictions.environment(light)) for light in distant(lights)]
        return [compare_spheres(_together(found), wanted)]
    except PredictionError as cause:
        return [light_score(RECORD, 1, "failed", reason=str(cause))]


def compare_spheres(predicted: Spheres, true: Spheres) -> Score:
    """The score of three spheres, with one scale over all of them; each one's own is in the breakdown.

    The scale is fitted on the spheres themselves and is no gauge of the training views: it is not recorded
    as one.

    Args:
        predicted: By name, each ``(N, 3)``, linear radiance.
        true: The same.

    Raises:
        PredictionError: No positive scale brings the prediction to the truth.
    """
    p, t = (np.concatenate(list(spheres.values())) for spheres in (predicted, true))
    if not (p * t).sum() > 0:
        raise PredictionError("expected an environment that shines, got a black one. Leave it out instead")
    scale, exposure = float((p * t).sum() / (p * p).sum()), exposure_for(true["diffuse"])
    squares = {
        name: float(
            np.mean((display(scale * predicted[name], exposure) - display(true[name], exposure)) ** 2)
        )
        for name in true
    }
    value = psnr(float(np.mean(list(squares.values()))))
    score = light_score(RECORD, 1, "scored", value=value, scored=1)
    return replace(score, breakdown={name: psnr(square) for name, square in squares.items()})


def _together(lit: Sequence[Spheres]) -> Spheres:
    """Spheres under several environments at once: light adds up."""
    return {name: np.sum([spheres[name] for spheres in lit], axis=0) for name in lit[0]}
