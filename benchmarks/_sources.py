# SPDX-License-Identifier: Apache-2.0
"""Where numbers come from: versions, commit, hardware, and the hash of the code that scores."""

import os
import platform
import shutil
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import psutil

import graycard
from graycard.io import code_hash
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
    """Versions, commit and hardware, for the run record."""
    return {
        "packages": {name: package_version(name) for name in RECORDED},
        "python": platform.python_version(),
        "platform": platform.platform(),
        "git_commit": git_commit(),
        "cpu": cpu_model(),
        "cores": usable_cores(),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "gpu": gpu_name(),
        "llvm": _llvm(),
    }


def _llvm() -> str | None:
    """Return the LLVM that the fast renderer uses here, as in ``19 (pip)``; None without a usable one."""
    llvm = find_llvm()
    return f"{llvm.version} ({llvm.source})" if llvm.usable else None


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def package_version(name: str) -> str | None:
    """Version of an installed distribution; None if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def git_commit() -> str | None:
    """Commit of the checkout that graycard runs from, with ``+`` if it was changed; None outside one."""
    root = Path(graycard.__file__).resolve().parents[2]
    if not (root / ".git").exists() or shutil.which("git") is None:
        return None
    head = _output(["git", "-C", str(root), "rev-parse", "--short=12", "HEAD"])
    changed = _output(["git", "-C", str(root), "status", "--porcelain", "--untracked-files=no"])
    return f"{head}+" if head and changed else head or None


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
    """What a command prints; empty if it fails, hangs or cannot be run."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=20)
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
