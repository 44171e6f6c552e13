# SPDX-License-Identifier: Apache-2.0
"""Predicted lights that are fit to be scored, and the true lights that they stand for."""

from collections.abc import Iterable

import numpy as np

from graycard import EnvironmentLight, Light, LocalLight, PredictionError, Predictions, Truth
from graycard.eval.lights._errors import match_lights

INDEX = "lights.json"


def true_names(predictions: Predictions, truth: Truth) -> dict[str, str] | None:
    """Return the names of true lights by those of the predicted ones that stand for them.

    Local lights are matched by least sum of distances, environments in their order.

    Returns:
        None where no lights are predicted, or none that can be read: then names stand as they are.

    Raises:
        DatasetError: The true lights are missing or broken.
    """
    try:
        lights = predicted_lights(predictions)
    except PredictionError:
        return None
    if not lights:
        return None
    true = truth.lights()
    p, t = local(lights), local(true)
    cameras = [v.camera for v in truth.views if v.split == "test"]
    names = {p[i].name: t[j].name for i, j in match_lights(p, t, cameras).pairs}
    return names | {a.name: b.name for a, b in zip(distant(lights), distant(true), strict=False)}


def predicted_lights(predictions: Predictions) -> tuple[Light, ...] | None:
    """Return the predicted lights; None where there are none.

    Raises:
        PredictionError: They are broken, or have a place or an intensity that is not finite.
    """
    lights = predictions.lights()
    for light in local(lights or ()):
        _check(light)
    return lights


def local(lights: Iterable[Light]) -> list[LocalLight]:
    """Return the lights that have a place."""
    return [light for light in lights if not isinstance(light, EnvironmentLight)]


def distant(lights: Iterable[Light]) -> list[EnvironmentLight]:
    """Return the lights that have none."""
    return [light for light in lights if isinstance(light, EnvironmentLight)]


def _check(light: LocalLight) -> None:
    for name, values in (("position", light.position), ("intensity", light.axial_intensity)):
        if not np.isfinite(values).all():
            raise PredictionError(
                f"expected light {light.name!r} with a finite {name}, got {np.asarray(values).tolist()}. "
                f"Mend {INDEX}"
            )
