# SPDX-License-Identifier: Apache-2.0
"""Packages that a light installation leaves out: named when missing, with the command that installs them."""

import platform
import re
import sys
from importlib.metadata import PackageNotFoundError, requires, version

from graycard._errors import GraycardError

CPU_INDEX = "https://download.pytorch.org/whl/cpu"
"""Index of PyTorch's own builds without CUDA, which is some 4 GB."""
_OF_IMPORT = {
    "bokeh": "bokeh", "colour": "colour-science", "cv2": "opencv-python-headless", "dask": "distributed",
    "dask_jobqueue": "dask-jobqueue", "distributed": "distributed", "drjit": "mitsuba", "gsplat": "gsplat",
    "imageio": "imageio", "imageio_ffmpeg": "imageio-ffmpeg", "jinja2": "jinja2", "llvmlite": "numba",
    "mitsuba": "mitsuba", "numba": "numba", "PIL": "pillow", "pycolmap": "pycolmap",
    "safetensors": "safetensors", "scipy": "scipy", "skimage": "scikit-image", "tifffile": "tifffile",
    "torch": "torch", "transformers": "transformers", "viser": "viser",
}  # fmt: skip
"""Distributions by the module that they bring."""
_NAME = re.compile(r"[A-Za-z0-9][\w.-]*")


class MissingPackageError(GraycardError):
    """A package that graycard requires is not installed, as in a light installation."""

    def __init__(self, package: str, command: str) -> None:
        super().__init__(f"expected the package {package}, which this needs, got none. Run {command}")
        self.package, self.command = package, command

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        """Survive the way back from a worker process."""
        return type(self), (self.package, self.command)


def missing_package(cause: BaseException | None) -> MissingPackageError | None:
    """Return the error that names a missing package of graycard's and how to install it; None for any other.

    Args:
        cause: An error, as Python raises it for a module that is not there.
    """
    if not isinstance(cause, ModuleNotFoundError):
        return None
    package = _OF_IMPORT.get((cause.name or "").partition(".")[0])
    if package is None:
        return None
    return MissingPackageError(package, install_command(package))


def install_command(package: str) -> str:
    """Return the command that installs a package, and all else of graycard's that is missing with it."""
    absent = [need for need in _required() if not _is_installed(_name(need))]
    if package not in map(_name, absent):  # of an extra
        absent = [package]
    torch = [need for need in absent if _name(need) == "torch"]
    rest = [need for need in absent if _name(need) != "torch"]
    lines = [f"torch --index-url {CPU_INDEX}" for _ in torch]  # a GPU wants the build of its own index
    lines += [" ".join(need if need == _name(need) else f"'{need}'" for need in rest)] if rest else []
    return " && ".join(f"`{_pip()} install {line}`" for line in lines).replace("` && `", " && ")


def absent_packages() -> list[str]:
    """Return the names of packages that graycard requires without extras and that are not installed."""
    return [_name(need) for need in _required() if not _is_installed(_name(need))]


def _pip() -> str:
    """Return the words that run pip where it installs for this Python."""
    return "pip" if sys.prefix != sys.base_prefix else f"python{sys.version_info[0]} -m pip"


def _required() -> list[str]:
    """Return what graycard requires without extras, as its metadata says; markers are left out."""
    try:
        lines = requires("graycard") or []
    except PackageNotFoundError:
        return []
    needs = (line.partition(";") for line in lines if "extra ==" not in line)
    ours = sys.platform == "linux" and platform.machine() == "x86_64"
    return [need.strip() for need, _, marker in needs if ours or "sys_platform" not in marker]


def _name(requirement: str) -> str:
    found = _NAME.match(requirement)
    return found.group() if found else requirement


def _is_installed(name: str) -> bool:
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True
