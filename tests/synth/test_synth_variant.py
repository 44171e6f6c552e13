# SPDX-License-Identifier: Apache-2.0
"""Choice of the renderer, without ever loading a library that would abort the process."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from graycard import RenderError
from graycard.synth import find_llvm, use_renderer
from graycard.synth.renderer import _variant as variant_module
from graycard.synth.renderer._variant import LLVM_RGB, SCALAR, can_render, llvm_version

PATH = "DRJIT_LIBLLVM_PATH"
RENDER_AND_LOOK = """
import graycard.synth
renderer = graycard.synth.use_renderer(variant="llvm_ad_rgb")
import drjit, mitsuba
assert mitsuba.render(mitsuba.load_dict(mitsuba.cornell_box()), spp=1).shape[2] == 3
mapped = {line.split()[-1] for line in open("/proc/self/maps") if "libLLVM" in line}
assert mapped == {str(renderer.llvm.path)}, mapped
print(renderer.llvm.source, renderer.llvm.version, drjit.detail.llvm_version()[0])
"""
RunPython = Callable[..., subprocess.CompletedProcess[str]]


def library(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(b"")
    return folder / name


@pytest.fixture
def system_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine on which pip brought no LLVM, and the environment names none."""
    monkeypatch.delenv(PATH, raising=False)
    monkeypatch.setattr(variant_module, "WHEEL", "no-such-package")
    monkeypatch.setattr(sys, "prefix", "/nowhere")


@pytest.fixture
def wheel(tmp_path: Path, system_only: None, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The library of an installed package ``llvm-of-pip``, and a newer one of the system."""
    record = tmp_path / "site" / "llvm_of_pip-1.0.dist-info"
    record.mkdir(parents=True)
    (record / "METADATA").write_text("Metadata-Version: 2.1\nName: llvm-of-pip\nVersion: 1.0\n")
    listed = (
        "../include/a.h,,\n../lib/libLLVM-19.so,,\n../lib/libLLVM.so,,\n../lib/libLLVM.so.19.1,sha256=x,3\n"
    )
    (record / "RECORD").write_text(listed)
    library(tmp_path / "lib" / "x86_64-unknown-linux-gnu", "libc++.so.1")
    library(tmp_path / "system", "libLLVM.so.21.1")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    monkeypatch.setattr(variant_module, "WHEEL", "llvm-of-pip")
    monkeypatch.setattr(variant_module, "_PLACES", (f"{tmp_path}/system/libLLVM*.so*",))
    return library(tmp_path / "lib", "libLLVM.so.19.1")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("libLLVM-14.so.1", 14),
        ("libLLVM.so.19.1", 19),
        ("libLLVM-16.so", 16),
        ("libLLVM-17.0.6.so", 17),
        ("llvm@18/lib/libLLVM.dylib", None),
        ("Cellar/llvm/20.1.2/lib/libLLVM.dylib", 20),
        ("lib/llvm-21/lib/libLLVM.so", 21),
        ("libLLVM.so", None),
    ],
)
def test_version_is_read_from_the_name(tmp_path: Path, name: str, expected: int | None) -> None:
    path = tmp_path / name
    assert llvm_version(library(path.parent, path.name)) == expected


def test_version_follows_links(tmp_path: Path) -> None:
    link = tmp_path / "libLLVM-99.so"
    link.symlink_to(library(tmp_path, "libLLVM.so.19.1"))
    assert llvm_version(link) == 19


def test_the_library_of_pip_goes_before_those_of_the_system(wheel: Path) -> None:
    found = find_llvm()
    assert (found.path, found.version, found.usable, found.source) == (wheel, 19, True, "pip")
    assert found.advice == ""


def test_the_environment_goes_before_pip(wheel: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    named = library(wheel.parent / "mine", "libLLVM.so.18.1")
    monkeypatch.setenv(PATH, str(named))
    assert (find_llvm().path, find_llvm().source) == (named, "environment")
    monkeypatch.setenv(PATH, "/nowhere/libLLVM.so")
    assert not find_llvm().usable
    monkeypatch.setenv(PATH, str(wheel))
    assert find_llvm().source == "pip", "as it is named once it is in use"


@pytest.mark.parametrize(
    "absent", ["lib/x86_64-unknown-linux-gnu/libc++.so.1", "site/llvm_of_pip-1.0.dist-info/RECORD"]
)
def test_a_package_that_is_not_whole_gives_way_to_the_system(
    wheel: Path, tmp_path: Path, absent: str
) -> None:
    (tmp_path / absent).unlink()
    found = find_llvm()
    assert (found.path, found.source) == (tmp_path / "system" / "libLLVM.so.21.1", "system")


def test_the_library_of_pip_is_the_one_that_is_loaded(
    run_python: RunPython, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(PATH, raising=False)
    if find_llvm().source != "pip":
        pytest.skip("pip brought no LLVM here")
    done = run_python(RENDER_AND_LOOK)
    assert done.stdout.split() == ["pip", "19", "19"], done.stderr


def test_the_newest_library_is_found(
    tmp_path: Path, system_only: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("libLLVM-14.so.1", "libLLVM.so.19.1", "libLLVM-16.so.1", "libLLVM.so"):
        library(tmp_path, name)
    monkeypatch.setattr(variant_module, "_PLACES", (f"{tmp_path}/libLLVM*.so*",))
    found = find_llvm()
    assert (found.path, found.version, found.usable) == (tmp_path / "libLLVM.so.19.1", 19, True)
    assert found.advice == ""
    assert can_render(LLVM_RGB)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("libLLVM-15.so.1", "version 15 aborts the process"),
        ("libLLVM-14.so.1", "version 14 is too old, 16 or newer is needed"),
        ("libLLVM.so", "does not tell its version"),
    ],
)
def test_an_unfit_library_is_refused_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, reason: str
) -> None:
    path = library(tmp_path, name)
    monkeypatch.setenv(PATH, str(path))
    found = find_llvm()
    assert not found.usable
    assert reason in found.advice
    assert str(path) in found.advice
    assert "install" in found.advice
    assert "\n" not in found.advice


def test_the_newest_that_was_found_is_refused_when_too_old(
    tmp_path: Path, system_only: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    library(tmp_path, "libLLVM-15.so.1")
    monkeypatch.setattr(variant_module, "_PLACES", (f"{tmp_path}/libLLVM*.so*",))
    assert "version 15 aborts" in find_llvm().reason


def test_a_missing_library_is_named(no_llvm: str) -> None:
    assert "names /nowhere/libLLVM.so.19.1, which is no file" in find_llvm().reason
    assert not can_render(LLVM_RGB)
    assert can_render(SCALAR)
    assert not can_render("cuda_ad_rgb")


def test_no_library_at_all(system_only: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(variant_module, "_PLACES", ())
    found = find_llvm()
    assert (found.path, found.version, found.source) == (None, None, None)
    assert "No LLVM library was found" in found.advice


@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_the_advice_suits_the_platform(no_llvm: str, monkeypatch: pytest.MonkeyPatch, platform: str) -> None:
    monkeypatch.setattr(sys, "platform", platform)
    assert ("brew install llvm" in find_llvm().advice) == (platform == "darwin")
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    assert ("apt-get install libllvm19" in find_llvm().advice) == (platform == "linux")
    assert "pip install" not in find_llvm().advice
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    assert ("pip install" in find_llvm().advice) == (platform == "linux")


def test_scalar_rgb_is_used_without_llvm(no_llvm: str) -> None:
    renderer = use_renderer(threads=2)
    assert (renderer.variant, renderer.threads) == (SCALAR, 2)
    assert renderer.advice.startswith("LLVM is not used")
    assert renderer.mitsuba.startswith("3.9")


def test_llvm_is_used_where_it_is(run_python: RunPython) -> None:
    if not find_llvm().usable:
        pytest.skip("no LLVM library here")
    done = run_python("import graycard.synth as s; r = s.use_renderer(); print(r.variant, repr(r.advice))")
    assert done.stdout.split() == [LLVM_RGB, "''"]


def test_insisting_on_llvm_without_it_fails(no_llvm: str) -> None:
    with pytest.raises(RenderError, match="expected an LLVM library for llvm_ad_rgb, got none"):
        use_renderer(variant=LLVM_RGB)


def test_bad_requests_are_refused() -> None:
    with pytest.raises(ValueError, match="expected 1 or more threads, got 0"):
        use_renderer(threads=0)
    with pytest.raises(RenderError, match="expected scalar_rgb or llvm_ad_rgb, got 'cuda_ad_rgb'"):
        use_renderer(variant="cuda_ad_rgb")


def test_a_library_that_does_not_load_is_not_used(tmp_path: Path, run_python: RunPython) -> None:
    code = "import graycard.synth as s; r = s.use_renderer(); print(r.variant, r.advice)"
    done = run_python(code, **{PATH: str(library(tmp_path, "libLLVM.so.19.1"))})
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("scalar_rgb LLVM is not used: Dr.Jit was to load")


def test_the_fallback_says_nothing_but_the_advice(run_python: RunPython) -> None:
    code = "import graycard.synth as s; print(s.use_renderer().variant)"
    done = run_python(code, **{PATH: "/nowhere/libLLVM.so"})
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, SCALAR, "")


def test_asking_for_llvm_imports_no_renderer(run_python: RunPython) -> None:
    code = (
        "import sys, graycard.synth as s; s.find_llvm(); "
        "print(sorted({'mitsuba', 'drjit', 'colour', 'torch'} & sys.modules.keys()))"
    )
    assert run_python(code).stdout.strip() == "[]"
