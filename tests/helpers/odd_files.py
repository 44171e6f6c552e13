# SPDX-License-Identifier: Apache-2.0
"""Files of layers as other programs may write them: with channels of no layer, or without some."""

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
import OpenEXR

from graycard import find_layer
from graycard.io import read_layers


def rewrite(path: Path, more: Mapping[str, np.ndarray], without: Collection[str] = ()) -> None:
    """Write a file of layers again, with more channels ``(H, W)`` by name, and without others."""
    channels: dict[str, np.ndarray] = {}
    for name, values in read_layers(path).items():
        planes = values[..., None] if values.ndim == 2 else values
        for i, suffix in enumerate(find_layer(name).channels):
            channels[f"{name}.{suffix}"] = np.ascontiguousarray(planes[..., i])
    kept = {name: plane for name, plane in channels.items() if name not in without}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, kept | dict(more)).write(str(path))
