# SPDX-License-Identifier: Apache-2.0
"""LPIPS with the weights that a user has; scoring never downloads any."""

from typing import Literal

import numpy as np

from graycard import DatasetError
from graycard.eval.scoring._mask import with_true_background
from graycard.networks import Net, least_side, lpips_layers, lpips_weights

Fed = Literal["from -1 to 1", "as it is"]
"""Range that values in [0, 1] are brought to for the network: that of its training, or none."""


def lpips(predicted: np.ndarray, true: np.ndarray, mask: np.ndarray, net: Net = "alex") -> float:
    """Return the mean over the mask of the LPIPS map: Zhang et al. 2018, version 0.1, spatial.

    Features of both images after each of five layers, normalised to length 1 along the channels; their
    squared differences weighted by channel, enlarged to the image (bilinear), and summed over layers. Outside
    the mask both images show the truth.

    Args:
        predicted: shape ``(H, W, 3)``, display values in [0, 1].
        true: shape ``(H, W, 3)``, display values in [0, 1].
        mask: shape ``(H, W)``, bool.
        net: The trunk: AlexNet, with which papers score, or VGG-16, with which they train.

    Returns:
        [0, ∞); 0 for equal images.

    Raises:
        WeightsError: The weights are neither named nor fetched, or damaged.
        DatasetError: The images are too small for the network.
        ValueError: The shapes differ, or the mask is empty.
    """
    import torch
    from torch.nn.functional import interpolate

    _check_size(true, net)
    weights = lpips_weights(net)
    with torch.inference_mode():
        pair = np.stack([with_true_background(predicted, true, mask), np.asarray(true, np.float64)])
        errors = [
            interpolate(error, true.shape[:2], mode="bilinear", align_corners=False)
            for error in lpips_layers(torch.from_numpy(pair).float().permute(0, 3, 1, 2), net, weights)
        ]
        return float(torch.cat(errors).sum(dim=(0, 1)).numpy()[mask].mean(dtype=np.float64))


def plain_lpips(predicted: np.ndarray, true: np.ndarray, net: Net, fed: Fed) -> float:
    """Return the LPIPS of two whole pictures: version 0.1, the sum over layers of the mean error.

    Args:
        predicted: shape ``(H, W, 3)``; 0 is black and 1 white.
        true: shape ``(H, W, 3)``, the same.
        net: The trunk.
        fed: The range of [0, 1] at the network. Scripts that forget to stretch it feed it as it is.

    Returns:
        [0, ∞); 0 for equal images.

    Raises:
        WeightsError: The weights are neither named nor fetched, or damaged.
        DatasetError: The images are too small for the network.
    """
    import torch

    _check_size(true, net)
    weights = lpips_weights(net)
    with torch.inference_mode():
        pair = torch.from_numpy(np.stack([predicted, true]).astype(np.float32)).permute(0, 3, 1, 2)
        shown = pair if fed == "from -1 to 1" else (pair + 1) / 2  # which the network's input undoes
        return float(sum(layer.mean(dtype=torch.float64) for layer in lpips_layers(shown, net, weights)))


def _check_size(image: np.ndarray, net: Net) -> None:
    if min(image.shape[:2]) < (least := least_side(net)):
        raise DatasetError(
            f"expected images of at least {least}x{least} pixels for LPIPS, got "
            f"{image.shape[1]}x{image.shape[0]}. Render the scene larger"
        )
