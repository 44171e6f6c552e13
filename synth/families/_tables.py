# SPDX-License-Identifier: Apache-2.0
"""The families of the tabletop track: one for each kind of surface."""

from dataclasses import dataclass
from typing import ClassVar

from graycard.synth._scene import MATERIALS, Color, Material, Matte, Texture, polished
from graycard.synth._spectra import scaled
from graycard.synth._stream import stream
from graycard.synth.families._family import choice, knob
from graycard.synth.families._tabletop import PolishedTabletop, Tabletop
from graycard.synth.families.props import _textures as textures
from graycard.synth.families.props._metals import METALS, conductor
from graycard.synth.families.props._table_surfaces import Dome, Flat, Surface


@dataclass(frozen=True, slots=True)
class GlossyTable(PolishedTabletop):
    """A table of lacquered wood."""

    name: ClassVar[str] = "glossy-table"
    title: ClassVar[str] = "objects on a lacquered wooden table by a window; the tallest is to be removed"

    def surface(self) -> Surface:
        """Flat."""
        return Flat()

    def finish(self, seed: int) -> Material:
        """Walnut, oak or cherry."""
        rng = stream(seed, "table")
        tone = ((0.20, 0.085, 0.04), (0.13, 0.10, 0.075), (0.26, 0.15, 0.07))[rng.integers(3)]
        return polished(self.material, Texture(textures.wood(rng, tone), (1.3, 1.3)), self.roughness)


@dataclass(frozen=True, slots=True)
class MetalTable(PolishedTabletop):
    """A table of aluminium, copper or gold."""

    material: str = choice(*MATERIALS, "roughconductor")
    """Material: what all that shines is made of; ``roughconductor`` is a metal of measured refractive
    index, whose Fresnel reflectance is none that inverse renderers assume, under glazes of the default
    material."""

    name: ClassVar[str] = "metal-table"
    title: ClassVar[str] = "objects on a metal table by a window; the tallest is to be removed"

    def surface(self) -> Surface:
        """Flat."""
        return Flat()

    def finish(self, seed: int) -> Material:
        """Brushed, of a colour a little below that of the pure metal; as a conductor without hairlines."""
        rng = stream(seed, "table")
        pure = conductor(METALS[rng.integers(len(METALS))], self.roughness)
        if self.material == "roughconductor":
            return pure
        hairlines = Texture(textures.brushed(rng, scaled(pure.f0, 0.75)), (1.1, 1.1))
        return polished(self.material, hairlines, self.roughness, metallic=1.0)


@dataclass(frozen=True, slots=True)
class MarbleTable(PolishedTabletop):
    """A table of polished marble."""

    name: ClassVar[str] = "marble-table"
    title: ClassVar[str] = "objects on a polished marble table by a window; the tallest is to be removed"

    def surface(self) -> Surface:
        """Flat."""
        return Flat()

    def finish(self, seed: int) -> Material:
        """White, green or black marble."""
        rng = stream(seed, "table")
        kinds = (
            ((0.55, 0.53, 0.50), (0.20, 0.20, 0.21)),
            ((0.06, 0.16, 0.11), (0.42, 0.48, 0.42)),
            ((0.035, 0.035, 0.04), (0.45, 0.42, 0.36)),
        )
        ground, vein = kinds[rng.integers(len(kinds))]
        pixels = textures.marble(rng, ground, vein)
        return polished(self.material, Texture(pixels, (0.9, 0.9)), self.roughness)


@dataclass(frozen=True, slots=True)
class CurvedTable(PolishedTabletop):
    """A round table whose glazed top bulges: each point of it mirrors another part of the room."""

    curvature: float = knob(0.65, 0.1, 1.0)
    """Curvature of the top: one over its radius, 1/m."""

    name: ClassVar[str] = "curved-table"
    title: ClassVar[str] = "objects on a bulging, glazed round table; the tallest is to be removed"

    def surface(self) -> Surface:
        """Return a cap of a sphere."""
        return Dome(self.curvature)

    def finish(self, seed: int) -> Material:
        """Ceramic: celadon, iron red or slate."""
        rng = stream(seed, "table")
        kinds = (
            [(0.10, 0.20, 0.16), (0.20, 0.33, 0.26), (0.32, 0.42, 0.34)],
            [(0.11, 0.035, 0.02), (0.24, 0.075, 0.035), (0.34, 0.16, 0.08)],
            [(0.05, 0.06, 0.075), (0.11, 0.125, 0.145), (0.22, 0.23, 0.24)],
        )
        pixels = textures.stone(rng, kinds[rng.integers(len(kinds))])
        return polished(self.material, Texture(pixels, (0.8, 0.8)), self.roughness)


@dataclass(frozen=True, slots=True)
class MatteTable(Tabletop):
    """A table with a cloth on it: nothing in the scene shines."""

    name: ClassVar[str] = "matte-table"
    title: ClassVar[str] = (
        "objects on a table with a linen cloth, all of it matte; the tallest is to be removed"
    )

    def surface(self) -> Surface:
        """Flat."""
        return Flat()

    def finish(self, seed: int) -> Material:
        """Return checked linen."""
        rng = stream(seed, "table")
        tones = [(0.45, 0.40, 0.32), (0.40, 0.12, 0.10), (0.14, 0.19, 0.28)]
        cloth = textures.linen(rng, tones[rng.integers(len(tones))], (0.56, 0.54, 0.49))
        return Matte(Texture(cloth, (2.5, 2.5)))

    def glaze(self, color: Color) -> Material:
        """Unglazed."""
        return Matte(color)
