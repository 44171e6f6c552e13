# SPDX-License-Identifier: Apache-2.0
"""All metrics, in the order in which they are scored and shown.

A metric is found because its module lies in this folder and names it in ``METRICS``: nothing else has to be
edited.
"""

import pkgutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from importlib import import_module
from typing import Any

from graycard import UnknownNameError
from graycard.eval.kinds._metric import Metric
from graycard.eval.kinds._references import FOUNDATIONS, Reference
from graycard.records import MetricRecord

_ORDER = (
    "_radiance",
    "_networks",
    "_albedo",
    "_materials",
    "_geometry",
    "_transport",
    "_noise_error",
    "_shadow",
    "_removal",
    "_removal_lobes",
    "_glossy",
    "_leakage",
    "_light_off",
    "_relighting",
    "_training_view",
    "_lights",
    "_environment",
)
"""Order of modules in a sheet; any other module comes behind these, by name."""
_PACKAGE = __name__.rpartition(".")[0]

_added: ContextVar[tuple[Metric[Any], ...]] = ContextVar("added metrics", default=())


def registry() -> tuple[Metric[Any], ...]:
    """Return all metrics, in the order in which they are scored and shown.

    Raises:
        ValueError: Two metrics have one id, or one stands behind a metric that does not exist.
    """
    return _in_order((*_discovered(tuple(import_module(_PACKAGE).__path__)), *_added.get()))


def all_metrics() -> tuple[MetricRecord, ...]:
    """Return the records of all metrics, in the order of :func:`registry`."""
    return tuple(metric.record for metric in registry())


def find_metric(name: str) -> Metric[Any]:
    """Return the metric of an id.

    Raises:
        UnknownNameError: There is none.

    Examples:
        >>> find_metric("albedo.psnr.channel").gauge
        'channel'
    """
    found = {metric.id: metric for metric in registry()}
    if name not in found:
        raise UnknownNameError("metric", name, list(found))
    return found[name]


@contextmanager
def registered(*metrics: Metric[Any]) -> Iterator[None]:
    """Score more metrics inside a ``with`` statement, in this thread or task.

    Args:
        metrics: Behind all others, or where their ``after`` says.
    """
    token = _added.set((*_added.get(), *metrics))
    try:
        yield
    finally:
        _added.reset(token)


def unavailable() -> Mapping[str, str]:
    """Return what the metrics need that cannot be computed here, by id: advice to whoever wants them."""
    return {metric.id: metric.advice for metric in registry() if not metric.available()}


def references() -> tuple[Reference, ...]:
    """Return what metrics are held against, each once, and what they stand on."""
    return tuple(dict.fromkeys((*(r for m in registry() for r in m.references), *FOUNDATIONS)))


def gauge_names() -> Mapping[str, str]:
    """Return the names of gauges by the id of the metrics that have one."""
    return {metric.id: metric.gauge for metric in registry() if metric.gauge}


@cache
def _discovered(folders: tuple[str, ...]) -> tuple[Metric[Any], ...]:
    """Return the metrics of the modules in some folders."""
    names = [found.name for found in pkgutil.iter_modules(folders) if not __name__.endswith(f".{found.name}")]
    names.sort(key=lambda name: (_ORDER.index(name) if name in _ORDER else len(_ORDER), name))
    return tuple(m for name in names for m in import_module(f"{_PACKAGE}.{name}").METRICS)


def _in_order(metrics: Sequence[Metric[Any]]) -> tuple[Metric[Any], ...]:
    """Return the metrics with each that has an ``after`` at its place."""
    order = [metric for metric in metrics if not metric.after]
    for metric in (m for m in metrics if m.after):
        ids = [m.id for m in order]
        if metric.after not in ids:
            raise ValueError(
                f"expected {metric.id} to stand after a metric that exists, got after={metric.after!r}. "
                "Name the id of another metric"
            )
        order.insert(ids.index(metric.after) + 1, metric)
    ids = [m.id for m in order]
    if twice := sorted({name for name in ids if ids.count(name) > 1}):
        raise ValueError(f"expected one metric for each id, got two of {', '.join(twice)}. Rename one")
    return tuple(order)
