# SPDX-License-Identifier: Apache-2.0
"""The second stage: the object is removed, what was behind it is inpainted, and the rest is kept."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from graycard import Camera, Capture, Progress
from graycard.io import Room
from graycard.methods._contract import Priors
from graycard.methods._tensors import float_tensor
from graycard.methods.goris._appearance import appearance_loss, box_around
from graycard.methods.goris._fit import FittedLight, light_rates, own_stage
from graycard.methods.goris._model import (
    BRIGHTEST,
    DIFFUSE,
    FRESNEL,
    LABEL,
    REGION,
    RESIDUAL,
    ROUGHNESS,
    SURROUNDINGS,
    GlossyPicture,
    drawn_buffers,
    effect_of,
    picture_of,
)
from graycard.methods.goris._objective import screen_offsets, surface_loss, watched
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.goris._shadow import without_shadow
from graycard.methods.goris._training_views import LAYERS, TrainingView, tiles_of
from graycard.methods.removal import (
    BackgroundPoints,
    RenderedView,
    Target,
    check_some,
    choice_of,
    hull_holes,
    targets_of,
    views_behind,
    wall_surfels,
    widened,
    with_hull,
)
from graycard.methods.splat import (
    CENTRES,
    Checkpoint,
    DensityRules,
    LossResult,
    Parameters,
    TrainConfig,
    Window,
    initial_state,
    joined_surfels,
    photometric_map,
    scene_extent,
    share_inside,
    surfels_of,
    train,
    view_at,
)
from graycard.methods.surfels import (
    SKY,
    density_rules,
    depth_layer,
    sky_basis,
    srgb_decode_tensor,
    srgb_encode_tensor,
    with_colours,
)

MOST_DOUBTFUL = 0.5
"""Share of a glossy surfel's blending weights in the photographs within the widened masks of the object,
beyond which it is removed with the object."""
_FIRST_DENSIFIED = 1 / 8
"""Share of the removal's steps after which densification begins (GOR-IS: 500 of 4,000)."""
_SURE = 1e-3
"""Inpainted shares keep this far from 0 and 1, whose logits are infinite."""
_GLOSSY = 0.5
"""Glossy share of an inpainted pixel from which on it is inpainted as a material."""


@dataclass(frozen=True, eq=False)
class RemovalMasks:
    """Effect of a removal on a training view; H x W pixels."""

    doubted: np.ndarray
    """Shape ``(H, W)``, bool: the photograph is masked out, as it shows the object, what is next to it, or
    the object by way of a glossy surface (the paper's lighting-aware mask)."""
    unseen: np.ndarray
    """Shape ``(H, W)``, bool: part of ``doubted`` that no other view has seen behind the object, so it is
    inpainted."""


@dataclass(frozen=True, eq=False)
class Removed:
    """Surfels after the second stage."""

    parameters: Parameters
    """Surfels without the object, and the environment."""
    changed: Mapping[str, RemovalMasks]
    """By the name of each training view."""


def without_object(
    capture: Capture,
    light: FittedLight,
    shots: Sequence[TrainingView],
    priors: Priors,
    *,
    settings: GorisSettings,
    seed: int,
    progress: Progress,
    saved: Checkpoint | None = None,
) -> Removed:
    """Remove the object from what the first stage has fitted.

    Args:
        capture: The photographs.
        light: The first stage.
        shots: The training views.
        priors: They inpaint radiance and materials.
        settings: Of the method.
        seed: Of the order of views, and of new surfels.
        progress: Called now and then.
        saved: Where the fit is saved: this stage in a file beside it.

    Raises:
        MethodError: No surfel is the object's or all are, the prior's answer is not sound, or the loss or a
            gradient is not finite.
    """
    extent, fitted = scene_extent([shot.photograph.camera for shot in shots]), light.parameters
    labelled = fitted.surfels[LABEL][:, 0].sigmoid() >= settings.least_inside
    theirs = with_hull(surfels_of(fitted.surfels), labelled)
    check_some(theirs, f"with a label of {settings.least_inside:g} or more", "least_inside")
    gone = theirs | next_to_object(fitted, shots, settings.grow) if settings.doubtful_go else theirs
    check_some(gone, "seen next to the object alone, or its own", "grow")
    left, added = fitted.take(~gone), None
    if settings.shadow:
        target = surfels_of(fitted.take(theirs).surfels)
        unshaded = without_shadow(target, left, shots, settings, extent)
        left, added = unshaded.parameters, unshaded.added
    behind = views_behind(
        capture,
        _drawn(left.all, settings, extent),
        [shot.target.numpy() > 0 for shot in shots],
        settings.grow,
        _effects(fitted.all, shots, settings, extent) if settings.effect_mask else None,
        added,
    )
    if settings.holes == "hull":
        masks = [shot.target.numpy() > 0 for shot in shots]
        behind = hull_holes(behind, masks, settings.grow, fitted.surfels[CENTRES][theirs].numpy())
    targets, wall = targets_of(behind, priors, settings.references, choice_of(settings))
    start = with_painted_wall(left, int(theirs.sum()), wall, settings, seed)
    rates = light_rates(extent, settings, found=True)
    for name in (LABEL, SURROUNDINGS, SKY, *([DIFFUSE] if light.metal else [])):
        rates.pop(name)
    room = Room()
    aims = [room.keep(_removal_target(target)) for target in targets]
    changed = {one.view.name: RemovalMasks(one.doubt, one.hole) for one in behind}
    del behind, targets, added  # they take more than all that is fitted
    objective = RemovalObjective(*_tiled(shots, aims, settings), settings, extent, seed)
    looked_at = (part for aim in aims for part in aim.parts)
    rules = removal_density_rules(settings) if settings.removal_density else None
    stage = own_stage(saved, "removal", looked_at, settings)
    steps = settings.second_steps
    config = TrainConfig(steps, rates, extent, rules, stage, backend=settings.backend)
    after = train(initial_state(start, seed), config, objective, progress).parameters
    return Removed(after, changed)


def removal_density_rules(settings: GorisSettings) -> DensityRules:
    """Return when surfels come in the removal; none goes, as in the released code."""
    rules = density_rules(settings.surfels)
    return replace(rules, start=_FIRST_DENSIFIED, until=settings.removal_density, least_opacity=0.0)


def next_to_object(fitted: Parameters, shots: Sequence[TrainingView], grow: float) -> torch.Tensor:
    """Return which glossy surfels have most of their blending weights within the widened masks of the object,
    shape ``(N,)``, bool.

    They have taken on its colours, as no other pixels constrain them, and an inpainting would go on with
    them. Rough surfels look the same from all views: next to the object they are as right as elsewhere.
    """
    glossy = fitted.surfels[REGION][:, 0] < 0
    cameras = [shot.photograph.camera for shot in shots]
    wide = [widened(shot.target.numpy() > 0, grow) for shot in shots]
    return glossy & (share_inside(surfels_of(fitted.surfels), cameras, wide) > MOST_DOUBTFUL)


def _effects(
    values: Mapping[str, torch.Tensor], shots: Sequence[TrainingView], settings: GorisSettings, extent: float
) -> list[np.ndarray]:
    """Return the lighting-aware mask of each view, shape ``(H, W)``, bool."""
    found = []
    with torch.no_grad():
        for shot in shots:
            view = shot.photograph
            buffers = drawn_buffers(values, view.camera, view.sky, settings)
            effect = effect_of(values, buffers, settings, extent)
            found.append((effect > settings.least_effect).numpy())
    return found


def _drawn(
    values: Mapping[str, torch.Tensor], settings: GorisSettings, extent: float
) -> Callable[[Camera], RenderedView]:
    """Return a renderer of the picture and of the layers that are inpainted as materials."""

    @torch.no_grad()
    def draw(camera: Camera) -> RenderedView:
        buffers = drawn_buffers(values, camera, sky_basis(camera, settings.sky_degree), settings)
        picture = picture_of(values, buffers, settings, extent)
        radiance = srgb_decode_tensor(picture.encoded).clamp(min=0).numpy().astype(np.float64)
        layers = {name: layer.numpy() for name, layer in material_layers(picture).items()}
        if not (settings.material_inpainting and settings.transport):
            layers = {}
        return RenderedView(radiance, depth_layer(buffers.drawn).astype(np.float64), layers)

    return draw


def material_layers(picture: GlossyPicture) -> dict[str, torch.Tensor]:
    """Return the layers of :data:`LAYERS`: diffuse radiance linear and exposed, the others in their unit."""
    buffers = picture.buffers
    parts = (buffers.diffuse, buffers.f0, buffers.roughness, buffers.glossy, buffers.normal)
    return dict(zip(LAYERS, parts, strict=True))


def with_painted_wall(
    left: Parameters, taken: int, wall: BackgroundPoints, settings: GorisSettings, seed: int
) -> Parameters:
    """Return what is left, with new surfels on the surface behind the object as it was inpainted.

    Args:
        left: Surfels of everything else.
        taken: How many surfels the object had: at most as many are new.
        wall: Points of the surface behind the object.
        settings: Of the method.
        seed: Of which points become surfels.
    """
    discs = wall_surfels(len(left), taken, wall, _painted(wall), settings, seed)
    if discs is None:
        return left
    colours, diffuse, f0, roughness, glossy = discs.features.split([3, 3, 3, 1, 1], dim=1)
    coloured = dict(with_colours(replace(discs, features=colours), settings).surfels)
    own = {
        DIFFUSE: diffuse / BRIGHTEST,
        FRESNEL: f0,
        ROUGHNESS: roughness,
        REGION: 1 - glossy,
        LABEL: torch.zeros_like(glossy),
    }
    materials = {k: torch.logit(v, eps=_SURE) for k, v in own.items()}
    if RESIDUAL in left.surfels:
        coloured[RESIDUAL] = torch.zeros(len(discs), *left.surfels[RESIDUAL].shape[1:])
    return joined_surfels(left, {**coloured, **materials})


def _painted(wall: BackgroundPoints) -> np.ndarray:
    """Return encoded colours, encoded diffuse radiance, f0, roughness and gloss of points, shape ``(M, 11)``.

    New surfels are rough where only radiance was inpainted.
    """
    count, colours = len(wall.points), srgb_encode_tensor(float_tensor(wall.colours)).numpy()
    if not wall.layers:
        return np.concatenate([colours, colours, np.full((count, 5), (0.1, 0.1, 0.1, 0.3, 0.0))], axis=1)
    diffuse = srgb_encode_tensor(float_tensor(np.maximum(wall.layers["diffuse"], 0))).numpy()
    shares = [wall.layers["f0"], wall.layers["roughness"][:, None], wall.layers["glossy"][:, None]]
    return np.concatenate([colours, diffuse, *(np.clip(share, 0, 1) for share in shares)], axis=1)


@dataclass(frozen=True, eq=False)
class RemovalTarget:
    """Targets of a training view without the object; H x W pixels, float32."""

    kept: torch.Tensor
    """Shape ``(H, W)``: 1 where the photograph is not masked out."""
    rough: torch.Tensor
    """Shape ``(H, W)``: 1 in the hole where it is inpainted as radiance."""
    glossy: torch.Tensor
    """Shape ``(H, W)``: 1 in the hole where it is inpainted as materials."""
    encoded: torch.Tensor
    """Shape ``(H, W, 3)``: the photograph, or where it is masked out what surfels show or was inpainted."""
    layers: Mapping[str, torch.Tensor]
    """Inpainted materials; diffuse radiance is encoded."""

    @property
    def parts(self) -> tuple[torch.Tensor, ...]:
        """All of it."""
        return self.kept, self.rough, self.glossy, self.encoded, *self.layers.values()

    def at(self, window: Window) -> "RemovalTarget":
        """Return the targets of a part of the view."""
        kept, rough, glossy = (window.of(mask) for mask in (self.kept, self.rough, self.glossy))
        layers = {name: window.of(layer) for name, layer in self.layers.items()}
        return RemovalTarget(kept, rough, glossy, window.of(self.encoded), layers)


def _removal_target(target: Target) -> RemovalTarget:
    known = target.known
    layers = {name: float_tensor(layer) for name, layer in target.layers.items()}
    glossy = np.zeros_like(known)
    if layers:
        glossy = known & (target.layers["glossy"] > _GLOSSY)
        layers["diffuse"] = srgb_encode_tensor(layers["diffuse"])
        layers["normal"] = torch.nn.functional.normalize(layers["normal"], dim=-1)
    return RemovalTarget(
        kept=float_tensor(~target.behind.doubt),
        rough=float_tensor(known & ~glossy),
        glossy=float_tensor(glossy),
        encoded=srgb_encode_tensor(float_tensor(target.picture)),
        layers=layers,
    )


def _tiled(
    shots: Sequence[TrainingView], aims: Sequence[RemovalTarget], settings: GorisSettings
) -> tuple[Sequence[TrainingView], Sequence[RemovalTarget]]:
    """Tiles of all views; the views themselves where the loss looks at each hole as a whole."""
    if settings.hole_loss == "lpips":
        return shots, aims
    pairs = zip(shots, aims, strict=True)
    cut = [aim.at(window) for shot, aim in pairs for window in shot.windows(settings.tile)]
    return tiles_of(shots, settings.tile), cut


@dataclass(frozen=True, eq=False)
class RemovalObjective:
    """Photographs where they are not masked out, and the inpainting where the object was; a tile a step."""

    shots: Sequence[TrainingView]
    """Tiles of all views."""
    aims: Sequence[RemovalTarget]
    """One a tile."""
    settings: GorisSettings
    extent: float
    """Extent of the scene, metres."""
    seed: int

    def __call__(self, values: Mapping[str, torch.Tensor], step: int) -> LossResult:
        """Return the loss of a step, counted from the first without the object."""
        settings = self.settings
        number = view_at(step, len(self.shots), self.seed)
        shot, aim = self.shots[number], self.aims[number]
        view = shot.photograph
        offsets = screen_offsets(values, step < settings.removal_density * settings.second_steps)
        buffers = drawn_buffers(values, view.camera, view.sky, settings, offsets)
        picture = picture_of(values, buffers, settings, self.extent)
        # not the photograph itself: the object would be in windows of SSIM that reach out of the hole
        seen = photometric_map(picture.encoded, aim.encoded, settings.ssim_share)
        loss = (seen * aim.kept[..., None]).mean() + settings.hole_weight * painted_loss(
            picture, aim, settings
        )
        loss = loss + surface_loss(buffers, shot, settings, settings.iterations, aim.kept)
        return watched(loss, values, view.camera, offsets)


def painted_loss(picture: GlossyPicture, aim: RemovalTarget, settings: GorisSettings) -> torch.Tensor:
    """Return the difference of holes from the inpainting: of radiance where rough, else of materials.

    Radiance is compared as photographs are, or as in the paper by LPIPS; ``hole_loss`` says which.
    """
    perceptual = settings.hole_loss == "lpips"
    box = box_around(aim.rough + aim.glossy) if perceptual else (slice(None), slice(None))
    loss = torch.zeros(())
    for drawn in (picture.encoded, picture.buffers.rough):
        if perceptual:
            loss = loss + appearance_loss(drawn[box], aim.encoded[box], aim.rough[box])
            continue
        differs = photometric_map(drawn, aim.encoded, settings.ssim_share)
        loss = loss + (differs * aim.rough[..., None]).mean()
    if not aim.layers or not aim.glossy[box].numel():
        return loss
    layers = material_layers(picture) | {"diffuse": srgb_encode_tensor(picture.buffers.diffuse)}
    for name, layer in layers.items():
        differs = (layer - aim.layers[name]).abs().reshape(*aim.glossy.shape, -1).mean(dim=-1)
        loss = loss + (differs * aim.glossy)[box].mean()
    return loss
