# SPDX-License-Identifier: Apache-2.0
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

from graycard import OutputError, UnknownNameError
from graycard.io import (
    atomic_path,
    sha256,
    sha256_of_files,
    writable_folder,
    write_bytes,
    write_json,
    write_rgb,
)


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path):
    path = tmp_path / "a.txt"
    write_bytes(path, b"old")
    with pytest.raises(RuntimeError), atomic_path(path) as partial:  # noqa: PT012
        partial.write_bytes(b"half of the new")
        raise RuntimeError
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_hashes_are_those_of_sha256(tmp_path: Path):
    write_bytes(tmp_path / "sub" / "abc", b"abc")
    write_bytes(tmp_path / ".hidden", b"x")
    digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"  # FIPS 180-2, example 1
    assert sha256(tmp_path / "sub" / "abc") == digest
    assert sha256_of_files(tmp_path) == {"sub/abc": digest}


def test_a_folder_that_is_a_file(tmp_path: Path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(
        OutputError, match=r"expected an output folder that can be written to.*another output folder"
    ):
        writable_folder(tmp_path / "file" / "run")


def test_a_folder_without_permission(tmp_path: Path):
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    if os.access(locked, os.W_OK):  # root may write there, but not even root in the process table
        locked = Path("/proc/graycard")
    with pytest.raises(OutputError, match=r"expected an output folder that can be written to, got .*json"):
        write_json(locked / "x.json", {})


def test_new_files_follow_the_umask(tmp_path: Path):
    write_bytes(tmp_path / "a", b"")
    (tmp_path / "b").touch()
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


def test_a_full_disk(small_disk: Path):
    noise = np.random.default_rng(0).random((256, 256, 3), np.float32)
    with pytest.raises(OutputError, match=r"(?s)was not written.*Free some space.*goes on where it stopped"):
        write_bytes(small_disk / "a.bin", noise.tobytes())
    with pytest.raises(OutputError, match=r"(?s)was not written.*Free some space.*goes on where it stopped"):
        write_rgb(small_disk / "a.exr", noise)
    assert list(small_disk.iterdir()) == []


def test_errors_survive_a_process_boundary():
    error = UnknownNameError("suite", "dmo", ["demo", "smoke"], "Or a path")
    assert "did you mean 'demo'?" in str(error)
    back = pickle.loads(pickle.dumps(error))
    assert str(back) == str(error)
    assert isinstance(back, UnknownNameError)


@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="this system has no such device")
def test_a_device_is_not_replaced_by_a_file(tmp_path: Path):
    path = tmp_path / "a.json"
    path.symlink_to("/dev/full")  # a link to it: a fault must not take the device itself
    with pytest.raises(OutputError, match="which is a device"):
        write_json(path, {})
    assert path.is_symlink()
