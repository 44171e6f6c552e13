# SPDX-License-Identifier: Apache-2.0
"""All metrics, in the order in which they are scored and shown."""

import graycard as gc
from graycard.eval._glossy import GLOSSY_METRICS
from graycard.eval._images import REQUIRED
from graycard.eval._leakage import LEAKAGE_METRICS
from graycard.eval._light_metrics import ENVIRONMENT_METRICS, LIGHT_METRICS
from graycard.eval._light_off import OFF_METRICS
from graycard.eval._metrics import IMAGE_METRICS
from graycard.eval._noise_error import NOISE_METRICS
from graycard.eval._relighting import COMPOSITION_METRICS, GAUGE, RELIGHTING_METRICS
from graycard.eval._removal import REMOVAL_METRICS
from graycard.eval._removal_lobes import REMOVAL_LOBE_METRICS
from graycard.eval._shadow import SHADOW_METRICS
from graycard.eval._training_view import TRAINING_METRICS
from graycard.eval._view_metrics import ViewMetric

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
    """Of each metric that has a gauge, by id: its name in :func:`graycard.eval._training.fit_gauges`."""
    of_layers = {m.record.id: m.gauge for m in (*IMAGE_METRICS, *VIEW_METRICS) if m.gauge}
    return {
        **{name: gauge for name, gauge in of_layers.items() if not gauge.endswith("raw")},
        **{m.record.id: GAUGE for m in RELIGHTING_METRICS},
        "light.intensity.channel": "light",
    }


def metrics() -> tuple[gc.MetricRecord, ...]:
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
