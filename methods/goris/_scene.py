# SPDX-License-Identifier: Apache-2.0
"""The decomposition of ``goris``: surfels, of which glossy ones reflect traced radiance, with and without the
object.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch

from graycard import Camera, Light, MethodError
from graycard.io import from_builtins as decode_json
from graycard.io import to_builtins
from graycard.methods._contract import Decomposition, check_layers
from graycard.methods._store import restore, store
from graycard.methods.goris._model import BRIGHTEST, DIFFUSE, REGION, Picture, drawn_buffers, picture_of
from graycard.methods.goris._remove import RemovalMasks
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.removal import Emptied
from graycard.methods.splat import SH_DC, Parameters, arrays_of, parameters_from
from graycard.methods.surfels import (
    COEFFICIENTS,
    DETAIL,
    SurfelScene,
    decode,
    depth_layer,
    export_colours,
    normal_layer,
    sky_basis,
)

METHOD = "goris"
LAYERS = frozenset({"radiance", "diffuse", "specular", "f0", "roughness", "glossy", "normal", "depth"})
"""Layers that it provides."""
_BEFORE, _AFTER, _DISTILLED = "before/", "after/", "distilled/"
_DOUBTED, _UNSEEN = "doubted/", "unseen/"


@dataclass(frozen=True, eq=False)
class GlossyScene:
    """Surfels with light transport, of which some are glossy."""

    parameters: Parameters
    settings: GorisSettings
    exposure: float
    """Factor from radiance to the range of the fit, 1/(W/m²/sr)."""
    extent: float
    """Of the scene, metres."""

    @property
    def provides(self) -> frozenset[str]:
        """Radiance and its diffuse and specular parts, materials and geometry."""
        return LAYERS

    @torch.no_grad()
    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Layers as any camera sees them.

        Rough surfaces are all diffuse: in proportion ``specular`` is 0 there, ``roughness`` 1 and ``f0`` 0.
        Where surfels cover less than half of a pixel its depth is +inf; where there is none at all, its
        normal faces the camera.

        Raises:
            MethodError: A layer is not provided.
        """
        check_layers(layers, self.provides)
        values, sky = self.parameters.all, sky_basis(camera, self.settings.sky_degree)
        buffers = drawn_buffers(values, camera, sky, self.settings)
        found = self._layers(picture_of(values, buffers, self.settings, self.extent))
        found |= {"normal": normal_layer(buffers.drawn, camera), "depth": depth_layer(buffers.drawn)}
        return {name: found[name] for name in layers}

    def _layers(self, picture: Picture) -> dict[str, np.ndarray]:
        """All but geometry."""
        buffers, share = picture.buffers, picture.buffers.glossy[..., None]
        rough = decode(buffers.rough)
        specular = share * picture.reflected
        diffuse = (
            rough if self.settings.composite == "paper" else share * buffers.diffuse + (1 - share) * rough
        )
        radiant = {"radiance": decode(picture.encoded), "diffuse": diffuse, "specular": specular}
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

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        store(folder, METHOD, self._facts, arrays_of(self.parameters))

    @property
    def _facts(self) -> dict[str, object]:
        return {"settings": to_builtins(self.settings), "exposure": self.exposure, "extent": self.extent}


class DistilledScene(SurfelScene):
    """The result as radiance alone: its surfels lie where colours need them, behind mirrors, too."""

    @property
    def provides(self) -> frozenset[str]:
        """Radiance: its normals and depths would be those of reflections."""
        return frozenset({"radiance"})


@dataclass(frozen=True, eq=False)
class GorisScene(Emptied):
    """Surfels with the object, and without it and its reflection."""

    before: GlossyScene
    after: GlossyScene
    distilled: DistilledScene | None = None
    """``after`` as radiance alone; None: rays are traced."""
    changed: Mapping[str, RemovalMasks] = field(default_factory=dict)
    """What the removal changed, by the name of each training view; empty where an older graycard saved it."""

    def remove(self, object_id: int) -> Decomposition:
        """The scene without the object and its reflection.

        Raises:
            MethodError: It is another object than the one that the capture names.
        """
        left = super().remove(object_id)
        return left if self.distilled is None else self.distilled

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON, and what is left as a PLY that viewers of Gaussian splats read.

        Viewers trace no rays: the PLY has radiance alone, of glossy surfaces the diffuse one. The colours of
        their radiance-only steps would still show the reflection of the object.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        parts = {_BEFORE: self.before.parameters, _AFTER: self.after.parameters}
        if self.distilled is not None:
            parts[_DISTILLED] = self.distilled.parameters
        arrays = {part + name: a for part, p in parts.items() for name, a in arrays_of(p).items()}
        arrays |= {_DOUBTED + view: masks.doubted for view, masks in self.changed.items()}
        arrays |= {_UNSEEN + view: masks.unseen for view, masks in self.changed.items()}
        store(folder, METHOD, {**self.before._facts, "target": self.target}, arrays)
        export_colours(folder, parts[_DISTILLED] if self.distilled is not None else _scattered(self.after))


def _scattered(scene: GlossyScene) -> Parameters:
    """Surfels with radiance alone, which for glossy ones is their diffuse radiance."""
    own = dict(scene.parameters.surfels)
    glossy = own[REGION][:, 0] < 0
    even = (BRIGHTEST * own[DIFFUSE].sigmoid() - 0.5) / SH_DC
    own[COEFFICIENTS] = torch.where(glossy[:, None, None], even[:, None].float(), own[COEFFICIENTS])
    own[DETAIL] = torch.where(glossy[:, None, None], 0.0, own[DETAIL])
    return Parameters(own, scene.parameters.shared)


def load_scene(folder: Path) -> GorisScene:
    """A scene that was saved.

    Raises:
        MethodError: It is missing, damaged, or of another method.
    """
    facts, arrays = restore(folder, METHOD)
    settings = decode_json(GorisSettings, facts["settings"], MethodError, "settings")
    exposure, extent = float(facts["exposure"]), float(facts["extent"])

    def parameters(part: str) -> Parameters:
        return parameters_from({k.removeprefix(part): a for k, a in arrays.items() if k.startswith(part)})

    before, after = (GlossyScene(parameters(part), settings, exposure, extent) for part in (_BEFORE, _AFTER))
    colours = DistilledScene(METHOD, parameters(_DISTILLED), exposure) if settings.distilled else None
    views = sorted(name.removeprefix(_DOUBTED) for name in arrays if name.startswith(_DOUBTED))
    changed = {view: RemovalMasks(arrays[_DOUBTED + view], arrays[_UNSEEN + view]) for view in views}
    return GorisScene(before, after, int(facts["target"]), colours, changed)
