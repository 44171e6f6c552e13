# SPDX-License-Identifier: Apache-2.0
"""Suites at other sizes: of pictures, of training views, and of the steps and surfels of fits."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from graycard import RecordError
from graycard.benchmarks._suites import Suite
from graycard.records import Size
from graycard.synth import RenderSettings


def at_size(suite: Suite, size: Size) -> Suite:
    """Return a suite whose pictures have another size or number; its scenes stay what they are.

    Light paths a pixel stay as well, so that pixels are as noisy as before.

    Raises:
        RecordError: Pictures would be too small, or views too few.
    """
    try:
        return replace(suite, render=rendered_at(suite.render, size))
    except ValueError as cause:
        raise RecordError(f"{cause}. Mend --pixels or --views") from None


def rendered_at(render: RenderSettings, size: Size) -> RenderSettings:
    """Return how pictures of another size or number are rendered; width and height keep their ratio.

    Raises:
        ValueError: They would be too small, or views too few.
    """
    width = render.width if size.width is None else size.width
    views = render.train_views if size.train_views is None else size.train_views
    return replace(render, width=width, height=round(render.height * width / render.width), train_views=views)


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
