# SPDX-License-Identifier: Apache-2.0
"""Messages between processes that do not trust each other, and what Landlock opens."""

import json
import os
import platform
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from confined_work import SERVE, ask
from graycard.io import peak_memory_mib, silent
from graycard.processes import (
    Channel,
    ChannelError,
    Limits,
    Message,
    Places,
    landlock_version,
    run_all,
)
from graycard.processes._confined import Confined
from graycard.processes._landlock import LIST, TO_READ, TO_WRITE
from graycard.processes._places import open_code, open_parts, rules_of

Pair = tuple[Channel, socket.socket]


@pytest.fixture
def pair() -> Iterator[Pair]:
    """A channel, and the bare other end."""
    ours, theirs = socket.socketpair()
    yield Channel(ours), theirs
    ours.close()
    theirs.close()


def head(text: str | bytes) -> bytes:
    data = text if isinstance(text, bytes) else text.encode()
    return struct.pack(">Q", len(data)) + data


@pytest.mark.parametrize(
    "values",
    [
        np.arange(6.0).reshape(2, 3),
        np.arange(24, dtype=np.float32).reshape(2, 3, 4)[:, ::2],
        np.array([[True, False]]),
        np.array(3.5),
        np.zeros((0, 3)),
        np.array([np.inf, -np.inf, np.nan]),
        np.arange(3, dtype=">i4"),
        np.arange(5, dtype=np.uint64),
    ],
)
def test_arrays_come_as_they_were(pair: Pair, values: np.ndarray):
    channel, theirs = pair
    other = Channel(theirs)
    other.send(Message("x", {"inf": float("inf"), "text": "ä"}, {"values": values}))
    found = channel.receive()
    assert found.data == {"inf": "inf", "text": "ä"}
    assert found.arrays["values"].dtype == values.dtype.newbyteorder("=")
    np.testing.assert_array_equal(found.arrays["values"], values)


@pytest.mark.parametrize("values", [np.array([object()]), np.array(["text"]), np.array([1j])])
def test_objects_are_not_sent(pair: Pair, values: np.ndarray):
    with pytest.raises(TypeError, match="expected real numbers in values"):
        pair[0].send(Message("x", None, {"values": values}))


@pytest.mark.parametrize(
    "sent",
    [
        head("{"),
        head("[1, 2]"),
        head("[" * 100_000),
        head('{"kind": "x", "data": 1}'),
        head('{"kind": "x", "kind": "y", "data": 1, "arrays": []}'),
        head(b"\xff\xfe"),
        struct.pack(">Q", 2**62),
        head('{"kind": "x", "data": 1, "arrays": [["a", "O", [1]]]}') + b"12345678",
        head('{"kind": "x", "data": 1, "arrays": [["a", "<f8", [-1]]]}'),
        head('{"kind": "x", "data": 1, "arrays": [["a", "<f8", [1.5]]]}'),
        head('{"kind": "x", "data": 1, "arrays": [["a", "<f8,<f8", [1]]]}'),
        head('{"kind": "x", "data": 1, "arrays": [["a", "<f8", [4000000000, 4000000000]]]}'),
        head('{"kind": "x", "data": 1, "arrays": [["a", "|u1", [35184372088832]]]}'),
        head('{"kind": "x", "data": 1, "arrays": [["a", "|u1", [0, 99999999999999999999]]]}'),
        head('{"kind": "x", "data": 1, "arrays": [["a", "|u1", [0, 9223372036854775807, 9]]]}'),
        head('{"kind": "x", "data": 1, "arrays": [["a", "(2", [1]]]}'),
        head('{"kind": "x", "data": 1, "arrays": [["a", "{", [1]]]}'),
        head('{"kind": "x", "data": 1, "arrays": [["a", "|b1", 7]]}'),
        head('{"kind": "x", "data": 1, "arrays": 5}'),
        b"short",
        b"",
    ],
)
def test_what_is_no_message_is_an_error_of_the_channel(pair: Pair, sent: bytes):
    channel, theirs = pair
    theirs.sendall(sent)
    theirs.close()
    with pytest.raises(ChannelError):
        channel.receive()


def test_who_died_is_not_waited_for_even_if_its_children_hold_the_socket():
    ours, theirs = socket.socketpair()
    channel = Channel(ours, is_alive=lambda: False)
    theirs.sendall(head('{"kind": "last", "data": 1, "arrays": []}') + b"cut")
    assert channel.receive().kind == "last"
    with pytest.raises(ChannelError, match="has ended"):
        channel.receive()
    channel.close()
    theirs.close()


def test_notes_that_a_method_has_written_itself_do_no_harm():
    """It has the descriptor, too."""
    notes, written = os.pipe()
    os.write(written, b"[" * 60_000 + b'\nno note\n\xff\n"a\\u0007"\n{"b": ')
    os.close(written)
    confined = Confined(None, None, notes)  # pyright: ignore[reportArgumentType]  # neither is asked
    assert confined.refusals() == (r"a\x07",)
    os.close(notes)


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_memory_of_a_process_that_has_ended_is_no_error():
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        os.waitid(os.P_PID, ended.pid, os.WEXITED | os.WNOWAIT)
        assert peak_memory_mib(ended.pid) >= 0.0, "a zombie"
    assert peak_memory_mib(ended.pid) >= 0.0, "gone"


def test_a_folder_of_code_is_open_but_for_data_in_it(tmp_path: Path):
    for name in ("code/a.py", "code/package/b.py", "code/runs/dataset/truth.json", "code/runs/notes.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    (tmp_path / "link").symlink_to(tmp_path / "code")
    (tmp_path / "code" / "innocent").symlink_to(tmp_path / "code" / "runs" / "dataset")
    data = str(tmp_path / "code" / "runs" / "dataset")
    for entry in ("code", "link"):
        found = [os.path.relpath(path, tmp_path) for path in open_parts(str(tmp_path / entry), [data])]
        assert found == ["code/a.py", "code/package", "code/runs/notes.py"]
    assert list(open_parts(data, [data])) == []
    (tmp_path / "scratch").mkdir()
    places = Places(str(tmp_path / "scratch"), closed=(data,))
    (plain, split, *none), rules = open_code(
        [str(tmp_path / "code" / "package"), str(tmp_path / "code"), data], places
    )
    assert none == []
    assert {os.path.relpath(path, tmp_path): rights for path, rights in rules} == {
        "code/package": TO_READ, "code/package/b.py": TO_READ, "code/a.py": TO_READ,
        "code/runs/notes.py": TO_READ,
    }  # fmt: skip
    assert plain == str(tmp_path / "code" / "package")
    assert {p.relative_to(split).as_posix() for p in Path(split).rglob("*")} >= {
        "a.py",
        "package",
        "runs/notes.py",
    }
    assert not any("truth" in path.name or "innocent" in path.name for path in Path(split).rglob("*"))


def test_of_a_folder_with_code_modules_and_packages_are_open_and_nothing_else(tmp_path: Path):
    """A salt, a dataset or a run may lie there."""
    for name in ("m.py", "package/__init__.py", "package/weights.bin", "a.salt", "data/dark/s/truth.json"):
        (tmp_path / "code" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "code" / name).write_text("")
    code, library = str(tmp_path / "code"), str(tmp_path / "lib" / "site-packages")
    os.makedirs(library)
    found, rules = open_code([code, library], Places(str(tmp_path)))
    assert found == [code, library]
    assert dict(rules) == {
        code: LIST, f"{code}/m.py": TO_READ, f"{code}/package": TO_READ, library: TO_READ
    }  # fmt: skip


def test_rules_open_what_is_handed_and_no_data(tmp_path: Path):
    for name in ("scratch", "weights", "opened", "data"):
        (tmp_path / name).mkdir()
    places = Places(
        str(tmp_path / "scratch"), (str(tmp_path / "weights"),), closed=(str(tmp_path / "data"),),
        opened=(str(tmp_path / "opened"),),
    )  # fmt: skip
    rules = dict(rules_of(places, []))
    own = {k: v for k, v in rules.items() if k.startswith(str(tmp_path))}
    assert own == {
        str(tmp_path / "scratch"): TO_WRITE,
        str(tmp_path / "weights"): TO_READ,
        str(tmp_path / "opened"): TO_WRITE,
    }
    assert not {"/", "/home", "/root", "/tmp", "/proc", "/dev", "/dev/shm", "/etc"} & rules.keys()


def test_data_in_a_folder_of_the_system_are_closed(tmp_path: Path):
    rules = dict(rules_of(Places(str(tmp_path), closed=("/usr/share/data-of-mine",)), []))
    assert "/usr" not in rules
    assert "/usr/share" not in rules
    assert "/usr/lib" in rules


RESTRICTED = """
import os, sys, threading
from graycard.processes._landlock import TO_READ, TO_WRITE, restrict
root = sys.argv[1]
restrict([("/usr", TO_READ), ("/missing", TO_READ), (f"{root}/own", TO_WRITE), (f"{root}/one.txt", TO_READ)])
def can(work):
    try:
        work()
    except PermissionError:
        return False
    return True
def in_thread():
    found = []
    one = threading.Thread(target=lambda: found.append(can(lambda: open(f"{root}/two.txt"))))
    one.start(); one.join()
    return found[0]
print({
    "read": can(lambda: open(f"{root}/one.txt")), "other": can(lambda: open(f"{root}/two.txt")),
    "write": can(lambda: open(f"{root}/one.txt", "a")), "list": can(lambda: os.listdir(root)),
    "own": can(lambda: open(f"{root}/own/x", "w")), "thread": in_thread(),
})
"""


@pytest.mark.skipif(not landlock_version(), reason="this kernel has no Landlock")
def test_a_confined_process_is_restricted_as_a_whole_and_knows_nothing_of_who_started_it(
    monkeypatch: pytest.MonkeyPatch,
):
    """Threads of libraries are bound as well; arguments of a command name a scene."""
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    monkeypatch.setattr(sys, "argv", ["graycard", "fit", "gray", "closed-scene"])
    limits = Limits(60.0, 4096)
    (outcome,) = run_all(ask, ["closed[-]scene"], 1, silent, limits=limits, confines=SERVE)
    assert outcome.reason == ""
    assert set(outcome.value["threads"]) == {"1"}
    assert outcome.value["memory"] == [str(4096 * 2**20)] * 2
    assert outcome.value["found"] == 0


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc's allocator is set")
def test_a_confined_process_keeps_freed_memory_for_the_next_array():
    """Fits run there, and each step makes arrays of the same sizes."""
    (outcome,) = run_all(ask, ["nothing"], 1, silent, limits=Limits(60.0, 4096), confines=SERVE)
    assert outcome.value["faults"][1] < 5


@pytest.mark.skipif(not landlock_version(), reason="this kernel has no Landlock")
def test_landlock_opens_what_rules_say(tmp_path: Path):
    (tmp_path / "own").mkdir()
    for name in ("one.txt", "two.txt"):
        (tmp_path / name).write_text("x")
    run = subprocess.run(
        [sys.executable, "-c", RESTRICTED, str(tmp_path)], capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert json.loads(run.stdout.replace("'", '"').lower()) == {
        "read": True, "other": False, "write": False, "list": False, "own": True, "thread": False,
    }  # fmt: skip


UNIX_SOCKETS = """
import json, os, socket
from graycard.processes._seccomp import refuse_calls
outside = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM); outside.bind("\\0graycard-%d" % os.getpid())
there = outside.getsockname()
assert refuse_calls(unix_sockets=True)
ours, theirs = socket.socketpair()
def can(work):
    try:
        work()
    except PermissionError:
        return False
    return True
def made(family, kind=socket.SOCK_STREAM): return socket.socket(family, kind)
listening = made(socket.AF_UNIX); listening.bind("\\0graycard-own-%d" % os.getpid()); listening.listen()
letters = made(socket.AF_UNIX, socket.SOCK_DGRAM)
print(json.dumps({
    "internet": can(lambda: made(socket.AF_INET)), "netlink": can(lambda: made(socket.AF_NETLINK)),
    "connect": can(lambda: letters.connect(there)), "send to": can(lambda: letters.sendto(b"x", there)),
    "message": can(lambda: letters.sendmsg([b"x"], [], 0, there)), "accept": can(listening.accept),
    "pair": can(lambda: ours.sendall(b"x")) and theirs.recv(1) == b"x",
}))
"""


@pytest.mark.skipif(
    not sys.platform.startswith("linux") or platform.machine() not in ("x86_64", "aarch64"),
    reason="no filter of system calls here",
)
def test_unix_sockets_that_cuda_needs_reach_nobody():
    command = [sys.executable, "-c", UNIX_SOCKETS]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    found = json.loads(ended.stdout)
    assert {name for name, can in found.items() if can} == {"pair"}
    assert len(found) == 7
