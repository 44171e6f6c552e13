# SPDX-License-Identifier: Apache-2.0
"""Suites at other sizes: of pictures, of training views, and of the steps and surfels of fits."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from graycard import RecordError
from graycard.benchmarks._suites import Suite
from graycard.records import Scale, Size


def at_size(suite: Suite, size: Size) -> Suite:
    """Return a suite whose pictures have another size or number; its scenes stay what they are.

    Light paths a pixel stay as well, so that pixels are as noisy as before. All cameras follow from the
    number of views, so other training views move those that are held out, too.

    Raises:
        RecordError: Pictures would be too small or too large.
    """
    render = suite.render
    scale = size.of(Scale(render.width, render.height, render.train_views, render.test_views))
    try:
        sized = replace(render, width=scale.width, height=scale.height, train_views=scale.train_views)
    except ValueError as cause:
        raise RecordError(f"{cause}. Mend --pixels") from None
    return replace(suite, render=sized)


def scaled(settings: Mapping[str, Any], budget: float, surfels: float = 1.0) -> dict[str, int]:
    """Return those of a method's settings that a budget and a factor on surfels change; at least 1 each.

    Args:
        settings: Of the method. Without ``iterations`` or ``surfels`` nothing is scaled.
        budget: Factor on the iterations.
        surfels: Factor on the surfels.
    """
    factors = {"iterations": budget, "surfels": surfels}
    return {
        name: max(1, round(settings[name] * factor))
        for name, factor in factors.items()
        if factor != 1 and isinstance(settings.get(name), int)
    }
