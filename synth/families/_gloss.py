# SPDX-License-Identifier: Apache-2.0
"""Gloss: which objects shine in a family in which a share of the objects does."""

from graycard.synth._scene import Color, Material, Matte, polished
from graycard.synth._stream import stream

BRASS = (0.60, 0.44, 0.20)


class PartlyGlossy:
    """Materials of a family with the knobs ``gloss``, ``metal_roughness`` and ``material``."""

    __slots__ = ()

    gloss: float
    metal_roughness: float
    material: str

    def surface(self, seed: int, name: str, color: Color, roughness: float) -> Material:
        """Return the material of an object: shining if the seed has it among the share of ``gloss``."""
        if stream(seed, f"gloss of {name}").random() < self.gloss:
            return polished(self.material, color, roughness)
        return Matte(color)

    def metal(self, color: Color = BRASS) -> Material:
        """Return the material of what is made of metal; at a ``gloss`` of 0 it is matte too."""
        return polished(self.material, color, self.metal_roughness, 1.0) if self.gloss else Matte(color)
