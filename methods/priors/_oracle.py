# SPDX-License-Identifier: Apache-2.0
"""The oracle: the truth, made wrong as networks are wrong."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from graycard import MethodError
from graycard.layers import GLOSSY_ROUGHNESS
from graycard.methods._contract import LIGHTS
from graycard.methods._priors import PHOTOGRAPH, Ask, PriorKind, Question
from graycard.methods.priors._colour import corrupt_base_color
from graycard.methods.priors._depth import corrupt_depth
from graycard.methods.priors._draws import log_light
from graycard.methods.priors._filling import ALGORITHMS, filled
from graycard.methods.priors._inpainting import corrupt_filling
from graycard.methods.priors._mask import corrupt_mask
from graycard.methods.priors._material import corrupt_metallic, corrupt_roughness
from graycard.methods.priors._normal import SLOPES_OF_DEPTH, corrupt_normal
from graycard.methods.priors._spec import KindSpec

WITHOUT_TARGET = "counterfactual.radiance"
_F0, _ROUGHNESS = "counterfactual.f0", "counterfactual.roughness"
_TRUTH_OF_HOLES = {
    PHOTOGRAPH: (WITHOUT_TARGET,),
    "radiance": (WITHOUT_TARGET,),
    "diffuse": ("counterfactual.diffuse", _F0, _ROUGHNESS),
    "f0": (_F0, _ROUGHNESS),
    "roughness": (_ROUGHNESS, _F0),
    "normal": ("counterfactual.normal",),
    "glossy": (_F0, _ROUGHNESS),
}
"""Layers known without the target, by the layers whose holes it fills: of no other is there a truth. The
layer itself comes first, then what tells glossy surfaces."""
_SPLIT = frozenset({"diffuse", "f0", "roughness"})
"""Layers of glossy surfaces that photographs hardly tell apart: each method has a split of its own."""
_SHARES = frozenset({"f0", "roughness"})
"""Layers from 0 to 1, whatever errors and splits do."""
_EXPOSED = frozenset({PHOTOGRAPH, "radiance", "diffuse"})
_COLOURS = _EXPOSED | {"f0"}
_NO_NORMAL = 0.5
"""Length of a normal below which a blur over an edge has left none, or there is nothing."""
_TRUTH: Mapping[PriorKind, tuple[str, ...]] = {
    "depth": ("depth", "base_color"),
    "normal": ("normal", "base_color"),
    "base_color": ("base_color",),
    "roughness": ("roughness",),
    "metallic": ("metallic", "object_id"),
    "light": (LIGHTS,),
}
_TRUTH_OF_MASKS = {"glossy": ("roughness", "object_id"), "target": ("object_id",)}


def truth_for(ask: Ask, spec: KindSpec) -> frozenset[str]:
    """Return the names of the true layers from which the oracle answers; ``lights`` for the true lights."""
    if ask.kind == "mask":
        return frozenset(name for subject in ask.of for name in _TRUTH_OF_MASKS[subject])
    if ask.kind == "inpainting":
        return frozenset(name for layer in ask.of for name in _TRUTH_OF_HOLES.get(layer, ()))
    return frozenset(_TRUTH["depth" if spec.algorithm == SLOPES_OF_DEPTH else ask.kind])


@dataclass(frozen=True, slots=True, eq=False)
class OraclePrior:
    """Answers about one kind from the truth.

    Of the scene without its target radiance and the layers of :data:`_TRUTH_OF_HOLES` are known; those of
    :data:`_SPLIT` are off as the picture is off around a hole. Holes in any other layer, which a method
    has made up itself, are filled in from around them, as the classical source does by default; errors do not
    touch them.
    """

    spec: KindSpec
    truth: Mapping[str, Mapping[str, np.ndarray]]
    """Arrays by view name and layer name."""
    exposure: float
    """From radiance to display range."""
    target: int | None
    """Id of the object that the task names."""

    def answer(self, question: Question) -> np.ndarray:
        """Return the truth about a view, made wrong.

        Raises:
            MethodError: It is not known.
        """
        if question.kind == "inpainting" and question.of not in _TRUTH_OF_HOLES:
            return filled(question.image, question.hole, ALGORITHMS[0])
        known = self.truth.get(question.view.name)
        if known is None:
            raise MethodError(f"expected a view of the scene, got {question.view.name!r}")
        errors, seed, view, image = self.spec.errors, self.spec.seed, question.view.name, question.image
        match question.kind:
            case "depth":
                return self._depth(known, question)
            case "normal":
                return self._normal(known, question)
            case "base_color":
                return corrupt_base_color(known["base_color"], image, errors, seed, view)
            case "roughness":
                return corrupt_roughness(known["roughness"], errors, seed, view)
            case "metallic":
                return corrupt_metallic(known["metallic"], known["object_id"], errors, seed, view)
            case "mask":
                return corrupt_mask(self._mask(known, question.of), question.of, errors, seed, view)
            case "inpainting":
                return self._filled(known, question)

    def _depth(self, known: Mapping[str, np.ndarray], question: Question) -> np.ndarray:
        light = log_light(question.image, known["base_color"])
        return corrupt_depth(known["depth"], light, self.spec.errors, self.spec.seed, question.view.name)

    def _normal(self, known: Mapping[str, np.ndarray], question: Question) -> np.ndarray:
        camera, name = question.view.camera, question.view.name
        if self.spec.algorithm == SLOPES_OF_DEPTH:
            from graycard.methods.priors._slopes import slopes_of  # torch takes long to import

            return slopes_of(self._depth(known, question), camera)
        light = log_light(question.image, known["base_color"])
        return corrupt_normal(known["normal"], light, camera, self.spec.errors, self.spec.seed, name)

    def _filled(self, known: Mapping[str, np.ndarray], question: Question) -> np.ndarray:
        of, names = question.of, _TRUTH_OF_HOLES[question.of]
        if any(name not in known for name in names):
            raise MethodError(
                f"expected a method that says which layers it inpaints, got {of} to fill in and {of} not "
                "declared. Name it in the method's asks"
            )
        without = known[names[0]].astype(np.float64) * (self.exposure if of in _EXPOSED else 1.0)
        if of == "glossy":
            without = _is_glossy(known).astype(np.float64)
        if np.ndim(question.image) != without.ndim:
            raise MethodError(
                f"expected {of} of shape {without.shape} to fill in, got {np.shape(question.image)}"
            )
        if of in _SPLIT:
            without = _continued(without, question, _is_glossy(known))
        told = corrupt_filling(
            without, self.spec.errors, self.spec.seed, question.view.name, is_colour=of in _COLOURS
        )
        if of in _SHARES:
            return np.clip(told, 0, 1)
        return _unit(told) if of == "normal" else told

    def _mask(self, known: Mapping[str, np.ndarray], of: str) -> np.ndarray:
        ids = known["object_id"]
        if of == "target":
            return ids == self.target
        return (ids > 0) & (known["roughness"] < GLOSSY_ROUGHNESS)


def _is_glossy(known: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return which pixels are glossy without the target, ``(H, W)``, bool."""
    return (known[_F0] > 0).any(axis=-1) & (known[_ROUGHNESS] < GLOSSY_ROUGHNESS)


def _continued(true: np.ndarray, question: Question, glossy: np.ndarray) -> np.ndarray:
    """Return a layer, moved on glossy surfaces by as much as the picture around the hole is off it.

    A painter goes on with what it is shown, and cannot know that all of a surface is, say, too dim a mirror.
    The shadow of the object, dark next to the hole, is not to go on there, as little as in a hole that is
    filled with radiance: what is taken is the median over all glossy pixels of the view.
    """
    assert question.hole is not None, "what is filled in has one"
    known = glossy & ~question.hole
    if not known.any():
        return true
    off = np.median((question.image - true)[known], axis=0)
    return np.where(glossy if true.ndim == 2 else glossy[..., None], np.maximum(true + off, 0.0), true)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors of length one, or zero where they are next to it, ``(H, W, 3)``."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > _NO_NORMAL, vectors / np.maximum(length, _NO_NORMAL), 0.0)
