# SPDX-License-Identifier: Apache-2.0
"""All metrics, in the order in which they are scored and shown."""

from graycard.eval.lights._metrics import ENVIRONMENT_METRICS, LIGHT_METRICS
from graycard.eval.metrics._albedo import IMAGE_METRICS
from graycard.eval.metrics._glossy import GLOSSY_METRICS
from graycard.eval.metrics._leakage import LEAKAGE_METRICS
from graycard.eval.metrics._light_off import OFF_METRICS
from graycard.eval.metrics._noise_error import NOISE_METRICS
from graycard.eval.metrics._relighting import COMPOSITION_METRICS, GAUGE, RELIGHTING_METRICS
from graycard.eval.metrics._removal import REMOVAL_METRICS
from graycard.eval.metrics._removal_lobes import REMOVAL_LOBE_METRICS
from graycard.eval.metrics._shadow import SHADOW_METRICS
from graycard.eval.metrics._training_view import TRAINING_METRICS
from graycard.eval.metrics._view_metrics import ViewMetric
from graycard.eval.scoring._images import REQUIRED
from graycard.records import MetricRecord

VIEW_METRICS: tuple[ViewMetric, ...] = (
    *NOISE_METRICS,
    *SHADOW_METRICS,
    *REMOVAL_METRICS,
    *REMOVAL_LOBE_METRICS,
    *GLOSSY_METRICS,
    *LEAKAGE_METRICS,
)


def in_every_view() -> frozenset[str]:
    """Ids of the metrics that each held-out view with an object in it has a value of.

    Others judge what some views do not show: a colour chart, the shadow of a target, a highlight.
    """
    return frozenset(m.record.id for m in IMAGE_METRICS if m.layer in REQUIRED and not m.chart)


def gauge_names() -> dict[str, str]:
    """Names of gauges (:func:`graycard.eval.scoring._training.fit_gauges`) by the id of their metrics."""
    of_layers = {m.record.id: m.gauge for m in (*IMAGE_METRICS, *VIEW_METRICS) if m.gauge}
    return {
        **{name: gauge for name, gauge in of_layers.items() if not gauge.endswith("raw")},
        **{m.record.id: GAUGE for m in RELIGHTING_METRICS},
        "light.intensity.channel": "light",
    }


def all_metrics() -> tuple[MetricRecord, ...]:
    """All metrics in the order in which they are scored and shown."""
    changed = *RELIGHTING_METRICS, *COMPOSITION_METRICS
    return (
        *(m.record for m in (*IMAGE_METRICS, *VIEW_METRICS)),
        *OFF_METRICS,
        *(m.record for m in changed),
        *TRAINING_METRICS,
        *LIGHT_METRICS,
        *ENVIRONMENT_METRICS,
    )
