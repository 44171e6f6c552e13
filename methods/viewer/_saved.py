# SPDX-License-Identifier: Apache-2.0
"""A decomposition that ``graycard fit --save`` wrote, as something to look at."""

from dataclasses import dataclass
from pathlib import Path

from graycard import MethodError
from graycard.io import read_json
from graycard.methods._contract import Decomposition
from graycard.methods._registry import BUILT_IN, load_method
from graycard.methods._store import INDEX
from graycard.methods.trained import TrainedSplat, read_splat

SURFELS = "surfels.ply"


@dataclass(frozen=True)
class Fitted:
    """A saved decomposition."""

    method: str
    """Name of the method that made it."""
    decomposition: Decomposition
    surfels: TrainedSplat
    """In the colours that viewers show."""


def is_saved(folder: Path) -> bool:
    """Tell whether ``graycard fit --save`` wrote a folder."""
    return (Path(folder) / INDEX).is_file()


def saved_surfels(folder: Path) -> TrainedSplat:
    """Return the surfels of a saved decomposition, in the colours that viewers show; no method is imported.

    Raises:
        MethodError: There is none, or one without surfels.
        DatasetError: The file of the surfels is damaged.
    """
    path = Path(folder) / SURFELS
    if not is_saved(folder) or not path.is_file():
        have = "a decomposition without surfels" if is_saved(folder) else "another folder or none"
        raise MethodError(
            f"expected a saved decomposition with {SURFELS} at {folder}, got {have}. Make one of a method "
            "that fits surfels: `graycard fit METHOD SCENE --out PREDICTIONS --save FOLDER`"
        )
    return read_splat(path, "2dgs")


def open_fitted(folder: Path) -> Fitted:
    """Return a saved decomposition that can be rendered.

    Code of others is not imported for the name in a file: of the methods only graycard's own are opened.

    Raises:
        MethodError: There is none, it is damaged, or it is by a method of others.
    """
    surfels = saved_surfels(folder)
    index = read_json(Path(folder) / INDEX, MethodError)
    name = index.get("method") if isinstance(index, dict) else None
    if name not in BUILT_IN:
        raise MethodError(
            f"expected a decomposition by a method of graycard in {folder}, got one by {name!r}. Render it "
            "with the code of its method"
        )
    return Fitted(name, load_method(name).load(Path(folder)), surfels)
