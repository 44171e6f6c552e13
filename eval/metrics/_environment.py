# SPDX-License-Identifier: Apache-2.0
"""Surroundings that a method predicts: lights without a place, seen on three spheres."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from graycard import PredictionError, Predictions, Truth, angles
from graycard.eval.kinds._lights import light_score
from graycard.eval.kinds._metric import LIGHTS, Metric, Rule, Scorer
from graycard.eval.kinds._records import GLOBAL, decibels, error
from graycard.eval.kinds._references import Reference
from graycard.eval.lights._read import INDEX, distant
from graycard.eval.lights._spheres import SPHERES, exposure_for, render_spheres, scale_invariant_rmse
from graycard.eval.measures._psnr import psnr
from graycard.eval.measures._spaces import display
from graycard.eval.scoring._ceiling import EXACT_LIGHTS
from graycard.eval.scoring._findings import Measurement, SceneFacts
from graycard.records import MetricRecord, Score

Spheres = Mapping[str, np.ndarray]


@dataclass(frozen=True, slots=True)
class EnvironmentRule(Rule):
    """Computes one number from spheres under the predicted and under the true environment."""

    compare: Callable[[Spheres, Spheres], Measurement]
    """``(predicted, true)``, by name, each ``(N, 3)``, linear radiance; may raise PredictionError."""

    @classmethod
    def scorer(
        cls,
        metrics: "Sequence[Metric[EnvironmentRule]]",
        predictions: Predictions,
        truth: Truth,
        scene: SceneFacts,
    ) -> "EnvironmentScorer":
        """Begin to score; see :class:`Rule`."""
        return EnvironmentScorer(metrics, predictions, truth)


@dataclass(slots=True)
class EnvironmentScorer(Scorer):
    """Scores the environments of a scene together; test views tell it nothing."""

    metrics: Sequence[Metric[EnvironmentRule]]
    predictions: Predictions
    truth: Truth

    def scores(self) -> list[Score]:
        """Return the scores, where the scene has an environment.

        Raises:
            DatasetError: The true lights or their images are missing or broken.
        """
        true = distant(self.truth.lights())
        if not true:
            return []
        wanted = _together([render_spheres(self.truth.environment(light)) for light in true])
        return [self._score(m.record, m.rule, wanted) for m in self.metrics]

    def _score(self, record: MetricRecord, rule: EnvironmentRule, wanted: Spheres) -> Score:
        try:
            lights = self.predictions.lights()
            if lights is None or not distant(lights):
                what = f"there is no {INDEX}" if lights is None else f"{INDEX} has no environment"
                return light_score(record, 1, "not provided", reason=what)
            lit = [render_spheres(self.predictions.environment(light)) for light in distant(lights)]
            found = rule.compare(_together(lit), wanted)
        except PredictionError as cause:
            return light_score(record, 1, "failed", reason=str(cause))
        score = light_score(record, 1, "scored", value=found.value, scored=1)
        return replace(score, breakdown=dict(found.parts))


def compare_spheres(predicted: Spheres, true: Spheres) -> Measurement:
    """Return the PSNR of three spheres, with one scale over all of them, and that of each.

    The scale is fitted on the spheres themselves and is no gauge of the training views: it is not recorded
    as one.

    Args:
        predicted: By name, each ``(N, 3)``, linear radiance.
        true: The same.

    Raises:
        PredictionError: No positive scale brings the prediction to the truth.
    """
    p, t = _shining(predicted, true)
    scale, exposure = float((p * t).sum() / (p * p).sum()), exposure_for(true["diffuse"])
    squares = {
        name: float(
            np.mean((display(scale * predicted[name], exposure) - display(true[name], exposure)) ** 2)
        )
        for name in true
    }
    value = psnr(float(np.mean(list(squares.values()))))
    return Measurement(value, {name: psnr(square) for name, square in squares.items()})


def compare_scale_invariant(predicted: Spheres, true: Spheres) -> Measurement:
    """Return the mean over spheres of the scale-invariant root mean square error, and that of each.

    Args:
        predicted: By name, each ``(N, 3)``, linear radiance.
        true: The same. The exposure that shows the diffuse sphere with mean luminance 0.18 gives the unit.

    Raises:
        PredictionError: The prediction is black, or below 0.
    """
    _shining(predicted, true)
    exposure = exposure_for(true["diffuse"])
    return _mean_over({n: exposure * scale_invariant_rmse(predicted[n], true[n]) for n in true})


def compare_colours(predicted: Spheres, true: Spheres) -> Measurement:
    """Return the mean over spheres and pixels of the angle between (R, G, B), degrees, and that of each.

    Args:
        predicted: By name, each ``(N, 3)``, linear radiance; a black pixel counts 90°.
        true: The same.

    Raises:
        PredictionError: The prediction is black, or below 0.
    """
    _shining(predicted, true)
    return _mean_over({n: float(angles(predicted[n], true[n]).mean()) for n in true})


def _shining(predicted: Spheres, true: Spheres) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels of all spheres, each ``(N, 3)``.

    Raises:
        PredictionError: No positive scale brings the prediction to the truth.
    """
    p, t = (np.concatenate(list(spheres.values())) for spheres in (predicted, true))
    if not (p * t).sum() > 0:
        raise PredictionError("expected an environment that shines, got a black one. Leave it out instead")
    return p, t


def _mean_over(parts: Mapping[str, float]) -> Measurement:
    return Measurement(float(np.mean(list(parts.values()))), parts)


def _together(lit: Sequence[Spheres]) -> Spheres:
    """Return the spheres under several environments at once: light adds up."""
    return {name: np.sum([spheres[name] for spheres in lit], axis=0) for name in lit[0]}


METRICS: tuple[Metric[EnvironmentRule], ...] = (
    Metric(
        record=decibels(
            "environment",
            "psnr",
            "Environment on three spheres",
            "10·log10(1 / MSE) of srgb(k·L) over pictures of a mirror, a glossy (GGX, alpha 0.25, no Fresnel "
            "loss) and a white diffuse sphere under s·p and under t, seen from far along +y; s = Σpt/Σp² "
            "over the three linear pictures, k shows the true diffuse sphere with mean luminance 0.18",
            ignores=GLOBAL,
        ),
        rule=EnvironmentRule(compare_spheres),
        layers=(LIGHTS,),
        refuses=("sign",),
        ceiling=EXACT_LIGHTS,
        references=(
            Reference("mirror sphere", "scipy.interpolate, RegularGridInterpolator", 1e-9),
            Reference(
                "diffuse sphere", "spherical harmonics, Ramamoorthi and Hanrahan 2001, three digits", 2e-3
            ),
            Reference("glossy sphere", "Gauss and Legendre over facets, two digits", 5e-3),
        ),
        breakdown=SPHERES,
    ),
    Metric(
        record=error(
            "environment",
            "si_rmse",
            "Environment on three spheres, si-RMSE",
            "mean over the spheres of environment.psnr of k·sqrt(min_s Σ(s·p - t)² / N), linear, N pixels of "
            "one sphere, channels summed, k as there (StyleLight, fast_rmse.py, without its tone mapping)",
            tolerance=0.02,
            ignores=GLOBAL,
        ),
        rule=EnvironmentRule(compare_scale_invariant),
        layers=(LIGHTS,),
        refuses=("sign",),
        ceiling=EXACT_LIGHTS,
        references=(Reference("si-RMSE of spheres", "numpy.linalg.lstsq, sphere by sphere", 1e-9),),
        breakdown=SPHERES,
    ),
    Metric(
        record=error(
            "environment",
            "angle",
            "Environment on three spheres, colour",
            "mean over the spheres of environment.psnr, and their pixels, of the angle between (R, G, B) "
            "under p and under t; a black pixel counts 90° (StyleLight, fast_rmse.py, where it counts 0°)",
            unit="°",
            tolerance=0.5,
            ignores=GLOBAL,
        ),
        rule=EnvironmentRule(compare_colours),
        layers=(LIGHTS,),
        refuses=("sign",),
        ceiling=EXACT_LIGHTS,
        references=(Reference("colour of spheres", "scipy.spatial.distance, cosine", 1e-6, "°"),),
        breakdown=SPHERES,
    ),
)
