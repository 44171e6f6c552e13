# SPDX-License-Identifier: Apache-2.0
"""Truth that a method is given: what it needs by its own account, and what priors make their answers of."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from graycard import Capture, DatasetError, EnvironmentLight, Truth, open_truth
from graycard.benchmarks._changes import true_composition, true_relighting
from graycard.io import Room
from graycard.layers import lights_of, with_derived
from graycard.methods import COMPOSITION, LIGHTS, RELIGHTING, Ask, Priors
from graycard.methods.priors import PriorSpec, make_priors, truth_of

ALWAYS = frozenset({"radiance", "base_color", "normal", "depth"})
"""Truth that every scene has; other layers need a target, lights of their own, or a renderer with LLVM."""


def priors_for(
    needs: Sequence[str], asks: tuple[Ask, ...], spec: PriorSpec, capture: Capture, scene: Path
) -> Priors:
    """Return the truth that a method needs, and what answers its asks; it is not to open the truth itself.

    Args:
        needs: Of the method that is to be fitted.
        asks: Of that method.
        spec: Where answers come from.
        capture: The copy that is fitted.
        scene: ``DATASET/<track>/<scene>``, whose truth is opened once, and only if some of it is wanted.

    Raises:
        DatasetError: Truth is asked for, and the scene has none or a damaged one.
        MethodError: Method, priors and weights do not go together.
    """
    told, needed = truth_of(spec, asks), frozenset(needs)
    if not told and not needed:
        return make_priors(spec, asks, capture, {}, load=False)
    truth = open_truth(scene / "truth")
    answering = _answering(spec, asks, capture, truth, told)
    return _with_needed(answering, capture, truth, needed) if needed else answering


def _answering(
    spec: PriorSpec, asks: tuple[Ask, ...], capture: Capture, truth: Truth, told: frozenset[str]
) -> Priors:
    """Return priors that answer, from the truth that their source is told."""
    shown = told - {LIGHTS}
    layers = _true_layers(truth, capture, shown, shown) if shown else {}
    lights = truth.lights() if LIGHTS in told else ()
    return make_priors(spec, asks, capture, layers, lights, load=False)


def _with_needed(priors: Priors, capture: Capture, truth: Truth, needed: frozenset[str]) -> Priors:
    """Return priors that also hold the truth which the method needs."""
    found = replace(
        priors,
        source="oracle",
        layers=_true_layers(truth, capture, needed, needed & ALWAYS),
        relighting=true_relighting(truth, capture) if RELIGHTING in needed else (),
        composition=true_composition(truth, capture) if COMPOSITION in needed else None,
    )
    return _with_lights(found, truth) if LIGHTS in needed else found


def _with_lights(priors: Priors, truth: Truth) -> Priors:
    """Return priors that also hold the true lights, with the images of environments."""
    lights = truth.lights()
    images = {x.name: truth.environment(x) for x in lights if isinstance(x, EnvironmentLight)}
    return replace(priors, lights=lights, environments=images)


def _true_layers(
    truth: Truth, capture: Capture, wanted: frozenset[str], required: frozenset[str]
) -> dict[str, dict[str, np.ndarray]]:
    """Return true layers by view and name.

    Raises:
        DatasetError: The scene has not all that are required.
    """
    with Room() as room:
        layers = {view.name: room.keep(_pick(truth, view.name, wanted)) for view in capture.views}
    absent = required.difference(*layers.values())
    if absent:
        raise DatasetError(
            f"expected the truth of {Path(truth.root or '').parent} to have {', '.join(sorted(absent))}, "
            f"got none: scenes of track {capture.track} have no such layers. Fit a scene of another track, "
            "or take other priors"
        )
    return layers


def _pick(truth: Truth, view: str, wanted: frozenset[str]) -> dict[str, np.ndarray]:
    """Return the wanted layers that a view has; ``<layer>.<light>`` stands for those of all lights."""
    layers = with_derived(truth.layers(truth.view(view)))
    stems = [name.removesuffix(".<light>") for name in wanted if name.endswith(".<light>")]
    each = {f"{stem}.{light}" for stem in stems for light in lights_of(stem, layers)}
    return {name: a for name, a in layers.items() if name in wanted | each}
