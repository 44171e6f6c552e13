# SPDX-License-Identifier: Apache-2.0
"""graycard's own weights: a network trained on scenes of its families, which everyone can run."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch.nn.functional import interpolate

from graycard import MethodError, srgb_decode
from graycard.methods._priors import ImageKind, Question
from graycard.methods._tensors import float_tensor
from graycard.methods.priors.network import SIDE, STEP, GeometryNet, inputs_of, rays_of


@dataclass(frozen=True, slots=True, eq=False)
class OwnNetwork:
    """Answers about one kind with a network of graycard's own shape.

    It sees a picture brought to about as many pixels as those it was trained on, and the rays of its camera;
    not where the camera stands. Where it finds no surface, depth is infinite and all else zero.
    """

    kind: ImageKind
    net: GeometryNet

    def answer(self, question: Question) -> np.ndarray:
        """Return the network's answer.

        Raises:
            MethodError: It gives no finite values: the weights are not those of such a network.
        """
        height, width = np.shape(question.image)[:2]
        with torch.inference_mode():
            told = self.net(_seen_by(question))
            asked = _resized(told[self.kind], height, width)
            odds = _resized(told["seen"], height, width)
        values = asked[0].permute(1, 2, 0).double().numpy()
        if not np.isfinite(values).all():
            raise MethodError(f"expected finite values from the network for {self.kind}, got others")
        seen = (odds[0, 0] > 0).numpy()
        return self._in_units(values, seen, question)

    def _in_units(self, values: np.ndarray, seen: np.ndarray, question: Question) -> np.ndarray:
        """Return the answer in the units of its kind, from values ``(H, W, C)``."""
        match self.kind:
            case "depth":
                return np.where(seen, np.exp(values[..., 0]), np.inf)
            case "normal":
                lengths = np.maximum(np.linalg.norm(values, axis=-1, keepdims=True), 1e-12)
                turned = values / lengths @ question.view.camera.camera_to_world[:3, :3].T
                return np.where(seen[..., None], turned, 0.0)
            case "base_color":
                return np.where(seen[..., None], srgb_decode(values), 0.0)
            case _:
                return np.where(seen, np.clip(values[..., 0], 0, 1), 0.0)


def load_own(kind: ImageKind, weights: Path) -> OwnNetwork:
    """Return the network of a file of weights.

    Raises:
        MethodError: The file is damaged, or holds the weights of another network.
    """
    now = weights.stat()
    return OwnNetwork(kind, _network(weights.resolve(), (now.st_mtime_ns, now.st_size)))


@lru_cache(maxsize=2)
def _network(weights: Path, _: tuple[int, int]) -> GeometryNet:
    """Return the network in a file, read once for all kinds; the last argument tells its states apart."""
    net = GeometryNet()
    try:
        net.load_state_dict({name: values.float() for name, values in load_file(weights).items()})
    except (SafetensorError, OSError, RuntimeError) as cause:
        raise MethodError(
            f"expected weights of graycard's own network in {weights}, got: {str(cause).splitlines()[0]}. "
            "Make some by `graycard train-prior`"
        ) from cause
    return net.eval().requires_grad_(False)


def _seen_by(question: Question) -> torch.Tensor:
    """Return the network's input for a question, ``(1, 5, H', W')``, of about as many pixels as it knows."""
    height, width = np.shape(question.image)[:2]
    factor = SIDE / np.sqrt(height * width)
    tall, wide = (max(round(side * factor / STEP), 1) * STEP for side in (height, width))
    scale = np.array([[wide / width], [tall / height], [1.0]])
    rays = rays_of(question.view.camera.K * scale, tall, wide)
    image = float_tensor(np.moveaxis(np.asarray(question.image), -1, 0)[None])
    return inputs_of(_resized(image, tall, wide), rays[None])


def _resized(values: torch.Tensor, height: int, width: int) -> torch.Tensor:
    """Values ``(1, C, H, W)`` at another size; as they are at their own."""
    if values.shape[-2:] == (height, width):
        return values
    return interpolate(values, (height, width), mode="bilinear", antialias=True)
