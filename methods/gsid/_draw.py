# SPDX-License-Identifier: Apache-2.0
"""A whole view under lights: pixels are shaded (deferred, as in the paper), or surfels are (forward)."""

from collections.abc import Mapping

import torch
from torch.nn.functional import normalize

from graycard import Camera
from graycard.methods.gsid._model import (
    BASE_COLOR,
    METALLIC,
    OPEN,
    ROUGHNESS,
    SHADOW,
    Ground,
    LitPicture,
    Pixels,
    Reach,
    WholePicture,
    picture_of,
    pixels_of,
    reach_of,
    whole_picture_of,
)
from graycard.methods.gsid._settings import GsidSettings
from graycard.methods.shading import Material, Shining, Surroundings, look_up
from graycard.methods.splat import Surfels, rasterize_features, rotation_matrices, surfels_of


def reach_in_view(surfels: Surfels, camera: Camera, arrived: Reach, settings: GsidSettings) -> Reach:
    """Receivers of light: pixels of a view, or the surfels themselves.

    Args:
        surfels: N of them.
        camera: Of the view.
        arrived: At the surfels.
        settings: Which of the two is shaded.
    """
    if settings.shading == "forward":
        return arrived
    return reach_of(surfels, camera, arrived)


def draw(
    values: Mapping[str, torch.Tensor],
    ground: Ground,
    lights: tuple[Shining, Surroundings],
    reach: Reach,
    settings: GsidSettings,
    extent: float,
    *,
    apart: bool = True,
    pixels: Pixels | None = None,
) -> LitPicture:
    """Return a view of shape ``(H, W)``.

    Args:
        values: Parameters by name.
        ground: The view.
        lights: Lamps and surroundings, equally exposed.
        reach: Of :func:`reach_in_view`.
        settings: What is shaded, and how vectors are read.
        extent: Of the scene, metres.
        apart: Whether lamps are kept apart; else they are one. Surfels with light of hundreds of them would
            take long to draw.
        pixels: What is shaded where pixels are, if it has been drawn already.
    """
    if settings.shading == "deferred":
        pixels = pixels_of(values, ground) if pixels is None else pixels
        return picture_of(pixels, *lights, reach, settings.visibility, extent)
    lit = picture_of(_seen_surfels(values, ground), *lights, reach, settings.visibility, extent)
    return _drawn(lit if apart else lit.merged(), surfels_of(values), ground, lights[1])


def draw_whole(
    values: Mapping[str, torch.Tensor],
    ground: Ground,
    lights: tuple[Shining, Surroundings],
    reach: Reach,
    settings: GsidSettings,
    extent: float,
    *,
    pixels: Pixels,
) -> WholePicture:
    """Return the sums of what :func:`draw` tells apart; arguments are as there."""
    if settings.shading == "deferred":
        return whole_picture_of(pixels, *lights, reach, settings.visibility, extent)
    picture = draw(values, ground, lights, reach, settings, extent)
    return WholePicture(picture.whole, picture.given)


def light_evaluations(values: Mapping[str, torch.Tensor], ground: Ground, settings: GsidSettings) -> int:
    """Return how often light is found for a view: once a pixel that surfels cover, or once a surfel."""
    if settings.shading == "forward":
        return len(values[OPEN])
    return int((ground.drawn.alpha > 0).sum())


def _seen_surfels(values: Mapping[str, torch.Tensor], ground: Ground) -> Pixels:
    """All surfels as the camera sees them, each as if it filled a pixel."""
    surfels = surfels_of(values)
    eye = normalize(torch.tensor(ground.camera.position).float() - surfels.centres, dim=-1)
    normal = rotation_matrices(surfels.rotations)[:, :, 2]
    normal = torch.where((normal * eye).sum(dim=-1, keepdim=True) < 0, -normal, normal)
    base, roughness, metallic = (values[name].sigmoid() for name in (BASE_COLOR, ROUGHNESS, METALLIC))
    material = Material(base, roughness[:, 0], metallic[:, 0])
    whole = torch.ones(len(normal))
    return Pixels(material, values[SHADOW], surfels.centres, normal, eye, values[OPEN], whole)


def _drawn(lit: LitPicture, surfels: Surfels, ground: Ground, surroundings: Surroundings) -> LitPicture:
    """Return the light that surfels send, drawn, and the surroundings behind them."""
    parts = lit.by_lamp, lit.by_sky[:, None], lit.by_way, lit.irradiance
    sizes = [part.shape[1] for part in parts]
    sent = torch.cat(parts, dim=1)
    drawn = rasterize_features(surfels, ground.camera, features=sent.flatten(1))
    by_lamp, by_sky, by_way, irradiance = drawn.features.unflatten(-1, (-1, 3)).split(sizes, dim=-2)
    behind = look_up(surroundings.skies[0], -ground.eye)
    by_sky = by_sky[..., 0, :] + (1 - drawn.alpha[..., None]) * behind
    return LitPicture(by_lamp, by_sky, by_way, irradiance)
