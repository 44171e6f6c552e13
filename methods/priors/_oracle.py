# SPDX-License-Identifier: Apache-2.0
"""The oracle: the truth, made wrong as networks are wrong."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from graycard import GLOSSY_ROUGHNESS, MethodError
from graycard.methods._contract import LIGHTS
from graycard.methods._priors import PHOTOGRAPH, Ask, PriorKind, Question
from graycard.methods.priors._colour import corrupt_base_color
from graycard.methods.priors._depth import corrupt_depth
from graycard.methods.priors._draws import log_light
from graycard.methods.priors._filling import ALGORITHMS, filled
from graycard.methods.priors._inpainting import corrupt_filling
from graycard.methods.priors._mask import corrupt_mask
from graycard.methods.priors._material import corrupt_metallic, corrupt_roughness
from graycard.methods.priors._normal import corrupt_normal
from graycard.methods.priors._spec import KindSpec

WITHOUT_TARGET = "counterfactual.radiance"
SEEN = (PHOTOGRAPH, "radiance")
"""What is known without the target; of no other layer is there a truth to fill holes with."""
_TRUTH: Mapping[PriorKind, tuple[str, ...]] = {
    "depth": ("depth", "base_color"),
    "normal": ("normal", "base_color"),
    "base_color": ("base_color",),
    "roughness": ("roughness",),
    "metallic": ("metallic", "object_id"),
    "inpainting": (WITHOUT_TARGET,),
    "light": (LIGHTS,),
}
_TRUTH_OF_MASKS = {"glossy": ("roughness", "object_id"), "target": ("object_id",)}


def truth_for(ask: Ask) -> frozenset[str]:
    """Names of the true layers from which the oracle answers; ``lights`` for the true lights."""
    if ask.kind == "mask":
        return frozenset(name for subject in ask.of for name in _TRUTH_OF_MASKS[subject])
    if ask.kind == "inpainting" and not set(ask.of) & set(SEEN):
        return frozenset()
    return frozenset(_TRUTH[ask.kind])


@dataclass(frozen=True, slots=True, eq=False)
class Oracle:
    """Answers about one kind from the truth.

    The scene without its target is known in radiance only. Holes in other layers, which a method has found
    itself, are filled in from around them, as the classical source does by default; errors do not touch them.
    """

    spec: KindSpec
    truth: Mapping[str, Mapping[str, np.ndarray]]
    """Arrays by view name and layer name."""
    exposure: float
    """From radiance to display range."""
    target: int | None
    """Id of the object that the task names."""

    def answer(self, question: Question) -> np.ndarray:
        """The truth about a view, made wrong.

        Raises:
            MethodError: It is not known.
        """
        if question.kind == "inpainting" and question.of not in SEEN:
            return filled(question.image, question.hole, ALGORITHMS[0])
        known = self.truth.get(question.view.name)
        if known is None:
            raise MethodError(f"expected a view of the scene, got {question.view.name!r}")
        errors, seed, view, image = self.spec.errors, self.spec.seed, question.view.name, question.image
        match question.kind:
            case "depth":
                light = log_light(image, known["base_color"])
                return corrupt_depth(known["depth"], light, errors, seed, view)
            case "normal":
                light = log_light(image, known["base_color"])
                return corrupt_normal(known["normal"], light, question.view.camera, errors, seed, view)
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

    def _filled(self, known: Mapping[str, np.ndarray], question: Question) -> np.ndarray:
        if WITHOUT_TARGET not in known:
            raise MethodError(
                f"expected a method that says it inpaints radiance, got {question.of} to fill in and none "
                "declared. Name it in the method's asks"
            )
        if np.ndim(question.image) != 3:
            raise MethodError(f"expected {question.of} with three channels to fill in, got one")
        without = known[WITHOUT_TARGET].astype(np.float64) * self.exposure
        return corrupt_filling(without, self.spec.errors, self.spec.seed, question.view.name)

    def _mask(self, known: Mapping[str, np.ndarray], of: str) -> np.ndarray:
        ids = known["object_id"]
        if of == "target":
            return ids == self.target
        return (ids > 0) & (known["roughness"] < GLOSSY_ROUGHNESS)
