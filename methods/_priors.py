# SPDX-License-Identifier: Apache-2.0
"""Inputs of a method beyond the capture: truth that it needs, and a prior that it may ask again and again.

A prior is asked with an image, as a network would be: a method may ask for depth from a photograph, and
later once more from the albedo that it has found. Whatever answers stands behind :class:`PriorModel`; that
image and answer are sound is checked here, for all sources alike.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol, get_args

import numpy as np

from graycard import Composition, Light, MethodError, PointLight, SpotLight, UnknownNameError, View
from graycard.layers import find_fault

PriorSource = Literal["none", "oracle", "classical", "pretrained"]
ImageKind = Literal["depth", "normal", "base_color", "roughness", "metallic", "mask", "inpainting"]
"""Kinds that are asked with an image and answered with one."""
PriorKind = Literal[ImageKind, "light"]

SOURCES: tuple[PriorSource, ...] = get_args(PriorSource)
KINDS: tuple[PriorKind, ...] = get_args(PriorKind)
Lamp = PointLight | SpotLight
"""Lamps on a camera that can be calibrated."""
PHOTOGRAPH = "photograph"
SUBJECTS = ("glossy", "target")
"""Subjects of masks: surfaces with visible reflections, or the object that the task names."""
FRACTIONS = ("base_color", "roughness", "metallic")
"""Kinds whose values are shares of one."""


@dataclass(frozen=True, slots=True)
class Ask:
    """Questions of a method to a prior; declared, so that a lack is met before any time is spent."""

    kind: PriorKind
    of: tuple[str, ...] = (PHOTOGRAPH,)
    """The images it will hand in: ``photograph``, or names of layers that it finds itself. For ``mask`` the
    subjects (``glossy``, ``target``); for ``inpainting`` the layers whose holes are to be filled: an oracle
    knows the truth of radiance and of materials, and of no other. For ``light`` it says nothing: one
    calibration is for the whole capture."""
    optional: bool = False
    """True if the method also works without: then it looks into :attr:`Priors.kinds`."""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UnknownNameError("kind of prior", self.kind, KINDS)
        if self.kind == "mask":
            for subject in self.of:
                if subject not in SUBJECTS:
                    raise UnknownNameError("subject of a mask", subject, SUBJECTS)
        if not self.of:
            raise ValueError(f"expected what {self.kind} is asked of, got nothing")


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """One question to a prior."""

    kind: ImageKind
    view: View
    image: np.ndarray
    """Shape ``(H, W, 3)``, linear, display range; to inpaint also ``(H, W)``, in the unit of its layer."""
    of: str = ""
    """Subject of a mask, or layer to inpaint."""
    hole: np.ndarray | None = None
    """Hole, where inpainting is to fill in, shape ``(H, W)``, bool."""


class PriorModel(Protocol):
    """Whatever answers: the truth through a corruption, a classical algorithm, a network."""

    def answer(self, question: Question) -> np.ndarray:
        """Return the answer, unchecked."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Relit:
    """The held-out views under changed lights, as they truly are."""

    lights: tuple[Light, ...]
    """All that shine then; the image of an environment is the full path of its file."""
    radiance: Mapping[str, np.ndarray]
    """By view name, each ``(H, W, 3)``, W/m²/sr."""


@dataclass(frozen=True, slots=True, eq=False)
class Composed:
    """The held-out views with an object of another scene put in, as they truly are."""

    composition: Composition
    """Object that was put in."""
    radiance: Mapping[str, np.ndarray]
    """By view name, each ``(H, W, 3)``, W/m²/sr."""


@dataclass(frozen=True, slots=True)
class Priors:
    """Inputs of a method beyond the capture: the truth that it needs, and what it may ask.

    Images are handed in linear and in display range (a photograph times the exposure of the capture, or an
    albedo), shape ``(H, W, 3)`` of the view's camera. Answers are float64. Every verb raises
    ``MethodError`` where nothing answers this kind, or the image or the answer is not sound.
    """

    source: PriorSource = "none"
    layers: Mapping[str, Mapping[str, np.ndarray]] = field(default_factory=dict)
    """Truth that the method needs: arrays by view name and layer name, training and held-out views."""
    lights: tuple[Light, ...] | None = None
    environments: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Images of the environments among the lights, by name of the light, ``(H, W, 3)``, W/m²/sr."""
    relighting: tuple[Relit, ...] = ()
    """Truth under every change of the lights, where a method needs it."""
    composition: Composed | None = None
    """Truth with an object put in, where a method needs it."""
    models: Mapping[str, PriorModel] = field(default_factory=dict)
    """Models that answer when shown an image, by kind."""
    calibration: Lamp | None = None
    """The lamp on the camera as somebody has measured it, in camera axes."""

    @property
    def kinds(self) -> frozenset[str]:
        """The kinds that can be asked for."""
        return frozenset(self.models) | ({"light"} if self.calibration is not None else set())

    def require(self, kind: PriorKind) -> None:
        """Refuse to go on where nothing answers a kind: before a fit, not in its middle.

        Raises:
            MethodError: Nothing does.
        """
        if kind not in self.kinds:
            raise self._lack_of(kind)

    def layer(self, view: str, name: str) -> np.ndarray:
        """Return the true array of a layer for a view, ``(H, W)`` or ``(H, W, 3)``.

        Raises:
            MethodError: It was not handed in.
        """
        try:
            return self.layers[view][name]
        except KeyError as cause:
            raise MethodError(
                f"expected a prior for layer {name!r} of view {view!r}, got none (source: {self.source}). "
                "Fit with the scene's truth beside its capture, or hand the prior in"
            ) from cause

    def depth(self, image: np.ndarray, view: View) -> np.ndarray:
        """z-depth, shape ``(H, W)``, metres up to an error of scale; +inf where there is nothing."""
        return self._ask(Question("depth", view, image))

    def normal(self, image: np.ndarray, view: View) -> np.ndarray:
        """Return unit normals, shape ``(H, W, 3)``, world, outward; zero where there is nothing."""
        return self._ask(Question("normal", view, image))

    def base_color(self, image: np.ndarray, view: View) -> np.ndarray:
        """Return base colour, shape ``(H, W, 3)``, linear, [0, 1]; its scale may differ from view to view."""
        return self._ask(Question("base_color", view, image))

    def roughness(self, image: np.ndarray, view: View) -> np.ndarray:
        """Roughness, shape ``(H, W)``, [0, 1]."""
        return self._ask(Question("roughness", view, image))

    def metallic(self, image: np.ndarray, view: View) -> np.ndarray:
        """Metallic share, shape ``(H, W)``, [0, 1]."""
        return self._ask(Question("metallic", view, image))

    def mask(self, image: np.ndarray, view: View, of: str) -> np.ndarray:
        """Return where a subject (``glossy``, ``target``) is seen, shape ``(H, W)``, bool."""
        if of not in SUBJECTS:
            raise UnknownNameError("subject of a mask", of, SUBJECTS)
        return self._ask(Question("mask", view, image, of))

    def inpainting(self, image: np.ndarray, view: View, hole: np.ndarray, of: str = "radiance") -> np.ndarray:
        """Return an image whose hole is filled in; outside it is as it was.

        Channels may be filled in each by itself: whoever hands in normals makes them of unit length again.

        Args:
            image: shape ``(H, W, 3)`` or ``(H, W)``; radiance in display range, other layers in their unit.
            view: The view.
            hole: shape ``(H, W)``, bool.
            of: The layer that the image shows.
        """
        hole = np.asarray(hole)
        size = (view.camera.height, view.camera.width)
        if hole.shape != size or hole.dtype != bool:
            raise MethodError(f"expected a hole of bool and shape {size}, got {hole.dtype} of {hole.shape}")
        filled = self._ask(Question("inpainting", view, image, of, hole))
        inside = hole if filled.ndim == hole.ndim else hole[..., None]
        return np.where(inside, filled, image)

    def light(self) -> Lamp:
        """Return the lamp on the camera as its calibration says: in camera axes, metres and W/sr.

        Raises:
            MethodError: There is no calibration, or it is of a lamp that stands in the room.
        """
        if self.calibration is None:
            raise self._lack_of("light")
        if self.calibration.frame != "camera":
            raise MethodError(
                f"expected the calibration of a lamp on the camera, got {self.calibration.name!r} in the "
                f"{self.calibration.frame}. State its position in camera axes"
            )
        return self.calibration

    def _lack_of(self, kind: PriorKind) -> MethodError:
        return MethodError(
            f"expected a prior that gives {kind}, got one of source {self.source!r} that gives "
            f"{', '.join(sorted(self.kinds)) or 'nothing'}. Declare it in the method's asks, and name a "
            "source of priors that has it"
        )

    def _ask(self, question: Question) -> np.ndarray:
        """Return the checked answer to a checked question."""
        if question.kind not in self.models:
            raise self._lack_of(question.kind)
        _check_image(question)
        answer = np.asarray(self.models[question.kind].answer(question))
        fault = _fault(question, answer)
        if fault:
            raise MethodError(f"prior for {question.kind} of view {question.view.name}: {fault}")
        return answer if question.kind == "mask" else answer.astype(np.float64)


def _check_image(question: Question) -> None:
    """Refuse an image that is not of the view, or not finite."""
    height, width = question.view.camera.height, question.view.camera.width
    image = np.asarray(question.image)
    shapes = [(height, width, 3)] + [(height, width)] * (question.kind == "inpainting")
    where = f"to ask for {question.kind} of view {question.view.name}"
    if image.shape not in shapes:
        listing = " or ".join(map(str, shapes))
        raise MethodError(f"expected an image of shape {listing} {where}, got {image.shape}")
    if question.hole is not None:
        image = image[~question.hole]
    if image.dtype.kind not in "fiub" or not np.isfinite(image).all():
        raise MethodError(f"expected a finite image {where}, got one that is not, or {image.dtype}")


def _fault(question: Question, answer: np.ndarray) -> str | None:
    """Return what is wrong with an answer, as "expected …, got …"; else None."""
    kind, shape = question.kind, np.shape(question.image)
    height, width = shape[:2]
    if kind == "mask":
        sound = answer.shape == (height, width) and answer.dtype == bool
        return None if sound else f"expected bool of {(height, width)}, got {answer.dtype} of {answer.shape}"
    if kind == "inpainting":
        sound = answer.shape == shape and np.isfinite(answer).all()
        return None if sound else f"expected finite values of shape {shape}, got others or {answer.shape}"
    return find_fault(kind, answer, height, width) or _fault_of_values(kind, answer)


def _fault_of_values(kind: ImageKind, answer: np.ndarray) -> str | None:
    """Values that no depth, normal or share can have."""
    if kind == "depth" and answer.min() <= 0:
        return f"expected depth > 0, got {answer.min():.4g}"
    if kind == "normal":
        lengths = np.linalg.norm(answer, axis=-1)
        if (np.minimum(lengths, np.abs(lengths - 1)) > 1e-3).any():
            return f"expected normals of length 1 (0 where there is nothing), got {lengths.max():.4g}"
    if kind in FRACTIONS and (answer.min() < 0 or answer.max() > 1):
        return f"expected {kind} in [0, 1], got {answer.min():.4g} to {answer.max():.4g}"
    return None
