# SPDX-License-Identifier: Apache-2.0
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

import graycard as gc


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path):
    path = tmp_path / "a.txt"
    gc.write_bytes(path, b"old")
    with pytest.raises(RuntimeError), gc.atomic_path(path) as partial:  # noqa: PT012
        partial.write_bytes(b"half of the new")
        raise RuntimeError
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_hashes_are_those_of_sha256(tmp_path: Path):
    gc.write_bytes(tmp_path / "sub" / "abc", b"abc")
    gc.write_bytes(tmp_path / ".hidden", b"x")
    digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"  # FIPS 180-2, example 1
    assert gc.sha256(tmp_path / "sub" / "abc") == digest
    assert gc.sha256_of_files(tmp_path) == {"sub/abc": digest}


def test_a_folder_that_is_a_file(tmp_path: Path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(
        gc.OutputError, match=r"expected an output folder that can be written to.*another output folder"
    ):
        gc.writable_folder(tmp_path / "file" / "run")


def test_a_folder_without_permission(tmp_path: Path):
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    if os.access(locked, os.W_OK):  # root may write there, but not even root in the process table
        locked = Path("/proc/graycard")
    with pytest.raises(gc.OutputError, match=r"expected an output folder that can be written to, got .*json"):
        gc.write_json(locked / "x.json", {})


def test_new_files_follow_the_umask(tmp_path: Path):
    gc.write_bytes(tmp_path / "a", b"")
    (tmp_path / "b").touch()
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


def test_a_full_disk(small_disk: Path):
    noise = np.random.default_rng(0).random((256, 256, 3), np.float32)
    with pytest.raises(gc.OutputError, match=r"(?s)expected room.*Free some space.*goes on where it stopped"):
        gc.write_bytes(small_disk / "a.bin", noise.tobytes())
    with pytest.raises(gc.OutputError, match=r"(?s)expected room.*Free some space.*goes on where it stopped"):
        gc.write_rgb(small_disk / "a.exr", noise)
    assert list(small_disk.iterdir()) == []


def test_errors_survive_a_process_boundary():
    error = gc.UnknownNameError("suite", "dmo", ["demo", "smoke"], "Or a path")
    assert "did you mean 'demo'?" in str(error)
    back = pickle.loads(pickle.dumps(error))
    assert str(back) == str(error)
    assert isinstance(back, gc.UnknownNameError)
