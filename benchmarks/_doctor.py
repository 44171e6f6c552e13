# SPDX-License-Identifier: Apache-2.0
"""State of this machine, and what to do for the rest."""

import os
from dataclasses import dataclass
from pathlib import Path

from graycard import OutputError, __version__, absent_packages, install_command
from graycard.benchmarks._installed import find_installed
from graycard.benchmarks._sources import cpu_model, git_commit, gpu_name, package_version
from graycard.io import free_mib, lock_words
from graycard.networks import LPIPS_VARIABLE, SETS, state_of, weights_home
from graycard.processes import landlock_version
from graycard.resources import usable_cores, usable_memory
from graycard.synth import find_llvm

ROOM_MIB = 20 * 1024
"""Runs of 256 pixels fit into this, by their costs: at most 8 scenes of 440 MB each, and 88 fits of 190."""

TRUST = (
    "methods and TorchScript files (--priors pretrained:FOLDER with .pt) are programs: they run in the "
    "sandbox, or with your rights where there is none; safetensors, images and records are data. See "
    "docs/explanation/security.md"
)
"""Things that run as programs here, whoever made them."""

_SOURCES = {"pip": "from pip", "system": "of the system", "environment": "named by DRJIT_LIBLLVM_PATH"}


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of ``graycard doctor``."""

    name: str
    found: str
    advice: str = ""
    """Advice; empty if all is well."""


def findings(folder: Path) -> list[Finding]:
    """Return Renderer, processor, GPU, weights, sandbox and disk, without loading a renderer or torch.

    Args:
        folder: Where runs would go.
    """
    return [
        _packages(),
        _renderer(),
        Finding("processor", f"{cpu_model()}, {_cores()}, {round(usable_memory() / 2**30, 1):g} GiB"),
        Finding("GPU", gpu_name() or "none; everything runs on the CPU"),
        Finding("torch", package_version("torch") or "none"),
        _weights(),
        _sandbox(),
        Finding("trust", TRUST),
        _disk(folder),
        _locks(folder),
    ]


def _packages() -> Finding:
    """Return the version and origin of graycard, and what of its packages is missing."""
    installed = find_installed()
    origin = f"wheel {installed.sha256[:12]}" if installed else git_commit() or "no checkout and no wheel"
    changed = f", {len(installed.changed)} files changed" if installed and installed.changed else ""
    absent = absent_packages()
    lacks = f", without {', '.join(absent)}" if absent else ""
    advice = f"a light installation; for all verbs run {install_command(absent[0])}" if absent else ""
    return Finding("graycard", f"{__version__}, {origin}{changed}{lacks}", advice)


def _renderer() -> Finding:
    if package_version("mitsuba") is None:
        return Finding("renderer", "none: Mitsuba is not installed")
    llvm = find_llvm()
    found = f"LLVM {llvm.version} {_SOURCES.get(str(llvm.source), '')}, {llvm.path}"
    variant = f"llvm_ad_rgb ({found})" if llvm.usable else "scalar_rgb"
    return Finding("renderer", f"Mitsuba {package_version('mitsuba')}, {variant}", llvm.advice)


def _cores() -> str:
    count = usable_cores()
    return f"{count} core{'s' * (count != 1)}"


def _sandbox() -> Finding:
    """Return what closes truth to fits on this machine."""
    if version := landlock_version():
        return Finding("sandbox", f"Landlock {version}, and an audit hook of Python")
    alone = "an audit hook of Python alone: this kernel has no Landlock"
    return Finding("sandbox", alone, "run methods of strangers in a container (docs/explanation/security.md)")


def _weights() -> Finding:
    """Return the weights of networks that scores and losses use; those that were fetched are checked."""
    states = {one.name: state_of(one) for one in SETS}
    found = [f"{name} {state}" for name, state in states.items()]
    if own := os.environ.get(LPIPS_VARIABLE):
        found.append(f"LPIPS uses {own}, which {LPIPS_VARIABLE} names")
    lacking = [o for o in SETS if states[o.name] != "fetched" and not (own and o.name == "lpips")]
    advice = [f"`graycard weights {one.name}` for {one.purpose}" for one in lacking]
    where = f" in {weights_home()}" if set(states.values()) != {"not fetched"} else ""
    return Finding("weights", f"{', '.join(found)}{where}", f"run {' and '.join(advice)}" if advice else "")


def _disk(folder: Path) -> Finding:
    free = free_mib(folder)
    large = f"runs of 256 pixels take up to {ROOM_MIB // 1024} GiB; `graycard plan` tells what yours takes"
    advice = "" if free > ROOM_MIB else large
    return Finding("disk", f"{free / 1024:.1f} GiB free at {folder}", advice)


def _locks(folder: Path) -> Finding:
    """Return what keeps two machines from the same work in a folder."""
    try:
        return Finding("locks", lock_words(folder) or f"those of the kernel at {folder}")
    except OutputError as error:
        return Finding("locks", f"unknown at {folder}", str(error))
