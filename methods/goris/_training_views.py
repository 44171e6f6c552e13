# SPDX-License-Identifier: Apache-2.0
"""The training views as a fit takes them, and the priors' answers for them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from graycard import Camera, Capture, MethodError
from graycard.io import Room
from graycard.methods._contract import Ask, Priors
from graycard.methods.goris._settings import GorisSettings
from graycard.methods.splat import Window, windows_of
from graycard.methods.surfels import EncodedPhotograph, exposed_photograph, photographs

LAYERS = ("diffuse", "f0", "roughness", "glossy", "normal")
"""Layers that are inpainted where a surface is glossy, besides radiance."""
ASKS = (
    Ask("inpainting", ("radiance", *LAYERS)),
    Ask("mask", ("glossy", "target"), optional=True),
    Ask("normal", optional=True),
)


@dataclass(frozen=True, eq=False)
class TrainingView:
    """A training view; H x W pixels, float32."""

    photograph: EncodedPhotograph
    glossy: torch.Tensor
    """Shape ``(H, W)``: 1 where a prior says that a surface is glossy, or anywhere if none is asked; 0 on the
    object. It is removed anyway, and reflected rays do not meet glossy surfels, see ``traced``."""
    told: bool
    """True if a prior was asked for ``glossy``."""
    target: torch.Tensor
    """Shape ``(H, W)``: 1 where the object is visible."""
    normal: torch.Tensor | None = None
    """Shape ``(H, W, 3)``, world, unit, or zero where a prior knows nothing; None without one."""

    def windows(self, side: int) -> list[Window]:
        """Parts of about ``side`` pixels a side: each pixel is in one of them."""
        camera = self.photograph.camera
        return windows_of(camera.height, camera.width, side)

    def at(self, window: Window) -> "TrainingView":
        """Return a part of the view."""
        glossy, target = window.of(self.glossy), window.of(self.target)
        normal = None if self.normal is None else window.of(self.normal)
        return TrainingView(self.photograph.at(window), glossy, self.told, target, normal)


def training_views(
    capture: Capture, priors: Priors, masks: Sequence[np.ndarray], settings: GorisSettings
) -> list[TrainingView]:
    """Return the training views, exposed and encoded.

    Args:
        capture: The photographs.
        priors: Asked for what they know.
        masks: Of the object, one a view, shape ``(H, W)``, bool.
        settings: Of the method.

    Raises:
        MethodError: An answer of the prior is not sound.
    """
    found = []
    with Room() as room:
        for number, photograph in enumerate(photographs(capture, settings)):
            shot = _shot(capture, priors, number, photograph, masks[number], settings)
            glossy, target, normal = room.keep((shot.glossy, shot.target, shot.normal))
            found.append(replace(shot, glossy=glossy, target=target, normal=normal))
    return found


def tiles_of(shots: Sequence[TrainingView], side: int) -> list[TrainingView]:
    """All views, cut into tiles of about ``side`` pixels a side."""
    return [shot.at(window) for shot in shots for window in shot.windows(side)]


def looked_at(shots: Sequence[TrainingView]) -> Iterator[tuple[Camera, torch.Tensor]]:
    """All that a first stage depends on in its views: a checkpoint of others is refused."""
    for shot in shots:
        for picture in (
            shot.photograph.encoded,
            shot.glossy,
            shot.target,
            torch.tensor([shot.told, shot.normal is not None]),  # "all is glossy" is more than not to ask
            shot.normal,
        ):
            if picture is not None:
                yield shot.photograph.camera, picture


def _shot(
    capture: Capture,
    priors: Priors,
    number: int,
    photograph: EncodedPhotograph,
    mask: np.ndarray,
    settings: GorisSettings,
) -> TrainingView:
    view = capture.train[number]
    image = exposed_photograph(capture, view)
    told, normal = settings.region_weight > 0 and "mask" in priors.kinds, None
    glossy = ~mask
    if told:
        shines = priors.mask(image, view, "glossy")
        if settings.object_masks == "prior" and shines.any() and np.array_equal(shines, mask):
            raise MethodError(
                f"expected two answers of the prior for masks in {view.name}, of what is glossy and of the "
                "object, got one for both. A network answers one question: take the object's masks from the "
                'capture (object_masks "capture"), or the mask from another source (overrides.mask.source)'
            )
        glossy = ~mask & shines
    if settings.normal_prior_weight > 0 and "normal" in priors.kinds:
        normal = torch.from_numpy(priors.normal(image, view).astype(np.float32))
    glossy, target = (torch.from_numpy(one.astype(np.float32)) for one in (glossy, mask))
    return TrainingView(photograph, glossy, told, target, normal)
