# SPDX-License-Identifier: Apache-2.0
"""Lights, cameras, priors and guests as JSON and arrays, and strictly back."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from graycard import (
    Camera,
    Composition,
    EnvironmentLight,
    GraycardError,
    Light,
    MethodError,
    OutputError,
    View,
)
from graycard.io import from_builtins, to_builtins
from graycard.lights import light_from_json, light_to_json
from graycard.methods._blame import words_of
from graycard.methods._contract import Composed, Priors, Relit
from graycard.methods._priors import Ask, ImageKind, Lamp, PriorModel, Question
from graycard.methods.confined._frames import own_trace
from graycard.methods.priors import UnloadedNetwork

_LONGEST = 20_000
"""Characters of what a method says of an error."""
_IMAGE = "environment.exr"
"""Stands for the image of an environment, whose place is told beside it."""

Arrays = Mapping[str, np.ndarray]


@dataclass(frozen=True, slots=True)
class Parcel:
    """JSON data, and the arrays that it speaks of by name."""

    data: Any
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


def light_out(light: Light) -> dict[str, Any]:
    """Return a light as JSON data."""
    if not isinstance(light, EnvironmentLight):
        return {"light": light_to_json(light)}
    return {"light": light_to_json(replace(light, image=_IMAGE)), "image": str(light.image)}


def light_in(data: Any) -> Light:
    """Return the light that :func:`light_out` gave.

    Raises:
        MethodError: It is none.
    """
    light = light_from_json(data["light"], MethodError, "what a method says of its lights")
    return replace(light, image=str(data["image"])) if isinstance(light, EnvironmentLight) else light


def lights_out(lights: Sequence[Light] | None) -> Any:
    """Return lights as JSON data."""
    return None if lights is None else [light_out(light) for light in lights]


def lights_in(data: Any) -> tuple[Light, ...] | None:
    """Return lights that came as JSON data.

    Raises:
        MethodError: One is none.
    """
    return None if data is None else tuple(light_in(item) for item in data)


def camera_in(data: Any) -> Camera:
    """Return a camera that came as JSON data."""
    return from_builtins(Camera, data, MethodError, "a camera")


def ask_in(data: Any) -> Ask:
    """Return what a method asks for, as it came as JSON data."""
    return from_builtins(Ask, data, MethodError, "what a method asks for")


def priors_out(priors: Priors) -> Parcel:
    """Return what a method is handed, as JSON data and arrays; models stay where they are."""
    arrays: dict[str, np.ndarray] = {}

    def kept(values: np.ndarray) -> str:
        arrays[name := str(len(arrays))] = np.asarray(values)
        return name

    def all_kept(found: Arrays) -> dict[str, str]:
        return {name: kept(values) for name, values in found.items()}

    composed = priors.composition
    data = {
        "source": priors.source,
        "layers": {view: all_kept(found) for view, found in priors.layers.items()},
        "lights": lights_out(priors.lights),
        "environments": all_kept(priors.environments),
        "relighting": [[lights_out(r.lights), all_kept(r.radiance)] for r in priors.relighting],
        "composition": composed and [to_builtins(composed.composition), all_kept(composed.radiance)],
        "models": {kind: _network_out(model) for kind, model in sorted(priors.models.items())},
        "calibration": priors.calibration and light_out(priors.calibration),
    }
    return Parcel(data, arrays)


def priors_in(data: Any, arrays: Arrays, model: PriorModel) -> Priors:
    """Return what :func:`priors_out` gave, with a model that asks in place of those that answer."""

    def found(names: Mapping[str, str]) -> dict[str, np.ndarray]:
        return {name: arrays[key] for name, key in names.items()}

    composed, calibration = data["composition"], data["calibration"]
    return Priors(
        data["source"],
        {view: found(names) for view, names in data["layers"].items()},
        lights_in(data["lights"]),
        found(data["environments"]),
        tuple(Relit(lights_in(lights) or (), found(names)) for lights, names in data["relighting"]),
        composed and Composed(from_builtins(Composition, composed[0]), found(composed[1])),
        {kind: _network_in(kind, weights) or model for kind, weights in data["models"].items()},
        calibration and cast(Lamp, light_in(calibration)),
    )


def _network_out(model: PriorModel) -> str | None:
    """Return where the weights of a network are; None for what answers in this process."""
    return str(model.weights) if isinstance(model, UnloadedNetwork) else None


def _network_in(kind: str, weights: str | None) -> PriorModel | None:
    """Return the network of weights, loaded."""
    return None if weights is None else UnloadedNetwork(cast(ImageKind, kind), Path(weights)).load()


def question_out(question: Question) -> Parcel:
    """Return a question to a prior."""
    arrays = {"image": np.asarray(question.image)}
    if question.hole is not None:
        arrays["hole"] = question.hole
    return Parcel({"kind": question.kind, "view": to_builtins(question.view), "of": question.of}, arrays)


def question_in(data: Any, arrays: Arrays) -> Question:
    """Return a question that came from a method.

    Raises:
        MethodError: It is none.
    """
    view = from_builtins(View, data["view"], MethodError, "the view of a question")
    return Question(data["kind"], view, arrays["image"], str(data["of"]), arrays.get("hole"))


def text_out(text: str) -> str:
    """Return a text that a message can hold: no halves of surrogate pairs, which file names may have."""
    return text.encode(errors="replace").decode()


def shortened(text: str, longest: int = _LONGEST) -> str:
    """Return a text that a record or a terminal can take: the middle of a longer one is left out."""
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]} … {text[-half:]}"


class CodeOfOthersError(Exception):
    """The traceback of an error that another process met in code that is not graycard's."""

    def __str__(self) -> str:
        return f"\n{self.args[0]}"


def error_out(error: BaseException, own: tuple[str, ...] = ()) -> dict[str, str]:
    """Return an error as JSON data, with the traceback of its cause where that is not graycard's.

    Args:
        error: What was raised.
        own: Files and folders of the method's code: the traceback shows their lines alone, if there are any.
    """
    known = isinstance(error, GraycardError)
    words = words_of(error) if known else f"{type(error).__name__}: {words_of(error)}"
    foreign = error.__cause__ if known else error
    trace = "" if isinstance(foreign, GraycardError | None) else own_trace(foreign, own)
    return {"error": type(error).__name__, "words": words, "trace": text_out(trace)}


def error_in(data: Any) -> GraycardError:
    """Return the error that :func:`error_out` gave; one that is not graycard's is a MethodError.

    So is an OutputError: that of a run would end all its jobs, and a method is no judge of its disk.
    """
    kinds = {kind.__name__: kind for kind in _kinds_of(GraycardError) if not issubclass(kind, OutputError)}
    kind = kinds.get(str(data["error"]), MethodError)
    error = kind.__new__(kind)
    error.args = (shortened(str(data["words"])),)
    if data["trace"]:
        error.__cause__ = CodeOfOthersError(shortened(str(data["trace"])))
    return error


def _kinds_of(kind: type[GraycardError]) -> Iterator[type[GraycardError]]:
    yield kind
    for below in kind.__subclasses__():
        yield from _kinds_of(below)
