# SPDX-License-Identifier: Apache-2.0
"""Materials and lights of our own as plugins of Mitsuba. Import it only after ``use_renderer``."""

from collections.abc import Callable, Mapping
from typing import Any, Literal

import mitsuba as mi

_registered: dict[tuple[str, str | None], type] = {}
"""Classes by plugin and variant: each variant has base classes of its own, and takes a name once."""


def register_plugin(
    name: str, base: Literal["BSDF", "Emitter"], methods: Mapping[str, Callable[..., Any]]
) -> None:
    """Make a plugin known to the variant in use, where it is not yet.

    Args:
        name: The ``type`` in Mitsuba's dictionaries.
        base: Mitsuba's class that it derives from.
        methods: What it overrides, by name.
    """
    variant = mi.variant()
    if (name, variant) in _registered:
        return
    made = type(f"{name}[{variant}]", (getattr(mi, base),), dict(methods))
    getattr(mi, f"register_{base.lower()}")(name, made)
    _registered[name, variant] = made
