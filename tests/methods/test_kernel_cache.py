# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels are addressed by the code that they were made from."""

import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from graycard.methods import _numba
from graycard.methods._kernel_places import linked_gpu_kernels
from graycard.methods._numba import KernelCacheLocator, code_digest, reached_files, remove_unused

METHODS = Path(_numba.__file__).resolve().parent
FORWARD = METHODS / "splat" / "raster" / "_forward.py"


def forget() -> None:
    """Let the next question read files anew."""
    for function in (reached_files, code_digest, _numba._imported_files, _numba._file_of):
        function.cache_clear()


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Another checkout of the engine, where files are looked for until the test ends."""
    root = tmp_path / "graycard"
    shutil.copytree(
        METHODS / "splat", root / "methods" / "splat", ignore=shutil.ignore_patterns("__pycache__")
    )
    for name in ("_numba.py", "_kernel_places.py"):
        shutil.copy(METHODS / name, root / "methods")
    forget()
    monkeypatch.setattr(_numba, "package_folder", lambda package: root.joinpath(*package.split(".")[1:]))
    yield root / "methods"
    forget()


def test_a_kernel_reaches_the_files_that_it_was_made_from():
    names = {str(path.relative_to(METHODS)) for path in reached_files(FORWARD) if METHODS in path.parents}
    assert {"splat/raster/_forward.py", "splat/raster/_blocks.py", "splat/simd/_vector.py"} <= names
    assert len(names) == len(reached_files(FORWARD)), "no kernel depends on the vocabulary"
    assert not {name for name in names if name.startswith(("surfels/", "goris/"))}


def test_an_equal_checkout_shares_kernels(checkout: Path, monkeypatch: pytest.MonkeyPatch):
    there = code_digest(checkout / "splat" / "raster" / "_forward.py")
    monkeypatch.undo()
    forget()
    assert there == code_digest(FORWARD)


@pytest.mark.parametrize("file", ["raster/_forward.py", "raster/_blocks.py", "simd/_vector.py"])
def test_a_change_of_any_reached_file_is_seen(checkout: Path, file: str):
    kernel = checkout / "splat" / "raster" / "_forward.py"
    before = code_digest(kernel)
    with (checkout / "splat" / file).open("a") as text:
        text.write("PLANTED = 1\n")
    forget()
    assert code_digest(kernel) != before


def test_a_change_elsewhere_leaves_kernels_alone(checkout: Path):
    kernel = checkout / "splat" / "raster" / "_forward.py"
    before = code_digest(kernel)
    with (checkout / "splat" / "trace" / "_backward.py").open("a") as text:
        text.write("PLANTED = 1\n")
    forget()
    assert code_digest(kernel) == before


def test_names_in_brackets_count(checkout: Path):
    kernel = checkout / "splat" / "raster" / "_forward.py"
    source = "from graycard.methods.splat.trace import (\n    _masks,  # a remark\n    _beam as beam,\n)\n"
    kernel.write_text(source)
    forget()
    assert checkout / "splat" / "trace" / "_beam.py" in reached_files(kernel)


def kernel_of_nobody() -> None:
    """Lies outside of graycard."""


def test_functions_of_others_are_left_to_numba():
    assert KernelCacheLocator.from_function(kernel_of_nobody, __file__) is None


def test_a_cache_that_cannot_be_written_is_left_to_numba(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "file").touch()
    monkeypatch.setattr(_numba, "_own_root", lambda: tmp_path / "file")
    assert KernelCacheLocator.from_function(forget, str(FORWARD)) is None


def test_numba_asks_for_the_folder_of_the_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(_numba, "_own_root", lambda: tmp_path)
    found = KernelCacheLocator.from_function(forget, str(FORWARD))
    assert found is not None
    assert Path(found.get_cache_path()).name == f"raster_forward-{code_digest(FORWARD)[:16]}"
    assert found.get_source_stamp() == code_digest(FORWARD)


def test_kernels_that_nobody_uses_are_removed(tmp_path: Path):
    old, new, other = (tmp_path / name for name in ("a-0123456789abcdef", "b-0123456789abcdef", "mine"))
    for folder in (old, new, other):
        folder.mkdir()
    for folder in (old, other):
        os.utime(folder, (0, time.time() - 40 * 86400))
    assert remove_unused(tmp_path) == [old]
    assert sorted(tmp_path.iterdir()) == [new, other]


def test_a_confined_process_finds_what_was_compiled_for_a_gpu(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for name in ("TORCH_EXTENSIONS_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert linked_gpu_kernels(tmp_path / "a") == ()
    compiled = tmp_path / ".cache" / "torch_extensions"
    (compiled / "gsplat_cuda").mkdir(parents=True)
    assert linked_gpu_kernels(tmp_path / "b") == (str(compiled),)
    assert (tmp_path / "b" / "torch_extensions" / "gsplat_cuda").is_dir()
    monkeypatch.setenv("TORCH_EXTENSIONS_DIR", str(tmp_path / "elsewhere"))
    assert linked_gpu_kernels(tmp_path / "c") == ()
