# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``goris``: surfels, of which glossy ones reflect traced radiance, with and without the
object.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch

from graycard import Camera, Light, MethodError
from graycard.io import from_builtins as decode_json
from graycard.io import to_builtins
from graycard.methods._contract import Decomposition
from graycard.methods.goris._model import BRIGHTEST, DIFFUSE, REGION, GlossyPicture, drawn_buffers, picture_of
from graycard.methods.goris._remove import RemovalMasks
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.removal import Emptied
from graycard.methods.splat import SH_DC, Parameters, arrays_of, parameters_from
from graycard.methods.surfels import (
    COEFFICIENTS,
    DETAIL,
    LayeredScene,
    SavedScene,
    SceneContents,
    SurfelScene,
    depth_layer,
    export_colours,
    normal_layer,
    sky_basis,
    srgb_decode_tensor,
)

METHOD = "goris"
LAYERS = frozenset({"radiance", "diffuse", "specular", "f0", "roughness", "glossy", "normal", "depth"})
"""Layers that it provides."""
_BEFORE, _AFTER, _DISTILLED = "before/", "after/", "distilled/"
_DOUBTED, _UNSEEN = "doubted/", "unseen/"


@dataclass(frozen=True, eq=False)
class GlossyScene(LayeredScene):
    """Surfels with light transport, of which some are glossy."""

    settings: GorisSettings
    exposure: float
    """Factor from radiance to the range of the fit, 1/(W/m²/sr)."""
    extent: float
    """Extent of the scene, metres."""

    @property
    def provides(self) -> frozenset[str]:
        """Radiance and its diffuse and specular parts, materials and geometry."""
        return LAYERS

    def _images(self, camera: Camera, layers: Sequence[str]) -> Mapping[str, np.ndarray]:
        """Render all layers; rough surfaces are all diffuse.

        In proportion ``specular`` is 0 there, ``roughness`` 1 and ``f0`` 0.
        """
        values, sky = self.parameters.all, sky_basis(camera, self.settings.sky_degree)
        buffers = drawn_buffers(values, camera, sky, self.settings)
        found = self._layers(picture_of(values, buffers, self.settings, self.extent))
        return found | {"normal": normal_layer(buffers.drawn, camera), "depth": depth_layer(buffers.drawn)}

    def _layers(self, picture: GlossyPicture) -> dict[str, np.ndarray]:
        """All but geometry."""
        buffers, share = picture.buffers, picture.buffers.glossy[..., None]
        rough = srgb_decode_tensor(buffers.rough)
        specular = share * picture.reflected
        diffuse = (
            rough if self.settings.composite == "paper" else share * buffers.diffuse + (1 - share) * rough
        )
        radiant = {"radiance": srgb_decode_tensor(picture.encoded), "diffuse": diffuse, "specular": specular}
        found = {name: (image.clamp(min=0) / self.exposure) for name, image in radiant.items()}
        found |= {
            "f0": share * buffers.f0,
            "roughness": 1 - buffers.glossy * (1 - buffers.roughness),
            "glossy": buffers.glossy.clamp(0, 1),
        }
        return {name: image.numpy() for name, image in found.items()}

    def lights(self) -> tuple[Light, ...] | None:
        """None: it estimates none."""
        return None

    def _contents(self) -> SceneContents:
        return SceneContents(METHOD, self.facts, arrays_of(self.parameters))

    @classmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        settings = decode_json(GorisSettings, saved.facts["settings"], MethodError, "settings")
        exposure, extent = float(saved.facts["exposure"]), float(saved.facts["extent"])
        return cls(parameters_from(saved.arrays), settings, exposure, extent)

    def _export(self, path: Path) -> None:
        """Write radiance alone, as viewers trace no rays: of glossy surfaces the diffuse one.

        The colours of their radiance-only steps would still show the reflection of the object.
        """
        export_colours(path, _scattered(self))

    @property
    def facts(self) -> dict[str, Any]:
        """JSON data that is saved beside the parameters."""
        return {"settings": to_builtins(self.settings), "exposure": self.exposure, "extent": self.extent}


class DistilledScene(SurfelScene):
    """The result as radiance alone: its surfels lie where colours need them, behind mirrors, too."""

    @property
    def provides(self) -> frozenset[str]:
        """Radiance: its normals and depths would be those of reflections."""
        return frozenset({"radiance"})


@dataclass(frozen=True, eq=False)
class GorisScene(Emptied, SavedScene):
    """Surfels with the object, and without it and its reflection."""

    before: GlossyScene
    after: GlossyScene
    distilled: DistilledScene | None = None
    """``after`` as radiance alone; None: rays are traced."""
    changed: Mapping[str, RemovalMasks] = field(default_factory=dict)
    """Effect of the removal, by the name of each training view; empty where an older graycard saved it."""

    def remove(self, object_id: int) -> Decomposition:
        """Return the scene without the object and its reflection.

        Raises:
            MethodError: It is another object than the one that the capture names.
        """
        left = super().remove(object_id)
        return left if self.distilled is None else self.distilled

    def _contents(self) -> SceneContents:
        parts = {_BEFORE: self.before.parameters, _AFTER: self.after.parameters}
        if self.distilled is not None:
            parts[_DISTILLED] = self.distilled.parameters
        arrays = {part + name: a for part, p in parts.items() for name, a in arrays_of(p).items()}
        arrays |= {_DOUBTED + view: masks.doubted for view, masks in self.changed.items()}
        arrays |= {_UNSEEN + view: masks.unseen for view, masks in self.changed.items()}
        return SceneContents(METHOD, {**self.before.facts, "target": self.target}, arrays)

    @classmethod
    def _restored(cls, saved: SceneContents, folder: Path) -> Self:
        def part(name: str) -> SceneContents:
            own = {k.removeprefix(name): a for k, a in saved.arrays.items() if k.startswith(name)}
            return saved._replace(arrays=own)

        before, after = (GlossyScene._restored(part(name), folder) for name in (_BEFORE, _AFTER))
        colours = DistilledScene._restored(part(_DISTILLED), folder) if before.settings.distilled else None
        doubted, unseen = part(_DOUBTED).arrays, part(_UNSEEN).arrays
        changed = {view: RemovalMasks(doubted[view], unseen[view]) for view in sorted(doubted)}
        return cls(before, after, int(saved.facts["target"]), colours, changed)

    def _export(self, path: Path) -> None:
        """Write what is left."""
        (self.after if self.distilled is None else self.distilled)._export(path)


def _scattered(scene: GlossyScene) -> Parameters:
    """Surfels with radiance alone, which for glossy ones is their diffuse radiance."""
    own = dict(scene.parameters.surfels)
    glossy = own[REGION][:, 0] < 0
    even = (BRIGHTEST * own[DIFFUSE].sigmoid() - 0.5) / SH_DC
    own[COEFFICIENTS] = torch.where(glossy[:, None, None], even[:, None].float(), own[COEFFICIENTS])
    own[DETAIL] = torch.where(glossy[:, None, None], 0.0, own[DETAIL])
    return Parameters(own, scene.parameters.shared)
