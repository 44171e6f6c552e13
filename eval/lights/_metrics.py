# SPDX-License-Identifier: Apache-2.0
"""The table of metrics of lights and of surroundings."""

import math

from graycard.eval.metrics._image_metric import ANY, CHANNEL, GLOBAL
from graycard.records import Invariance, MetricRecord

MISSED: dict[str, float] = {
    "light.intensity": 10.0,
    "light.intensity.channel": 10.0,
    "light.chromaticity": 90.0,
    "light.direction": 180.0,
    "light.extent": 100.0,
}
"""What a true light counts that no predicted one stands for, in the unit of each metric.

The greatest value of an angle between colours, of one between axes, and of the size error; the error of an
intensity has none: there it is a factor of a thousand, and no light counts more.
"""


def _light_metric(
    name: str,
    title: str,
    unit: str,
    formula: str,
    tolerance: float,
    *,
    headline: bool = False,
    ignores: tuple[Invariance, ...] = ANY,
) -> MetricRecord:
    return MetricRecord(
        f"light.{name}", title, "light", unit, False, 0.0, formula, headline, tolerance, ignores
    )


LIGHT_METRICS: tuple[MetricRecord, ...] = (
    _light_metric(
        "position", "Light position error", "% of the scene's diameter",
        "100·(Σ over matched lights of min(|p - t| / diameter, 1) + missing + extra) / max(true, predicted); "
        "in the world, mean over test cameras; matched by least sum of distances", 1.0, headline=True,
    ),
    _light_metric(
        "intensity", "Light intensity error", "stops",
        "mean over true lights of min(mean over channels of |log2(p / t)| of the axial radiant intensity, "
        f"{MISSED['light.intensity']:g}); one without a partner counts as many", 0.1, ignores=(),
    ),
    _light_metric(
        "intensity.channel", "Light intensity error, gauged", "stops",
        "mean over true lights of min(mean over channels of |log2(p / (s_c·t))| of the axial radiant "
        f"intensity, {MISSED['light.intensity.channel']:g}), s_c the scale per channel of the prediction's "
        "albedo on training views (base_color, else diffuse_reflectance, else albedo; 1 where it has none); "
        "one without a partner counts as many", 0.1, ignores=CHANNEL,
    ),
    _light_metric(
        "chromaticity", "Light colour error", "°",
        "mean over true lights of the angle between the axial radiant intensities as vectors (R, G, B); one "
        f"without a partner counts {MISSED['light.chromaticity']:g}°", 0.5, ignores=GLOBAL,
    ),
    _light_metric(
        "direction", "Light direction error", "°",
        "mean over true lights that have an axis (spot, rectangle, brightest Gaussian lobe) of the angle "
        "between the axes, in the world, mean over test cameras; a predicted light without an axis counts "
        f"90°, a true one without a partner {MISSED['light.direction']:g}°", 1.0,
    ),
    _light_metric(
        "extent", "Light size error", "%",
        "mean over true lights that have an extent of 100·|r_p - r_t| / max(r_p, r_t), r the radius of a "
        "disc of the light's area (rectangle: 4·|u×v|; sphere: π·radius²; else 0); one without a partner "
        f"counts {MISSED['light.extent']:g} %", 2.0,
    ),
    _light_metric("missing", "Lights missing", "count", "true local lights without a partner", 0.0),
    _light_metric("extra", "Lights too many", "count", "predicted local lights without a partner", 0.0),
)  # fmt: skip

ENVIRONMENT_METRICS: tuple[MetricRecord, ...] = (
    MetricRecord(
        "environment.psnr", "Environment on three spheres", "environment", "dB", True, math.inf,
        "10·log10(1 / MSE) of srgb(k·L) over pictures of a mirror, a glossy (GGX, alpha 0.25, no Fresnel "
        "loss) and a white diffuse sphere under s·p and under t, seen from far along +y; s = Σpt/Σp² over "
        "the three linear pictures, k shows the true diffuse sphere with mean luminance 0.18",
        headline=False, tolerance=0.3, ignores=GLOBAL,
    ),
)  # fmt: skip
