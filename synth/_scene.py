# SPDX-License-Identifier: Apache-2.0
"""A scene as plain data: shapes, materials, lights and cameras, before any renderer is involved."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from graycard import Light, RectangleLight, SceneObject, SphereLight, View
from graycard.synth._mesh import Mesh

Vector = tuple[float, float, float]

_NAME = re.compile(r"[\w-]+")
_TAKEN = ("var", "half_a", "half_b")
"""Suffixes of the layers of an estimate."""


def triple(values: np.ndarray) -> Vector:
    """Three numbers as a plain vector or colour."""
    x, y, z = values.tolist()
    return x, y, z


@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """A colour that varies over a surface."""

    pixels: np.ndarray
    """Shape ``(H, W, 3)``, linear Rec.709 reflectance; tiles in both directions."""
    repeat: tuple[float, float] = (1.0, 1.0)
    """Repetition: how often it is repeated for one unit of u and of v."""
    smooth: bool = True
    """Bilinear; else nearest, for colours that must not mix."""


Color = Vector | Texture


@dataclass(frozen=True, slots=True, eq=False)
class Matte:
    """A Lambertian surface."""

    color: Color


@dataclass(frozen=True, slots=True, eq=False)
class Glossy:
    """The Disney principled material (Burley 2012), GGX alpha = roughness squared."""

    color: Color
    roughness: float
    metallic: float = 0.0
    specular: float = 0.5
    """Reflectance at normal incidence of the dielectric part is 0.08 times this."""


@dataclass(frozen=True, slots=True, eq=False)
class LambertGGX:
    """A Lambertian and a GGX lobe with Schlick's Fresnel: the material that inverse renderers assume.

    f0 = 0.04 (1 - metallic) + metallic color; GGX alpha = roughness squared.
    """

    color: Color
    roughness: float
    metallic: float = 0.0


@dataclass(frozen=True, slots=True)
class Conductor:
    """A rough metal with the measured, complex refractive index ``eta + i k`` of each channel.

    Outside the material that inverse renderers assume: its reflectance follows Fresnel's equations for
    conductors. GGX alpha = roughness squared.
    """

    eta: Vector
    k: Vector
    roughness: float

    @property
    def f0(self) -> Vector:
        """Reflectance at normal incidence (Fresnel): ``((eta - 1)² + k²) / ((eta + 1)² + k²)``."""
        pairs = zip(self.eta, self.k, strict=True)
        r, g, b = (((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2) for n, k in pairs)
        return r, g, b


Material = Matte | Glossy | LambertGGX | Conductor

MATERIALS = ("lambert-ggx", "principled")
"""Materials of surfaces that shine: the papers' own material, or Disney's, which is none of theirs."""


def polished(kind: str, color: Color, roughness: float, metallic: float = 0.0) -> Material:
    """Return a surface that shines, of one of the :data:`MATERIALS`."""
    if kind == "principled":
        return Glossy(color, roughness, metallic)
    return LambertGGX(color, roughness, metallic)


BLACK = Matte((0.0, 0.0, 0.0))
"""The surface of a light: it emits and reflects nothing, so its base colour is exactly 0."""


@dataclass(frozen=True, slots=True)
class Ball:
    """A sphere, exact."""

    center: Vector
    radius: float


@dataclass(frozen=True, slots=True)
class Quad:
    """A one-sided parallelogram, ``center ± half_u ± half_v``; it is seen from the side of u x v."""

    center: Vector
    half_u: Vector
    half_v: Vector


Geometry = Mesh | Ball | Quad


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """One object. Its id in ``object_id`` layers is its place in :attr:`Scene.things`, from 1."""

    name: str
    geometry: Geometry
    material: Material
    light: str = ""
    """Name of the light that its surface is; empty for what does not emit."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything that a renderer needs, and everything that the truth records.

    Raises:
        ValueError: Two lights have one name, or a light has one that cannot be part of a layer's name.
    """

    things: tuple[Thing, ...]
    lights: tuple[Light, ...]
    views: tuple[View, ...]
    sky: np.ndarray | None = None
    """Radiance of the environment on the sky grid (see :mod:`graycard.synth._sky`), W/m²/sr."""
    target: str = ""
    """Name of the thing that the removal task takes away."""
    light_weights: Mapping[str, float] = field(default_factory=dict)
    """Share of the light samples that a light is given, relative to 1: less noise, same mean."""

    def __post_init__(self) -> None:
        names = [light.name for light in self.lights]
        if len(set(names)) < len(names) or not all(_NAME.fullmatch(n) and n not in _TAKEN for n in names):
            raise ValueError(
                "expected each light once, its name of letters, digits, - and _ (layers are called "
                f"<part>.<light>) and not {' or '.join(_TAKEN)}, got {names}"
            )

    def id_of(self, name: str) -> int:
        """Return the object id of a thing.

        Raises:
            ValueError: There is no thing of that name.
        """
        names = [thing.name for thing in self.things]
        if name not in names:
            raise ValueError(f"expected a thing of the scene, got {name!r}: {', '.join(names)}")
        return names.index(name) + 1

    @property
    def target_id(self) -> int | None:
        """The object id of the target; None where there is none."""
        return self.id_of(self.target) if self.target else None

    def objects(self) -> tuple[SceneObject, ...]:
        """All objects with their ids."""
        return tuple(
            SceneObject(number, thing.name, bool(thing.light))
            for number, thing in enumerate(self.things, start=1)
        )


def surface_of(light: RectangleLight | SphereLight) -> Thing:
    """Return the object that is the surface of an area light."""
    match light:
        case RectangleLight():
            geometry: Geometry = Quad(light.position, light.half_u, light.half_v)
        case SphereLight():
            geometry = Ball(light.position, light.radius)
    return Thing(light.name, geometry, BLACK, light.name)
