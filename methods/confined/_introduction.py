# SPDX-License-Identifier: Apache-2.0
"""Introduce a method before it is fitted: its needs, asks, settings and code."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from graycard.io import from_builtins, to_builtins
from graycard.methods._contract import asks_of
from graycard.methods._priors import Ask
from graycard.methods._registry import fingerprint, load_method, settings_of
from graycard.methods.priors import PriorSpec, check_priors


@dataclass(frozen=True, slots=True)
class Introduction:
    """A method's own account of itself, with some settings and priors."""

    summary: str
    needs: tuple[str, ...]
    settings: Mapping[str, Any]
    """All of them, as in JSON."""
    asks: tuple[Ask, ...]
    fingerprint: str
    """Version and hash of its code."""


def introduce(method: str, settings: Mapping[str, Any], priors: PriorSpec) -> Introduction:
    """Import a method, and return what it says of itself.

    Args:
        method: A registered name or ``module:attribute``.
        settings: Those that differ from its defaults.
        priors: What answers its asks.

    Raises:
        UnknownNameError: It does not exist.
        MethodError: It does not load, or does not take its settings or its priors.
    """
    loaded = load_method(method)
    chosen, asks = settings_of(loaded, settings), asks_of(loaded)
    check_priors(priors, asks)
    code = fingerprint(method, with_priors=bool(asks or loaded.needs))
    return Introduction(loaded.summary, loaded.needs, to_builtins(chosen), asks, code)


def introduction_as_json(method: str, settings: Mapping[str, Any], priors: Any) -> Any:
    """Return :func:`introduce` as JSON data, from JSON data."""
    return to_builtins(introduce(method, settings, from_builtins(PriorSpec, priors)))
