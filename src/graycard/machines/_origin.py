# SPDX-License-Identifier: Apache-2.0
"""Code and weights of a machine: where they are others than those of the bench, scores are not the same."""

import hashlib
import os
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from graycard.networks import has_inception, has_lpips
from graycard.synth import find_llvm

_HOME = Path(__file__).parents[1]
_PACKAGES = (
    "mitsuba", "drjit", "karellen-llvm-core", "torch", "gsplat", "numpy", "scipy", "numba", "llvmlite",
    "scikit-image", "opencv-python-headless", "colour-science", "pillow", "OpenEXR",
)  # fmt: skip
"""Packages that numbers come from."""
_READ = (".py", ".toml", ".safetensors")


def origin() -> dict[str, str]:
    """Return what numbers depend on here: graycard's code, versions of packages and weights, by name.

    Code is as the process found it first: what changes later is not what it runs. Weights are those of now.
    """
    found = (
        ("LPIPS (AlexNet)", has_lpips("alex")),
        ("LPIPS (VGG-16)", has_lpips("vgg")),
        ("FID and KID", has_inception()),
    )
    return {**_installed(), "weights of": ", ".join(name for name, here in found if here) or "nothing"}


def differences(wanted: dict[str, str]) -> list[str]:
    """Return in words what this machine has otherwise than another.

    A machine without a GPU needs no gsplat: versions of it count where both have it.
    """
    own = origin()
    left = {"gsplat"} if "none" in (own["gsplat"], wanted.get("gsplat")) else set()
    return [
        f"{name} {own.get(name)} and not {value}"
        for name, value in wanted.items()
        if own.get(name) != value and name not in left
    ]


@cache
def _installed() -> dict[str, str]:
    """Return code and versions, as the process found them first."""
    return {
        "graycard's code": _code()[:12],
        "Python": platform.python_version(),
        "LLVM of the renderer": _llvm(),
        **_versions(),
    }


def _llvm() -> str:
    """Return the name of the library that scenes render with; without one, layers are missing."""
    llvm = find_llvm()
    return f"{llvm.version} ({llvm.path.resolve().name})" if llvm.path and llvm.usable else "none"


def _code() -> str:
    """Return SHA-256 over the files of the package, by their names in it."""
    digest = hashlib.sha256()
    for folder, folders, names in os.walk(_HOME, followlinks=True):
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        for name in sorted(name for name in names if name.endswith(_READ)):
            path = Path(folder) / name
            digest.update(path.relative_to(_HOME).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _versions() -> dict[str, str]:
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "none"
    return found
