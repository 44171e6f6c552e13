# SPDX-License-Identifier: Apache-2.0
"""Tell whether a scene on disk is the one that a spec describes.

A truth records every knob and every setting that it was made with. One that it does not name is newer than
the scene, and had its default then: so families and settings may gain some without rendering anything anew.
"""

from collections.abc import Mapping
from typing import Any

from graycard.io import to_builtins
from graycard.synth._spec import BANDS_VERSION, GENERATOR_VERSION, NEEDED_VERSION, RenderSettings, SceneSpec
from graycard.synth.families import default_knobs, resolved_knobs

NEEDED = "needed_layers"
"""Name of the version of scenes whose training views hold no more than is needed; of others there is none."""

BANDS = "bands"
"""Name of the version of scenes with pictures that are traced in bands; of others there is none."""

_OPEN = ("knobs", "render")
"""Parts of an identity that may gain members."""


def identity(spec: SceneSpec, settings: RenderSettings) -> dict[str, Any]:
    """Return everything that decides what a scene's files hold, but for the renderer's variant."""
    made_from: dict[str, Any] = {
        "generator": GENERATOR_VERSION,
        "track": spec.track,
        "family": spec.family,
        "seed": spec.seed,
        "knobs": resolved_knobs(spec),
        "render": settings,
    }
    if settings.training_layers == "needed":
        made_from[NEEDED] = NEEDED_VERSION
    if settings.in_bands:
        made_from[BANDS] = BANDS_VERSION
    return to_builtins(made_from)


def with_defaults(found: Mapping[str, Any], spec: SceneSpec, settings: RenderSettings) -> dict[str, Any]:
    """Return what a scene was made with, completed by what was added since.

    Args:
        found: ``knobs`` and ``render`` as a truth's manifest or a stamp has them, among others.
        spec: The scene that it is compared with; its family tells the default of a knob.
        settings: The settings that it is compared with.

    Raises:
        UnknownNameError: There is no such family.
    """
    defaults = {"knobs": default_knobs(spec), "render": to_builtins(type(settings)())}
    return {
        name: _completed(value, defaults[name]) if name in _OPEN else value for name, value in found.items()
    }


def differences(
    found: Mapping[str, Any], wanted: Mapping[str, Any], spec: SceneSpec, settings: RenderSettings
) -> list[str]:
    """Return in words where a scene is another one than is wanted; empty for the same.

    Args:
        found: What a scene was made with.
        wanted: The identity of ``spec`` and ``settings``.
        spec: The wanted scene.
        settings: How it is photographed.
    """
    old, new = _flat(with_defaults(found, spec, settings)), _flat(wanted)
    differ = [
        f"{name}: expected {new[name]}, got {old.get(name)}" for name in new if old.get(name) != new[name]
    ]
    if BANDS not in new and old.get(BANDS) is not None:
        differ.append(f"{BANDS}: expected none, got {old[BANDS]}")
    gone = [name for name in old if name.partition(".")[0] in _OPEN and name not in new]
    return differ + [
        f"{name}: expected a name that this version knows, got it with {old[name]}" for name in gone
    ]


def _completed(value: Any, defaults: Any) -> Any:
    """Return a mapping with the defaults that it lacks, also in mappings inside of it."""
    if not isinstance(value, Mapping) or not isinstance(defaults, Mapping):
        return value
    return {**defaults, **{name: _completed(inner, defaults.get(name)) for name, inner in value.items()}}


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = value
    return flat
