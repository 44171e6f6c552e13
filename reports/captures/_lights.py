# SPDX-License-Identifier: Apache-2.0
"""The lights that methods found in an imported capture, of which nobody knows the truth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from graycard import EnvironmentLight, GraycardError, Light
from graycard.reports._evidence import MethodEvidence
from graycard.reports._format import format_vector
from graycard.reports.plan._light_pairs import local_lights

MOST_LIGHTS = 20
"""Lights of one method that are listed; more are counted."""
_KINDS = {
    "PointLight": "point", "SpotLight": "spot", "GaussianLight": "lobes", "RectangleLight": "rectangle",
    "SphereLight": "sphere", "EnvironmentLight": "environment",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class FoundLight:
    """A light, or in words what stands in the place of lights."""

    method: str
    name: str
    kind: str = ""
    place: str = ""
    intensity: str = ""


def found_lights(methods: Sequence[MethodEvidence]) -> tuple[FoundLight, ...]:
    """Return the lights of all methods that provide some, brightest first, or why they cannot be read."""
    return tuple(light for method in methods for light in _of_method(method))


def _of_method(method: MethodEvidence) -> Iterator[FoundLight]:
    try:
        lights = method.predictions.lights() if method.predictions else None
    except GraycardError as fault:
        yield FoundLight(method.method, f"cannot be read: {fault}")
        return
    if lights is None:
        return
    local = sorted(local_lights(lights), key=lambda light: -float(light.axial_intensity.sum()))
    ordered: list[Light] = [*local, *(light for light in lights if isinstance(light, EnvironmentLight))]
    if not ordered:
        yield FoundLight(method.method, "no light")
    yield from (_found(method.method, light) for light in ordered[:MOST_LIGHTS])
    if len(ordered) > MOST_LIGHTS:
        yield FoundLight(method.method, f"{len(ordered) - MOST_LIGHTS} more")


def _found(method: str, light: Light) -> FoundLight:
    kind = _KINDS[type(light).__name__]
    if isinstance(light, EnvironmentLight):
        return FoundLight(method, light.name, kind, "infinitely far away")
    where = format_vector(light.position) + (" on the camera" if light.frame == "camera" else "")
    return FoundLight(method, light.name, kind, where, format_vector(light.axial_intensity))
