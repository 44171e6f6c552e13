# SPDX-License-Identifier: Apache-2.0
"""Choose the variant of Mitsuba that runs here: ``llvm_ad_rgb`` where LLVM is usable, else ``scalar_rgb``.

On Linux and x86-64 LLVM comes with graycard, as the package ``karellen-llvm-core``; elsewhere the system
may have it.
"""

import os
import platform
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Literal

from graycard import RenderError
from graycard.resources import usable_cores

SCALAR, LLVM_RGB = "scalar_rgb", "llvm_ad_rgb"

OLDEST_LLVM = 16
"""Dr.Jit refuses 14; 15 loads and then aborts the whole process when it compiles a real kernel."""

WHEEL = "karellen-llvm-core"
"""Package of pip that holds LLVM, with the ``libc++`` that it stands on."""

LLVMSource = Literal["environment", "pip", "system"]
"""Source of LLVM: ``DRJIT_LIBLLVM_PATH``, the package of pip, or the system."""

_PATH = "DRJIT_LIBLLVM_PATH"
_PLACES = (
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib64/llvm*/lib*/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
)
_MEND = "With LLVM they render 2 to 4 times faster: {install}"


@dataclass(frozen=True, slots=True)
class LLVM:
    """The LLVM library that was found, or why there is none."""

    path: Path | None
    version: int | None
    """Major version, read from the name of the file."""
    reason: str = ""
    """Why it cannot be used; empty where it can."""
    source: LLVMSource | None = None
    """None where none was found."""

    @property
    def usable(self) -> bool:
        """Return whether Mitsuba can compile with it."""
        return not self.reason

    @property
    def advice(self) -> str:
        """One line on how to get the faster renderer; empty where it is there."""
        return "" if self.usable else f"{self.reason}. {_MEND.format(install=_installation())}"


@dataclass(frozen=True, slots=True)
class Renderer:
    """The renderer in use."""

    variant: str
    llvm: LLVM
    threads: int
    mitsuba: str
    """Version."""
    drjit: str
    """Version."""

    @property
    def advice(self) -> str:
        """One line on how to get the faster renderer; empty where it is in use."""
        return self.llvm.advice


def llvm_version(path: Path) -> int | None:
    """Return the major version that the resolved name of an LLVM library tells, as in ``libLLVM.so.19.1``."""
    resolved = path.resolve()
    in_name = re.search(r"libLLVM[-.]?(?:so\.)?(\d+)", resolved.name)
    in_folder = re.search(r"/llvm(?:@\d+)?[/-](\d+)\b", resolved.parent.as_posix())
    found = in_name or in_folder
    return int(found[1]) if found else None


def find_llvm() -> LLVM:
    """Find the LLVM library to use; Mitsuba is not imported.

    The environment variable ``DRJIT_LIBLLVM_PATH`` decides alone if it is set. Else it is that of pip,
    else the newest of the system.
    """
    chosen, wheel = os.environ.get(_PATH), _library_of_pip()
    if chosen is not None and chosen != str(wheel):  # once it is in use, it is named there too
        return _judge(Path(chosen), "environment", f"{_PATH} names {chosen or 'nothing'}, ")
    if wheel is not None:
        return _judge(wheel, "pip", f"pip's LLVM is {wheel}, ")
    found = sorted(
        ((v, p) for p in _candidates() if (v := llvm_version(p)) is not None), key=lambda f: (f[0], str(f[1]))
    )
    if not found:
        return LLVM(None, None, "No LLVM library was found, so scenes render with scalar_rgb")
    return _judge(found[-1][1], "system", f"the newest LLVM is {found[-1][1]}, ")


def use_renderer(threads: int | None = None, variant: str | None = None) -> Renderer:
    """Choose the Mitsuba variant of this process and say which one it is.

    Args:
        threads: Number of threads; None for one a core.
        variant: A variant to insist on, as in ``"scalar_rgb"``; None for the fastest.

    Raises:
        RenderError: ``variant`` needs LLVM, which is not usable here, or is none that graycard knows.
        ValueError: ``threads`` is not positive.
    """
    if threads is not None and threads < 1:
        raise ValueError(f"expected 1 or more threads, got {threads}")
    llvm = find_llvm()
    if variant not in (None, SCALAR, LLVM_RGB):
        raise RenderError(f"expected {SCALAR} or {LLVM_RGB}, got {variant!r}")
    llvm = _load(llvm)
    if variant == LLVM_RGB and not llvm.usable:
        raise RenderError(f"expected an LLVM library for {LLVM_RGB}, got none. {llvm.advice}")
    name = variant or (LLVM_RGB if llvm.usable else SCALAR)
    count = _activate(name, threads)
    return Renderer(name, llvm, count, version("mitsuba"), version("drjit"))


def can_render(variant: str) -> bool:
    """Return whether this machine can run a variant; Mitsuba is not imported."""
    return variant == SCALAR or (variant == LLVM_RGB and find_llvm().usable)


def _candidates() -> Iterator[Path]:
    prefix = Path(sys.prefix) / "lib"
    for pattern in (*_PLACES, f"{prefix}/libLLVM*.so*", f"{prefix}/libLLVM*.dylib"):
        relative = Path(pattern).relative_to("/").as_posix()
        yield from Path("/").glob(relative)


def _library_of_pip() -> Path | None:
    """Return LLVM's library in the package of pip; None without it, or before its ``libc++`` is linked.

    The links are made when Python starts for the first time after the installation.
    """
    try:
        wheel = distribution(WHEEL)
    except PackageNotFoundError:
        return None
    listed = re.search(r"^[^,\n]*/libLLVM\.so\.[\d.]+(?=,)", wheel.read_text("RECORD") or "", re.MULTILINE)
    path = Path(str(wheel.locate_file(listed[0]))).resolve() if listed else None
    return path if path is not None and any(path.parent.glob("*-linux-gnu/libc++.so.1")) else None


def _installation() -> str:
    """Return the command that brings LLVM to a machine like this one."""
    if sys.platform == "darwin":
        return "brew install llvm"
    if sys.platform == "linux" and platform.machine() == "x86_64":
        return f"pip install --force-reinstall '{WHEEL}<20', or apt-get install libllvm19"
    return "apt-get install libllvm19"


def _judge(path: Path, source: LLVMSource, named: str) -> LLVM:
    found = llvm_version(path)
    wrong = _fault(path, found)
    reason = f"LLVM is not used: {named}{wrong}, so scenes render with scalar_rgb" if wrong else ""
    return LLVM(path, found, reason, source)


def _fault(path: Path, found: int | None) -> str:
    if not path.is_file():
        return "which is no file"
    if found is None:
        return "whose name does not tell its version"
    if found == 15:
        return "and version 15 aborts the process when it compiles"
    return f"and version {found} is too old, {OLDEST_LLVM} or newer is needed" if found < OLDEST_LLVM else ""


def _load(llvm: LLVM) -> LLVM:
    """Have Dr.Jit load the library, and see that it did."""
    if llvm.usable:
        os.environ[_PATH] = str(llvm.path)
    with _silence(() if llvm.usable else (2,)):
        import drjit as dr  # it looks for LLVM on import: not before the path is set

    loaded = dr.detail.llvm_version()[0]
    if llvm.usable and not (dr.has_backend(dr.JitBackend.LLVM) and loaded >= OLDEST_LLVM):
        came = f"version {loaded}" if loaded > 0 else "nothing"
        reason = f"LLVM is not used: Dr.Jit was to load {llvm.path} and loaded {came}"
        return replace(llvm, reason=reason)
    return llvm


@contextmanager
def _silence(descriptors: Iterable[int]) -> Iterator[None]:
    """Dr.Jit complains about LLVM from C++ on import; the advice says it better, and once."""
    kept = {number: os.dup(number) for number in descriptors}
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        for number in kept:
            os.dup2(null, number)
        yield
    finally:
        for number, original in kept.items():
            os.dup2(original, number)
            os.close(original)
        os.close(null)


def _activate(name: str, threads: int | None) -> int:
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(name)
    mi.set_log_level(mi.LogLevel.Error)
    count = threads or usable_cores()
    dr.set_thread_count(count)
    return count
