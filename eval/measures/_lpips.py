# SPDX-License-Identifier: Apache-2.0
"""LPIPS with the weights that a user has; none are ever downloaded."""

import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from graycard import DatasetError, WeightsError
from graycard.eval.scoring._mask import with_true_background

if TYPE_CHECKING:
    import torch

VARIABLE = "GRAYCARD_LPIPS"
"""Environment variable that names the folder of weights."""
LEAST = 31
"""Side in pixels from which AlexNet's five layers have a pixel."""
_CONVOLUTIONS = ((0, 4, 2), (3, 1, 2), (6, 1, 1), (8, 1, 1), (10, 1, 1))
"""Index in torchvision's AlexNet, stride, padding; a maximum over 3x3 every 2 pixels precedes the second and
the third (Krizhevsky 2014)."""
_POOLED = (3, 6)
_SHIFT, _SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)
"""From [-1, 1] to what AlexNet was trained on, as LPIPS 0.1 does it."""


def weights_folder() -> Path | None:
    """The folder that the user names; None where none is named."""
    return Path(os.environ[VARIABLE]) if os.environ.get(VARIABLE) else None


def has_weights() -> bool:
    """Tell whether LPIPS can be computed."""
    return weights_folder() is not None


def lpips(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray) -> float:
    """Mean over the mask of the LPIPS map: Zhang et al. 2018, version 0.1, AlexNet, spatial.

    Features of both images after each of five layers, normalised to length 1 along the channels; their
    squared differences weighted by channel, enlarged to the image (bilinear), and summed over layers. Outside
    the mask both images show the truth.

    Args:
        predicted: shape ``(H, W, 3)``, display values in [0, 1].
        true: shape ``(H, W, 3)``, display values in [0, 1].
        mask: shape ``(H, W)``, bool.

    Returns:
        [0, ∞); 0 for equal images.

    Raises:
        WeightsError: The folder of weights is not named, or lacks some.
        DatasetError: The images are too small for the network.
        ValueError: The shapes differ, or the mask is empty.
    """
    import torch
    from torch.nn.functional import interpolate

    if min(true.shape[:2]) < LEAST:
        raise DatasetError(
            f"expected images of at least {LEAST}x{LEAST} pixels for LPIPS, got "
            f"{true.shape[1]}x{true.shape[0]}. Render the scene larger"
        )
    folder = weights_folder()
    if folder is None:
        raise WeightsError(f"expected {VARIABLE} to name a folder of LPIPS weights, got none")
    weights = load_weights(folder)
    with torch.inference_mode():
        pair = np.stack([with_true_background(predicted, true, mask), np.asarray(true, np.float64)])
        errors = [
            interpolate(error, true.shape[:2], mode="bilinear", align_corners=False)
            for error in _layer_errors(torch.from_numpy(pair).float().permute(0, 3, 1, 2), weights)
        ]
        return float(torch.cat(errors).sum(dim=(0, 1)).numpy()[mask].mean(dtype=np.float64))


@lru_cache(maxsize=1)
def load_weights(folder: Path) -> "Mapping[str, torch.Tensor]":
    """All tensors in the ``.pth`` and ``.safetensors`` files of a folder, by name.

    Those of torchvision's AlexNet (``features.0.weight`` …) and of LPIPS 0.1 (``lin0.model.1.weight`` …) must
    be among them, in one file or several, as their authors publish them.

    Raises:
        WeightsError: There is no such folder, a file cannot be read, or a tensor is missing.
    """
    found: dict[str, torch.Tensor] = {}
    for path in sorted(p for p in folder.glob("*") if p.suffix in (".pth", ".safetensors")):
        found |= _read(path)
    wanted = [f"features.{index}.{kind}" for index, _, _ in _CONVOLUTIONS for kind in ("weight", "bias")]
    wanted += [f"lin{i}.model.1.weight" for i in range(len(_CONVOLUTIONS))]
    if missing := [name for name in wanted if name not in found]:
        raise WeightsError(
            f"expected the weights of AlexNet and of LPIPS in {folder}, got none named "
            f"{', '.join(missing[:3])}. Put torchvision's alexnet-*.pth and alex.pth of the lpips package "
            f"there, or unset {VARIABLE}"
        )
    return {name: found[name].float() for name in wanted}


def _read(path: Path) -> "dict[str, torch.Tensor]":
    import torch
    from safetensors.torch import load_file

    try:
        if path.suffix == ".safetensors":
            return load_file(path)
        return dict(torch.load(path, map_location="cpu", weights_only=True))
    except Exception as cause:  # torch and safetensors raise a dozen kinds for a damaged file
        first = str(cause).splitlines()[0]
        raise WeightsError(f"expected a file of tensors at {path}, got: {first} Fetch it again") from cause


def _layer_errors(pair: "torch.Tensor", weights: "Mapping[str, torch.Tensor]") -> "list[torch.Tensor]":
    """The weighted error after each layer, ``(1, 1, h, w)``, of two images ``(2, 3, H, W)`` in [0, 1]."""
    import torch
    from torch.nn.functional import conv2d, max_pool2d, relu

    shift, scale = (torch.tensor(x).reshape(1, 3, 1, 1) for x in (_SHIFT, _SCALE))
    features, errors = (2 * pair - 1 - shift) / scale, []
    for layer, (index, stride, padding) in enumerate(_CONVOLUTIONS):
        features = max_pool2d(features, 3, 2) if index in _POOLED else features
        kernel, bias = (weights[f"features.{index}.{kind}"] for kind in ("weight", "bias"))
        features = relu(conv2d(features, kernel, bias, stride, padding))
        unit = features / (features.norm(dim=1, keepdim=True) + 1e-10)
        errors.append(conv2d((unit[:1] - unit[1:]) ** 2, weights[f"lin{layer}.model.1.weight"]))
    return errors
