# SPDX-License-Identifier: Apache-2.0
"""Layers taken from disk for scoring: whole, of the right size and finite, or a reason why not."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from graycard import DatasetError, GraycardError, PredictionError, Predictions, Truth, View, all_layers
from graycard.eval.measures._chart import NAME as CHART
from graycard.eval.scoring._mask import judged_mask
from graycard.io import KnownLayers
from graycard.layers import LOBES, find_fault, not_meant, with_derived, with_sums

T = TypeVar("T")

WITH_LIGHTS = frozenset({"radiance", "counterfactual.radiance", "normal", "depth"})
"""Layers that are judged on the surfaces of lights, too."""
OF_GLOSS = frozenset({"roughness", "f0", *LOBES})
"""Layers that tell something only where there is a specular lobe."""
_EACH = ".<light>"


@dataclass(frozen=True, slots=True)
class PredictedView:
    """The layers of a predictions folder for one view."""

    view: View
    layers: Mapping[str, np.ndarray] = field(default_factory=dict)
    fault: str = ""
    """Why its file cannot be read; empty where it can, or where there is none."""
    faults: Mapping[str, str] = field(default_factory=dict)
    """By layer of the file that cannot be used by itself: why not."""
    exists: bool = True
    dark: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Layers of lights that the prediction says are not there, black."""
    surplus: frozenset[str] = frozenset()
    """Names of layers of lights that stand for no true one."""

    @property
    def provided(self) -> frozenset[str]:
        """Names of the layers that the view has, fit to be scored or not."""
        return frozenset({*self.layers, *self.faults})

    def take(self, layer: str, within: np.ndarray | None = None) -> np.ndarray:
        """Return a layer that is fit to be scored.

        Args:
            layer: Which.
            within: Judged pixels, shape ``(H, W)``, bool; None for all. What is not finite elsewhere is 0 in
                the result: it may be anything, and no metric looks at it.

        Raises:
            PredictionError: It is missing, of another size, or not finite at a judged pixel.
        """
        name, camera = self.view.name, self.view.camera
        if self.fault:
            raise PredictionError(self.fault)
        if layer in self.dark:
            return self.dark[layer]
        if layer in self.faults:
            raise PredictionError(f"{name}: {self.faults[layer]}")
        if layer not in self.layers:
            have = ", ".join(self.layers) if self.exists else "no file"
            raise PredictionError(
                f"{name}: expected {layer} in views/{name}.exr, got {have}. Write this layer in every view"
            )
        values = self.layers[layer]
        bad = not_meant(layer, values)
        if found := find_fault(layer, values, camera.height, camera.width, within=within, bad=bad):
            raise PredictionError(f"{name}: {found}. Write this view again")
        return np.where(bad, values.dtype.type(0), values) if bad.any() else values


@dataclass(frozen=True, slots=True)
class TrueView:
    """The truth of one view, with the pixels that are judged."""

    view: View
    layers: Mapping[str, np.ndarray]
    emitters: frozenset[int]
    charts: frozenset[int] = frozenset()
    """Ids of the objects that are colour charts."""
    masks: dict[tuple[str, bool], np.ndarray] = field(default_factory=dict, repr=False, compare=False)
    """Those that were computed before."""
    kept: dict[Callable[..., Any], Any] = field(default_factory=dict, repr=False, compare=False)
    """Results of :meth:`once`, by key."""

    def take(self, layer: str) -> np.ndarray:
        """Return a layer that is fit to be compared with.

        Raises:
            DatasetError: It is missing, of another size, or not finite.
        """
        name, camera = self.view.name, self.view.camera
        if layer not in self.layers:
            raise DatasetError(
                f"expected {layer} in the truth of view {name}, got {', '.join(self.layers)}. "
                "Run `graycard render` again"
            )
        if found := find_fault(layer, self.layers[layer], camera.height, camera.width):
            raise DatasetError(f"truth of view {name}: {found}. Run `graycard render` again")
        return self.layers[layer]

    def once(self, make: Callable[["TrueView"], T]) -> T:
        """Return a quantity that several metrics derive from this view: made once, then kept."""
        if make not in self.kept:
            self.kept[make] = make(self)
        return self.kept[make]

    def mask(self, layer: str, chart: bool = False) -> np.ndarray:
        """Return the judged pixels of a layer, shape ``(H, W)``, bool.

        Depth is judged where it is finite, and roughness and f0 where there is a specular lobe. The light of
        either lobe is judged in views that see a specular one at all: without, nothing is to be taken apart.

        Args:
            layer: Which.
            chart: Whether only pure pixels of the colour chart are judged.

        Raises:
            DatasetError: The truth has no object ids.
        """
        if (layer, chart) not in self.masks:
            self.masks[layer, chart] = self._mask(layer, chart)
        return self.masks[layer, chart]

    def _mask(self, layer: str, chart: bool) -> np.ndarray:
        ids = self.take("object_id")
        mask = judged_mask(ids, frozenset() if layer in WITH_LIGHTS else self.emitters)
        if chart:
            pure = self.pure()
            mask = mask & np.isin(ids, sorted(self.charts)) & (mask if pure is None else pure)
        if layer == "depth":
            mask = mask & np.isfinite(self.take(layer))
        if layer in OF_GLOSS and "f0" in self.layers:
            glossy = mask & (self.take("f0") > 0).any(axis=-1)
            return glossy if layer in ("roughness", "f0") else mask & glossy.any()
        return mask

    def pure(self) -> np.ndarray | None:
        """Pixels that show one surface of one colour, shape ``(H, W)``, bool; None where none are named.

        Raises:
            DatasetError: The layer is of another size, or not finite.
        """
        return self.take("pure") > 0.5 if "pure" in self.layers else None


def read_prediction(
    predictions: Predictions, view: View, names: Mapping[str, str] | None = None
) -> PredictedView:
    """Return the prediction of a view, with sums of its layers; an unreadable file becomes a fault.

    Args:
        predictions: The folder.
        view: Which view.
        names: True names of lights by predicted ones: layers of a light change their names so, and those of
            any other light are left out. None keeps all.
    """
    if view.name not in predictions.view_names():
        listed = f"views/{view.name}.exr" in predictions.files
        return PredictedView(view, fault=_gone(view.name) if listed else "", exists=False)
    try:
        found = predictions.known_layers(view.name)
    except GraycardError as cause:
        return PredictedView(view, fault=f"{view.name}: {cause}")
    faults = {**found.faults, **_faults_of_sums(found)}
    summed = {name: values for name, values in with_sums(found.layers).items() if name not in faults}
    layers, surplus = _renamed(summed, names)
    return PredictedView(view, layers, faults=_renamed(faults, names)[0], surplus=surplus)


def _faults_of_sums(found: KnownLayers) -> dict[str, str]:
    """Return a fault for each sum of layers that would be without a part which cannot be used."""
    if not found.faults:
        return {}
    parts = {name: np.array(float(name in found.faults)) for name in (*found.layers, *found.faults)}
    counts = with_sums(parts)  # of faulty parts
    first = next(iter(found.faults.values()))
    return {
        name: f"expected all parts of {name}, got one that cannot be used: {first}"
        for name in counts.keys() - parts.keys()
        if counts[name] > 0
    }


def with_darkness(
    predicted: PredictedView, judged: Sequence[str], names: Mapping[str, str] | None
) -> PredictedView:
    """Return a view with black layers of those lights that a prediction says are not there.

    A light that no predicted one stands for shines on nothing in the prediction. What is left of a layer of
    which the view has no light at all, or of a light that is predicted, is absent and stays so.

    Args:
        predicted: The view.
        judged: The layers that are needed.
        names: True names of lights by predicted ones; None where no lights are predicted: then any may be
            there.
    """
    if names is None:
        return predicted
    split = {layer: layer.rpartition(".") for layer in judged}
    there = {name.rpartition(".")[0] for name in predicted.provided} & _stems()
    camera = predicted.view.camera
    black = np.zeros((camera.height, camera.width, 3), np.float32)
    dark = {
        k: black for k, (stem, _, light) in split.items() if stem in there and light not in names.values()
    }
    return replace(predicted, dark=dark)


def read_truth(truth: Truth, view: View) -> TrueView:
    """Return the truth of a view.

    Raises:
        DatasetError: The file is missing or broken.
    """
    charts = frozenset(o.id for o in truth.objects if o.name == CHART)
    return TrueView(view, with_derived(truth.layers(view)), truth.emitter_ids(), charts)


def photographed(view: View, photograph: np.ndarray) -> TrueView:
    """Return a photograph in the place of truth: light is all that is known, and every pixel counts."""
    everywhere = np.ones((view.camera.height, view.camera.width), np.uint32)
    return TrueView(view, {"radiance": photograph, "object_id": everywhere}, frozenset())


def _renamed(
    layers: Mapping[str, T], names: Mapping[str, str] | None
) -> tuple[Mapping[str, T], frozenset[str]]:
    """Return values of layers by the true names of lights, and the names of those that stand for none."""
    if names is None:
        return layers, frozenset()
    stems = _stems()
    found: dict[str, T] = {}
    surplus = set()
    for name, values in layers.items():
        stem, _, light = name.rpartition(".")
        if stem not in stems:
            found[name] = values
        elif light in names:
            found[f"{stem}.{names[light]}"] = values
        else:
            surplus.add(name)
    return found, frozenset(surplus)


def _stems() -> set[str]:
    """Names of the layers that there is one of for each light, without the light."""
    return {layer.name.removesuffix(_EACH) for layer in all_layers() if layer.name.endswith(_EACH)}


def _gone(name: str) -> str:
    return (
        f"{name}: expected views/{name}.exr, which predictions.json lists, got none. "
        "Write the predictions again"
    )
