# SPDX-License-Identifier: Apache-2.0
"""The origin of numbers: versions, commit, hardware, and the hash of the code that scores."""

import platform
import shutil
import subprocess
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, SOURCE_SUFFIXES
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import graycard
from graycard.benchmarks._installed import find_installed
from graycard.io import code_hash, to_builtins
from graycard.resources import usable_cores, usable_memory
from graycard.synth import find_llvm

PACKAGES = (
    "graycard",
    "mitsuba",
    "drjit",
    "torch",
    "numpy",
    "scipy",
    "scikit-image",
    "OpenEXR",
    "colour-science",
)
"""Packages whose versions a valid run must record; an installation without extras has them all."""
RECORDED = (*PACKAGES, "flip-evaluator", "opencv-python-headless", "karellen-llvm-core")
"""Packages whose versions a run records where they are installed."""

SCORING = ("graycard.eval:score_predictions", "graycard.eval.metrics.*")
"""Code that scores come from; metrics are named in full, for a table may list the modules of their folder."""


@cache
def scoring_fingerprint() -> str:
    """Return SHA-256 over the code that scores can reach: when a line of it changes, all is scored anew."""
    return code_hash(SCORING)


def environment() -> dict[str, Any]:
    """Versions, commit or wheel, and hardware, for the run record."""
    installed = None if checkout() else find_installed()
    return {
        "packages": {name: package_version(name) for name in RECORDED},
        "python": platform.python_version(),
        "platform": platform.platform(),
        "git_commit": git_commit() or (installed.commit[:12] or None if installed else None),
        **({"installed": to_builtins(installed)} if installed else {}),
        **hardware(),
        "llvm": _llvm(),
    }


def hardware() -> dict[str, Any]:
    """Return what this machine is, without its name."""
    memory = round(usable_memory() / 2**30, 1)
    return {"cpu": cpu_model(), "cores": usable_cores(), "memory_gib": memory, "gpu": gpu_name()}


def _llvm() -> str | None:
    """Return the LLVM that the fast renderer uses here, as in ``19 (pip)``; None without a usable one."""
    llvm = find_llvm()
    return f"{llvm.version} ({llvm.source})" if llvm.usable else None


def package_version(name: str) -> str | None:
    """Version of an installed distribution; None if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def git_commit() -> str | None:
    """Commit of the checkout that graycard runs from, with ``+`` if it was changed; None outside one."""
    root = checkout()
    if root is None:
        return None
    head, changed = git(root, "rev-parse", "--short=12", "HEAD"), is_changed(root)
    return f"{head}+" if head and changed else head or None


def checkout() -> Path | None:
    """Return the root of the checkout that graycard runs from; None outside one, or without git."""
    root = Path(graycard.__file__).resolve().parents[2]
    return root if (root / ".git").exists() and shutil.which("git") else None


def is_changed(root: Path) -> bool:
    """Tell whether files of a checkout differ from its commit; files that git does not know do not count."""
    return bool(git(root, "status", "--porcelain", "--untracked-files=no"))


def unknown_code(root: Path) -> list[str]:
    """Return code inside the package that git does not know or ignores, by its path in the checkout.

    Folders of the package that are links are searched where they lead to.
    """
    package = root.resolve() / "src" / "graycard"
    links = [path.resolve() for path in package.glob("*") if path.is_symlink()]
    folders = [
        place for place in (package, *links) if place.is_dir() and place.is_relative_to(root.resolve())
    ]
    if not folders:
        return []
    found = git(root, "ls-files", "--others", "-z", "--", *map(str, folders)).split("\0")
    return [name for name in found if name.endswith(tuple(SOURCE_SUFFIXES + EXTENSION_SUFFIXES))]


def commit_at(folder: Path) -> str:
    """Return the commit of the repository around a folder; empty without one."""
    return git(folder, "rev-parse", "HEAD") if shutil.which("git") else ""


def git(root: Path, *words: str) -> str:
    """Return what git prints in a checkout; empty if it fails."""
    return _output(["git", "-C", str(root), *words])


def cpu_model() -> str:
    """Name of the processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def gpu_name() -> str | None:
    """Name of the first NVIDIA GPU, asked of its driver (torch takes seconds to load); None without one."""
    if shutil.which("nvidia-smi") is None:
        return None
    names = _output(["nvidia-smi", "--query-gpu=name", "--format=csv,noheader"]).splitlines()
    return names[0] if names else None


def _output(command: list[str]) -> str:
    """Return what a command prints; empty if it fails, hangs or cannot be run."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=20)
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
