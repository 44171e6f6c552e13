# SPDX-License-Identifier: Apache-2.0
"""Room for records of views: memory while there is some, then files, and the same values in both."""

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import torch

from graycard import Camera
from graycard.io import Room, _room

LARGE = (300, 400)
DTYPES = (torch.float32, torch.float64, torch.bool, torch.int64, torch.uint8)


@pytest.fixture(autouse=True)
def memory_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the memory of this process to the tests that come after."""
    monkeypatch.setattr(_room, "hand_back_freed_memory", lambda: True)


@dataclass(frozen=True, eq=False)
class Part:
    """A record in a record."""

    image: torch.Tensor
    name: str = "part"


class Pair(NamedTuple):
    """Two arrays."""

    first: np.ndarray
    second: np.ndarray | None


@dataclass(frozen=True, eq=False)
class Record:
    """All kinds of values that views have."""

    camera: Camera
    part: Part
    pair: Pair
    layers: dict[str, Any]
    missing: torch.Tensor | None = None


def a_record() -> Record:
    random = np.random.default_rng(0)
    camera = Camera(400, 300, np.eye(3), np.eye(4))
    image, small = torch.from_numpy(random.random((*LARGE, 3))).float(), torch.ones(3)
    pair = Pair(random.random(LARGE) > 0.5, None)
    return Record(camera, Part(image), pair, {"depth": random.random(LARGE), "small": small})


def in_a_file(tensor: torch.Tensor) -> bool:
    """Tell whether the memory of a tensor is a mapped file."""
    address = tensor.data_ptr()
    for line in Path("/proc/self/maps").read_text().splitlines():
        first, last = (int(end, 16) for end in line.split()[0].split("-"))
        if first <= address < last:
            return "graycard-view" in line
    return False


@pytest.mark.parametrize("dtype", DTYPES)
def test_a_tensor_in_a_file_has_the_same_values(dtype: torch.dtype) -> None:
    values = (5 * torch.rand(*LARGE, 3)).to(dtype).transpose(0, 1)
    found = Room(0).keep(values)
    assert in_a_file(found)
    assert found.dtype == dtype
    assert torch.equal(found, values)
    found.zero_()  # it can be written to, as any tensor
    assert not found.any()


def test_a_record_keeps_its_kind_and_what_is_small_stays() -> None:
    record = a_record()
    found = Room(0).keep(record)
    assert found.camera is record.camera
    assert (type(found.part), found.part.name, type(found.pair)) == (Part, "part", Pair)
    assert torch.equal(found.part.image, record.part.image)
    assert np.array_equal(found.pair.first, record.pair.first)
    assert np.array_equal(found.layers["depth"], record.layers["depth"])
    assert found.layers["small"] is record.layers["small"]
    assert found.pair.second is None
    assert found.missing is None
    large = (found.part.image, *map(torch.from_numpy, (found.pair.first, found.layers["depth"])))
    assert all(map(in_a_file, large))


def test_records_stay_in_memory_while_they_fit() -> None:
    room = Room(3 * 4 * 300 * 400)
    first, second, third = torch.rand(*LARGE, 2), torch.rand(*LARGE, 2), torch.rand(*LARGE)
    assert room.keep(first) is first
    assert in_a_file(room.keep(second)), "it does not fit beside the first"
    assert room.keep(third) is third
    assert room.left == 0


def test_the_limit_of_a_fit_makes_its_rooms_smaller(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_room, "free_memory", lambda: 64 << 30)
    monkeypatch.setattr(_room.resource, "getrlimit", lambda kind: (_room.resource.RLIM_INFINITY,) * 2)
    assert Room().left == 2 << 30
    monkeypatch.setattr(_room.resource, "getrlimit", lambda kind: (4 << 30, 8 << 30))
    assert Room().left == 128 << 20


def test_a_record_that_fits_is_the_same_object() -> None:
    record = a_record()
    assert Room(1 << 40).keep(record) is record
    assert Room(0).keep(Pair(np.ones(3), None)).second is None


def test_files_have_no_names_and_go_with_their_tensors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = len(list(Path("/proc/self/fd").iterdir()))
    found = [Room(0).keep(torch.rand(*LARGE)) for _ in range(20)]
    assert not any(tmp_path.iterdir())
    assert len(list(Path("/proc/self/fd").iterdir())) == before, "a capture has more views than files open"
    assert Path("/proc/self/maps").read_text().count(str(tmp_path)) == 20
    del found
    assert str(tmp_path) not in Path("/proc/self/maps").read_text()


@pytest.mark.parametrize("limit", [0, 1 << 40], ids=["in a file", "in memory"])
@pytest.mark.parametrize("dtype", [np.float64, np.float32, bool])
def test_parts_are_joined_as_by_numpy(limit: int, dtype: type) -> None:
    random = np.random.default_rng(0)
    parts = [(2 * random.random((rows, 200))).astype(dtype) for rows in (90, 0, 700, 1)]
    wanted, room = np.concatenate(parts), Room(limit)
    found = room.joined(iter(parts))
    assert found.dtype == wanted.dtype
    assert np.array_equal(found, wanted)
    assert in_a_file(torch.from_numpy(found)) == (limit == 0)
    assert room.left == max(0, limit - wanted.nbytes), "parts take no room once they are joined"


@pytest.mark.parametrize("limit", [0, 1 << 40], ids=["in a file", "in memory"])
def test_one_part_is_copied(limit: int) -> None:
    part = np.ones(LARGE)
    found = Room(limit).joined([part])
    found[:] = 0  # as a median that needs no copy does
    assert part.all()


@pytest.mark.parametrize("dtype", [">f4", "U8"])
def test_parts_of_other_kinds_are_joined_in_memory(dtype: str) -> None:
    parts = [np.ones(LARGE).astype(dtype), np.zeros(LARGE).astype(dtype)]
    assert np.array_equal(Room(0).joined(parts), np.concatenate(parts))


def test_parts_that_differ_are_refused() -> None:
    for other in (np.ones(LARGE, np.float32), np.ones((300, 401)), np.ones(300)):
        with pytest.raises(ValueError, match="expected parts of one type and shape"):
            Room(0).joined([np.ones(LARGE), other])


def test_what_no_file_takes_is_joined_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk has place for the parts, and none for the whole."""
    parts, mapped = [np.ones(LARGE), np.zeros(LARGE)], _room.mapped

    def one_by_one(arrays: list[np.ndarray]) -> torch.Tensor:
        if len(arrays) > 1:
            raise OSError("No space left on device")
        return mapped(arrays)

    monkeypatch.setattr(_room, "mapped", one_by_one)
    assert np.array_equal(Room(0).joined(parts), np.concatenate(parts))


def test_without_a_folder_of_temporary_files_all_stays_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    room, record = Room(0), a_record()
    assert room.keep(record) is record
    monkeypatch.setattr(tempfile, "tempdir", None)
    assert room.keep(record) is record, "it is not tried again for each of thousands of arrays"


def test_where_the_system_maps_no_more_all_stays_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_more(*args: object, **options: object) -> None:
        raise RuntimeError("unable to mmap 480000 bytes: Cannot allocate memory (12)")

    monkeypatch.setattr(torch, "from_file", no_more)
    record = torch.rand(*LARGE)
    assert Room(0).keep(record) is record
    assert np.array_equal(
        Room(0).joined([record.numpy(), record.numpy()]), torch.cat([record, record]).numpy()
    )


def test_on_a_full_disk_all_stays_in_memory() -> None:
    """A limit on the size of files stands in for the disk: a write beyond it fails as on a full one."""
    code = (
        "import resource, signal, torch\n"
        "from graycard.io import Room\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))\n"
        "image = torch.rand(300, 400)\n"
        "assert Room(0).keep(image) is image\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_tensor_with_a_gradient_is_refused() -> None:
    with pytest.raises(ValueError, match="expected tensors without gradient"):
        Room(0).keep(torch.rand(*LARGE, requires_grad=True))


def test_values_that_a_record_holds_twice_are_kept_once() -> None:
    image = torch.rand(*LARGE)
    for limit in (0, 2 * image.nbytes):
        room = Room(limit)
        first, second = room.keep((Part(image), {"again": image}))
        assert first.image is second["again"]
        assert torch.equal(first.image, image)
        assert room.left == max(0, limit - image.nbytes)


@pytest.mark.parametrize("dtype", [">f4", "U8", "O"])
def test_arrays_of_other_kinds_stay_as_they_are(dtype: str) -> None:
    array = np.zeros(LARGE, dtype)
    assert Room(0).keep(array) is array


@pytest.mark.parametrize(("limit", "ends"), [("0", 0), ("1 << 40", 1)])
def test_memory_is_bounded_however_many_views_there_are(limit: str, ends: int) -> None:
    """Forty images of 4 MB in a process that may hold 100 MB more than it does."""
    code = (
        "import resource, torch\n"
        "from pathlib import Path\n"
        "from graycard.io import Room\n"
        "torch.set_num_threads(1)\n"
        "kept = []\n"
        "told = Path('/proc/self/status').read_text().partition('VmData:')[2]\n"
        "most = int(told.split()[0]) * 1024 + 100 * 2**20\n"
        "resource.setrlimit(resource.RLIMIT_DATA, (most, most))\n"
        f"with Room({limit}) as room:\n"
        "    for number in range(40):\n"
        "        kept.append(room.keep(torch.full((1 << 20,), float(number))))\n"
        "assert [float(one[-1]) for one in kept] == list(range(40))\n"
        "joined = room.joined(one.numpy() for one in kept)\n"
        "assert joined[:: 1 << 20].tolist() == list(range(40))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == ends, done.stderr
    assert ("allocate memory" in done.stderr) == bool(ends), done.stderr
