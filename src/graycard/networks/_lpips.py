# SPDX-License-Identifier: Apache-2.0
"""LPIPS (Zhang et al. 2018, version 0.1): errors of two pictures after each of five layers of a network."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from graycard._errors import WeightsError
from graycard.networks._store import read_weights, weights_path

if TYPE_CHECKING:
    import torch

Net = Literal["alex", "vgg"]
"""Trunk of LPIPS: AlexNet or VGG-16."""

LPIPS_VARIABLE = "GRAYCARD_LPIPS"
"""Environment variable that names a folder of the user's own weights, which then win over fetched ones."""
_SHIFT, _SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)
"""From [-1, 1] to what the trunks were trained on, as LPIPS 0.1 does it."""


@dataclass(frozen=True, slots=True)
class _Trunk:
    """A network of convolutions, each followed by a ReLU."""

    convolutions: tuple[tuple[int, int, int], ...]
    """Index in torchvision's network, stride, padding."""
    pooled: tuple[int, ...]
    """Convolutions that a maximum over ``window`` squared every 2 pixels precedes."""
    window: int
    compared: tuple[int, ...]
    """Convolutions after which pictures are compared."""
    least: int
    """Side in pixels from which the last layer has a pixel."""
    files: str
    """Its files as their authors publish them."""


_ALEX = _Trunk(
    convolutions=((0, 4, 2), (3, 1, 2), (6, 1, 1), (8, 1, 1), (10, 1, 1)),
    pooled=(3, 6),
    window=3,
    compared=(0, 3, 6, 8, 10),
    least=31,
    files="torchvision's alexnet-*.pth and alex.pth of the lpips package",
)
"""Krizhevsky 2014."""
_VGG = _Trunk(
    convolutions=tuple((index, 1, 1) for index in (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)),
    pooled=(5, 10, 17, 24),
    window=2,
    compared=(2, 7, 14, 21, 28),
    least=16,
    files="torchvision's vgg16-*.pth and vgg.pth of the lpips package",
)
"""Simonyan and Zisserman 2015, 16 layers."""
_TRUNKS: Mapping[Net, _Trunk] = {"alex": _ALEX, "vgg": _VGG}


def least_side(net: Net) -> int:
    """Return the side in pixels from which LPIPS can be computed."""
    return _TRUNKS[net].least


def lpips_folder(net: Net) -> Path | None:
    """Return the folder of the user's own weights for a trunk; None where none is named.

    A folder without any file for VGG-16, whose names hold ``vgg``, is one for AlexNet alone.
    """
    if not os.environ.get(LPIPS_VARIABLE):
        return None
    folder = Path(os.environ[LPIPS_VARIABLE])
    return folder if net == "alex" or _files(folder, net) else None


def has_lpips(net: Net) -> bool:
    """Tell whether weights are named or fetched."""
    return lpips_folder(net) is not None or weights_path(f"lpips-{net}").is_file()


def lpips_weights(net: Net) -> "Mapping[str, torch.Tensor]":
    """Return the weights that a user has: those of ``GRAYCARD_LPIPS``, else those that were fetched.

    Raises:
        WeightsError: There are none, or they are damaged.
    """
    if (folder := lpips_folder(net)) is not None:
        return load_lpips(folder, net)
    if not has_lpips(net):
        raise WeightsError(
            f"expected {LPIPS_VARIABLE} to name a folder of LPIPS weights, got none. "
            "Run `graycard weights lpips`, or set it"
        )
    return published_lpips(net)


def published_lpips(net: Net) -> "Mapping[str, torch.Tensor]":
    """Return the fetched weights, whose digest the code states; what a fit uses is the same everywhere.

    Raises:
        WeightsError: They were not fetched, or are not what was fetched.
    """
    import torch

    return {name: torch.tensor(array) for name, array in read_weights(f"lpips-{net}").items()}


@lru_cache(maxsize=2)
def load_lpips(folder: Path, net: Net = "alex") -> "Mapping[str, torch.Tensor]":
    """Return the tensors that LPIPS needs from the ``.pth`` and ``.safetensors`` files of a folder, by name.

    Torchvision's trunk (``features.0.weight`` …) and the heads of LPIPS 0.1 (``lin0.model.1.weight`` …) must
    be among them, in one file or several, as published. Files whose names hold ``vgg`` are for VGG-16, all
    others for AlexNet.

    Raises:
        WeightsError: There is no such folder, a file cannot be read, or a tensor is missing.
    """
    found: dict[str, torch.Tensor] = {}
    for path in _files(folder, net):
        found |= _read(path)
    trunk = _TRUNKS[net]
    wanted = [f"features.{index}.{kind}" for index, _, _ in trunk.convolutions for kind in ("weight", "bias")]
    wanted += [f"lin{i}.model.1.weight" for i in range(len(trunk.compared))]
    if missing := [name for name in wanted if name not in found]:
        raise WeightsError(
            f"expected the weights of LPIPS for {net} in {folder}, got none named {', '.join(missing[:3])}. "
            f"Put {trunk.files} there, or unset {LPIPS_VARIABLE} and run `graycard weights lpips`"
        )
    return {name: found[name].float() for name in wanted}


def _files(folder: Path, net: Net) -> list[Path]:
    files = sorted(path for path in folder.glob("*") if path.suffix in (".pth", ".safetensors"))
    return [path for path in files if ("vgg" in path.name) is (net == "vgg")]


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


def lpips_layers(
    pair: "torch.Tensor", net: Net, weights: "Mapping[str, torch.Tensor]"
) -> "list[torch.Tensor]":
    """Return the error of two pictures after each of five layers.

    Features are normalised to length 1 along the channels; their squared differences are weighted by channel.

    Args:
        pair: shape ``(2, 3, H, W)``, display values in [0, 1]; gradients flow to it.
        net: The trunk.
        weights: Of the trunk and of the heads, by name.

    Returns:
        Five maps of shape ``(1, 1, h, w)``, each smaller than the one before. LPIPS is the sum of their
        means; its map the sum of them enlarged to the pictures.
    """
    import torch
    from torch.nn.functional import conv2d, max_pool2d, relu

    trunk = _TRUNKS[net]
    shift, scale = (torch.tensor(x).reshape(1, 3, 1, 1) for x in (_SHIFT, _SCALE))
    features, errors = (2 * pair - 1 - shift) / scale, []
    for index, stride, padding in trunk.convolutions:
        features = max_pool2d(features, trunk.window, 2) if index in trunk.pooled else features
        kernel, bias = (weights[f"features.{index}.{kind}"] for kind in ("weight", "bias"))
        features = relu(conv2d(features, kernel, bias, stride, padding))
        if index in trunk.compared:
            unit = features / (features.norm(dim=1, keepdim=True) + 1e-10)
            errors.append(conv2d((unit[:1] - unit[1:]) ** 2, weights[f"lin{len(errors)}.model.1.weight"]))
    return errors
