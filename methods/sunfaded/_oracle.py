# SPDX-License-Identifier: Apache-2.0
"""``sunfaded-oracle``: its two lights alone, on surfaces that are known: how far its model of light gets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from graycard import Camera, Capture, Light, MethodError, Progress
from graycard.methods._contract import Priors, check_layers
from graycard.methods._store import restore, store, whole_decomposition
from graycard.methods.splat import Maps, view_at
from graycard.methods.sunfaded._layers import Lighting, local_lights
from graycard.methods.sunfaded._light import POSITION
from graycard.methods.sunfaded._model import AMBIENT, picture_of
from graycard.methods.sunfaded._objective import DisplayedPhotograph, displayed, photographs
from graycard.methods.sunfaded._scene import lighting_from_json, lighting_to_json
from graycard.methods.sunfaded._settings import LightMap, Space, SunFadedSettings
from graycard.methods.sunfaded._start import DARKEST, check_capture, first_lights
from graycard.methods.surfels import srgb_encode_tensor

METHOD = "sunfaded-oracle"
RATE, PLACE_RATE, LAST = 5e-3, 2.5e-2, 0.005
"""Learning rates of the network and the ambient light, twice that of ``sunfaded``, and of the lamp's place,
metres; and the share of them that is left in the end: photographs are fitted as closely as can be."""
EPSILON = 1e-15
"""Epsilon of Adam, as for surfels: a lamp that is nearly out has small gradients, and must find back."""
_BUFFER = ("base_color", "normal", "depth")
_SHARED = "lights"


@dataclass(frozen=True, slots=True)
class OracleSunFadedSettings:
    """Settings of ``sunfaded-oracle``: those of ``sunfaded`` that are about light."""

    iterations: int = 2000
    space: Space = "linear"
    light_map: LightMap = "bilinear"
    tile: float = 1 / 64
    ambient: bool = True

    def __post_init__(self) -> None:
        """Check the ranges."""
        self.whole()

    def whole(self) -> SunFadedSettings:
        """Return the same for the model, whose other settings are about surfels."""
        return SunFadedSettings(
            iterations=self.iterations, space=self.space, light_map=self.light_map, tile=self.tile,
            ambient=self.ambient,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class OracleSunFadedScene:
    """True surfaces as the capture's cameras see them, and the two lights that were fitted to photographs."""

    surfaces: Mapping[str, Mapping[str, np.ndarray]]
    """By the digest of the camera: true ``base_color``, ``normal`` and ``depth``."""
    values: Mapping[str, torch.Tensor]
    """Parameters of the lights by name."""
    lighting: Lighting

    @property
    def provides(self) -> frozenset[str]:
        """Picture, albedo, geometry; see :attr:`Lighting.provides`."""
        return self.lighting.provides

    @torch.no_grad()
    def render(self, camera: Camera, layers: Sequence[str]) -> dict[str, np.ndarray]:
        """Layers as a camera of the capture sees them.

        Raises:
            MethodError: The camera is none of the capture's, or a layer is not provided.
        """
        check_layers(layers, self.provides)
        if camera.digest not in self.surfaces:
            raise MethodError(
                f"expected one of the {len(self.surfaces)} cameras of the capture, got another: the true "
                "surfaces are known as those see them"
            )
        drawn = as_drawn(self.surfaces[camera.digest], self.lighting.settings.space)
        return self.lighting.layers(layers, drawn, self.values, camera)

    @torch.no_grad()
    def lights(self) -> tuple[Light, ...] | None:
        """Return the lamp, as a point light; see :meth:`Lighting.lights`."""
        return self.lighting.lights(self.values)

    def relight(self, lights: tuple[Light, ...]) -> "OracleSunFadedScene | None":
        """Return the true surfaces under given lights; None for surroundings."""
        given = local_lights(lights)
        return None if given is None else replace(self, lighting=replace(self.lighting, given=given))

    def save(self, folder: Path) -> None:
        """Write as safetensors and JSON.

        Raises:
            OutputError: The folder cannot be written to, or the disk is full.
        """
        arrays = {f"{key}/{name}": a for key, known in self.surfaces.items() for name, a in known.items()}
        arrays |= {f"{_SHARED}/{name}": v.numpy() for name, v in self.values.items()}
        store(folder, METHOD, lighting_to_json(self.lighting), arrays)


class OracleSunFadedMethod:
    """Fits lamp and ambient light to photographs of surfaces that are known, with albedo, in every view.

    It sees the truth, so it is a reference row: what is missing here is shadows and light from wall to wall,
    which the model of the light cannot say. It is no bound of novel views, for ``sunfaded`` may put these
    into an albedo that is free.
    """

    summary = "the lights of sunfaded, fitted on the true albedo, normals and depth"
    needs = _BUFFER
    settings_type = OracleSunFadedSettings

    def fit(
        self,
        capture: Capture,
        priors: Priors,
        settings: OracleSunFadedSettings,
        seed: int,
        progress: Progress,
    ) -> OracleSunFadedScene:
        """Fit both lights to the training photographs.

        Raises:
            MethodError: The light is not on the camera, the photographs are black or not finite, or the
                truth was not handed in.
        """
        check_capture(capture)
        whole = settings.whole()
        surfaces = {
            view.camera.digest: {name: priors.layer(view.name, name) for name in _BUFFER}
            for view in capture.views
        }
        views = photographs(capture, whole)
        drawn = [as_drawn(surfaces[view.camera.digest], settings.space) for view in views]
        values = fit_lights(drawn, views, whole, seed, progress)
        reach = np.median([_ahead(surfaces[view.camera.digest]["depth"]) for view in views])
        return OracleSunFadedScene(surfaces, values, Lighting(whole, capture.exposure, float(reach)))

    def load(self, folder: Path) -> OracleSunFadedScene:
        """Return a saved decomposition.

        Raises:
            MethodError: It is missing, damaged, or of another method.
        """
        with whole_decomposition(folder):
            facts, arrays = restore(folder, METHOD)
            known: dict[str, dict[str, np.ndarray]] = {}
            for key, values in arrays.items():
                owner, _, name = key.partition("/")
                known.setdefault(owner, {})[name] = values
            lights = {name: torch.from_numpy(v.copy()) for name, v in known.pop(_SHARED).items()}
            found = OracleSunFadedScene(known, lights, lighting_from_json(facts))
            _check(found)
            return found


@torch.no_grad()
def _check(scene: OracleSunFadedScene) -> None:
    """Refuse surfaces and lights that cannot be drawn.

    Raises:
        ValueError: Buffers of a camera are of several sizes. What is missing raises KeyError, and lights of
            other shapes whatever PyTorch says.
    """
    for known in scene.surfaces.values():
        height, width = known["depth"].shape
        shapes = {name: known[name].shape for name in _BUFFER}
        if shapes != {
            "base_color": (height, width, 3),
            "normal": (height, width, 3),
            "depth": (height, width),
        }:
            raise ValueError(f"buffers of the shapes {shapes}")
    first = next(iter(scene.surfaces.values()))
    height, width = first["depth"].shape
    drawn = as_drawn(first, scene.lighting.settings.space)
    camera = Camera.from_fov(width, height, 60.0, np.eye(4))
    scene.lighting.layers(sorted(scene.provides), drawn, scene.values, camera)


def fit_lights(
    drawn: Sequence[Maps], views: Sequence[DisplayedPhotograph], settings: SunFadedSettings, seed: int,
    progress: Progress,
) -> dict[str, torch.Tensor]:  # fmt: skip
    """Parameters of the lamp and of the light that stays, fitted as the second stage of ``sunfaded`` does.

    Unlike there the light that stays moves too, for nobody has found it before.

    Args:
        drawn: Surfaces, one a view.
        views: Photographs.
        settings: Of the model, and ``iterations``.
        seed: Of the network's start and of the order of views.
        progress: Called now and then.
    """
    albedo = torch.stack([maps.features.mean(dim=(0, 1)) for maps in drawn]).mean(dim=0)
    values = first_lights(views, albedo.clamp(min=DARKEST), settings, seed)
    moving = [name for name in values if settings.ambient or name != AMBIENT]
    for name in moving:
        values[name].requires_grad_()
    groups = [{"params": [values[n]], "lr": PLACE_RATE if n == POSITION else RATE} for n in moving]
    optimiser = torch.optim.Adam(groups, eps=EPSILON)
    slower = torch.optim.lr_scheduler.ExponentialLR(optimiser, LAST ** (1 / settings.iterations))
    for step in range(settings.iterations):
        progress(step / settings.iterations, "fitting the lights")
        number = view_at(step, len(views), seed)
        view = views[number]
        picture = picture_of(drawn[number], values, view.camera, view.lens, settings).whole
        loss = (displayed(picture, settings.space) - view.shown).abs().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        slower.step()
    return {name: v.detach() for name, v in values.items()}


def as_drawn(surfaces: Mapping[str, np.ndarray], space: Space) -> Maps:
    """Return true surfaces as if surfels had been drawn: opaque where something is seen.

    Args:
        surfaces: ``base_color`` and ``normal``, shape ``(H, W, 3)``, and ``depth``, ``(H, W)``.
        space: Of the albedo in the result.
    """
    depth = torch.from_numpy(np.asarray(surfaces["depth"], np.float32))
    albedo = torch.from_numpy(np.asarray(surfaces["base_color"], np.float32)).clamp(0, 1)
    normal = torch.from_numpy(np.asarray(surfaces["normal"], np.float32))
    seen = torch.isfinite(depth)
    alpha, depth = seen.float(), torch.where(seen, depth, 0.0)
    albedo = (albedo if space == "linear" else srgb_encode_tensor(albedo)) * alpha[..., None]
    return Maps(albedo, alpha, depth, depth, normal * alpha[..., None], torch.zeros_like(depth))


def _ahead(depth: np.ndarray) -> float:
    """Depth in the middle of a picture, metres; a metre where there is nothing."""
    middle = float(depth[depth.shape[0] // 2, depth.shape[1] // 2])
    return middle if np.isfinite(middle) else 1.0
