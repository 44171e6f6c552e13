# SPDX-License-Identifier: Apache-2.0
"""Local lights: place, intensity, colour, direction, size, and how many there are.

A true light without a partner counts as a miss does in detection: the greatest value of an angle between
colours, of one between axes, and of the size error. The error of an intensity has none: there it is a factor
of a thousand, and no light counts more.
"""

from graycard import LocalLight, PredictionError
from graycard.eval.kinds._lights import GAUGE, LightRule, MatchedLights
from graycard.eval.kinds._metric import LIGHTS, Metric
from graycard.eval.kinds._records import ANY, CHANNEL, GLOBAL, error
from graycard.eval.kinds._references import ASSIGNMENT, Reference
from graycard.eval.lights._errors import intensity_error
from graycard.eval.lights._shapes import axis_of, chromaticity_error, direction_error, extent_error, radius_of
from graycard.eval.scoring._ceiling import EXACT_LIGHTS
from graycard.records import Invariance, MetricRecord

_MISSED_STOPS, _MISSED_COLOUR, _MISSED_AXIS, _MISSED_SIZE = 10.0, 90.0, 180.0, 100.0
_STOPS = Reference("gauged intensity", "stops of the exposures that bring both to one level", 1e-9, "stops")
_ANGLE = Reference("direction and colour of light", "scipy.spatial.distance, cosine", 1e-6, "°")
_SIZE = Reference("size of light", "areas by Heron's formula, and of the disc", 1e-9, "%")


def _position(matched: MatchedLights) -> float:
    near = [min(distance / matched.diameter, 1.0) for distance in matched.match.distances]
    unmatched = matched.match.missing + matched.match.extra
    return 100 * (sum(near) + unmatched) / (len(near) + unmatched)


def _gauged_intensity(predicted: LocalLight, true: LocalLight, matched: MatchedLights) -> float:
    if isinstance(matched.gauge, str):
        raise PredictionError(matched.gauge)
    return intensity_error(predicted, true, matched.gauge)


def _light_metric(
    record: MetricRecord,
    rule: LightRule,
    reference: Reference = ASSIGNMENT,
    *,
    gauge: str | None = None,
    refuses: tuple[Invariance, ...] = (),
) -> Metric[LightRule]:
    return Metric(
        record=record,
        rule=rule,
        layers=(LIGHTS,),
        gauge=gauge,
        refuses=refuses,
        ceiling=EXACT_LIGHTS,
        references=(reference,),
    )


METRICS: tuple[Metric[LightRule], ...] = (
    _light_metric(
        error(
            "light",
            "position",
            "Light position error",
            "100·(Σ over matched lights of min(|p - t| / diameter, 1) + missing + extra) / max(true, "
            "predicted); in the world, mean over test cameras; matched by least sum of distances",
            unit="% of the scene's diameter",
            tolerance=1.0,
            headline=True,
            ignores=ANY,
        ),
        LightRule(together=_position),
    ),
    _light_metric(
        error(
            "light",
            "intensity",
            "Light intensity error",
            "mean over true lights of min(mean over channels of |log2(p / t)| of the axial radiant "
            f"intensity, {_MISSED_STOPS:g}); one without a partner counts as many",
            unit="stops",
            tolerance=0.1,
        ),
        LightRule(lambda p, t, matched: intensity_error(p, t), _MISSED_STOPS),
        _STOPS,
        refuses=("sign",),
    ),
    _light_metric(
        error(
            "light",
            "intensity.channel",
            "Light intensity error, gauged",
            "mean over true lights of min(mean over channels of |log2(p / (s_c·t))| of the axial radiant "
            f"intensity, {_MISSED_STOPS:g}), s_c the scale per channel of the prediction's albedo on "
            "training views (base_color, else diffuse_reflectance, else albedo; 1 where it has none); one "
            "without a partner counts as many",
            unit="stops",
            tolerance=0.1,
            ignores=CHANNEL,
        ),
        LightRule(_gauged_intensity, _MISSED_STOPS),
        _STOPS,
        gauge=GAUGE,
        refuses=("sign",),
    ),
    _light_metric(
        error(
            "light",
            "chromaticity",
            "Light colour error",
            "mean over true lights of the angle between the axial radiant intensities as vectors (R, G, B); "
            f"one without a partner counts {_MISSED_COLOUR:g}°",
            unit="°",
            tolerance=0.5,
            ignores=GLOBAL,
        ),
        LightRule(
            lambda p, t, matched: chromaticity_error(p, t),
            _MISSED_COLOUR,
            lambda light: bool(light.axial_intensity.any()),
        ),
        _ANGLE,
        refuses=("sign",),
    ),
    _light_metric(
        error(
            "light",
            "direction",
            "Light direction error",
            "mean over true lights that have an axis (spot, rectangle, brightest Gaussian lobe) of the angle "
            "between the axes, in the world, mean over test cameras; a predicted light without an axis "
            f"counts 90°, a true one without a partner {_MISSED_AXIS:g}°",
            unit="°",
            tolerance=1.0,
            ignores=ANY,
        ),
        LightRule(
            lambda p, t, matched: direction_error(p, t, matched.cameras),
            _MISSED_AXIS,
            lambda light: bool(axis_of(light).any()),
        ),
        _ANGLE,
    ),
    _light_metric(
        error(
            "light",
            "extent",
            "Light size error",
            "mean over true lights that have an extent of 100·|r_p - r_t| / max(r_p, r_t), r the radius of a "
            "disc of the light's area (rectangle: 4·|u×v|; sphere: π·radius²; else 0); one without a partner "
            f"counts {_MISSED_SIZE:g} %",
            unit="%",
            tolerance=2.0,
            ignores=ANY,
        ),
        LightRule(lambda p, t, matched: extent_error(p, t), _MISSED_SIZE, lambda light: radius_of(light) > 0),
        _SIZE,
    ),
    _light_metric(
        error(
            "light",
            "missing",
            "Lights missing",
            "true local lights without a partner",
            unit="count",
            tolerance=0.0,
            ignores=ANY,
        ),
        LightRule(together=lambda matched: float(matched.match.missing), counts=True),
    ),
    _light_metric(
        error(
            "light",
            "extra",
            "Lights too many",
            "predicted local lights without a partner",
            unit="count",
            tolerance=0.0,
            ignores=ANY,
        ),
        LightRule(together=lambda matched: float(matched.match.extra), counts=True),
    ),
)
