# SPDX-License-Identifier: Apache-2.0
"""Ways to what is closed to a fit: each returns what it got, or raises.

A method tries them all and counts those that gave anything. ``ROUTES_SCENE`` names the scene, and
``ROUTES_ASIDE`` a folder with files that are closed as well.
"""

import asyncio
import base64
import ctypes
import gc
import glob
import importlib
import importlib.machinery
import io
import linecache
import mmap
import multiprocessing
import os
import pty
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import tokenize
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from graycard import Camera, open_capture, open_truth
from graycard.io import read_layers
from graycard.methods._gray import GrayMethod

SCENE = Path(os.environ.get("ROUTES_SCENE", "/nowhere/dark/scene"))
ASIDE = Path(os.environ.get("ROUTES_ASIDE", "/nowhere"))
PORT = int(os.environ.get("ROUTES_PORT", "0"))
TRUTH = SCENE / "truth" / "truth.json"
VICTIMS = SCENE / "truth" / "victims"
"""Files that may be destroyed where they are not closed."""
IMAGE = SCENE / "truth" / "views" / "test_001.exr"
LIBC = ctypes.CDLL(None, use_errno=True)
READ = f"open({str(TRUTH)!r}).read()"
ROUTES: dict[str, Callable[[], Any]] = {}

Route = Callable[[], Any]


def route(work: Route) -> Route:
    ROUTES[work.__name__] = work
    return work


def _own(name: str) -> Path:
    return Path(tempfile.mkdtemp()) / name


def _output(command: Any, **how: Any) -> bytes:
    return subprocess.run(command, capture_output=True, check=True, timeout=20, **how).stdout


def _written(path: Path) -> str:
    path.write_text("x")
    path.unlink()
    return "written"


def _text_of(file: Any) -> Any:
    with file:
        return file.read()


def _file(number: int) -> bytes:
    if number < 0:
        raise OSError(ctypes.get_errno(), "refused")
    with os.fdopen(number, "rb") as file:
        return file.read()


ROUTES |= {
    "open": lambda: _text_of(TRUTH.open()),
    "os_open": lambda: _file(os.open(TRUTH, os.O_RDONLY)),
    "bytes_path": lambda: _text_of(open(os.fsencode(TRUTH))),  # noqa: SIM115
    "file_io": lambda: _text_of(io.FileIO(str(TRUTH))),
    "open_code": lambda: _text_of(io.open_code(str(TRUTH))),  # noqa: SIM115
    "read_text": TRUTH.read_text,
    "numpy_fromfile": lambda: np.fromfile(TRUTH, np.uint8),
    "numpy_memmap": lambda: np.array(np.memmap(TRUTH, np.uint8, "r")),
    "linecache": lambda: linecache.getlines(str(TRUTH)),
    "tokenize": lambda: _text_of(tokenize.open(str(TRUTH))),  # noqa: SIM115
    "loader": lambda: importlib.machinery.SourceFileLoader("x", str(TRUTH)).get_data(str(TRUTH)),
    "glob": lambda: glob.glob(f"{SCENE}/truth/*"),
    "listdir": lambda: os.listdir(SCENE / "truth"),
    "scandir": lambda: [entry.name for entry in os.scandir(SCENE / "truth")],
    "walk": lambda: [names for _, _, names in os.walk(SCENE / "truth")],
    "copy": lambda: shutil.copy(TRUTH, _own("copy")),
    "zip": lambda: zipfile.ZipFile(_own("x.zip"), "w").write(TRUTH) or "packed",
    "chdir": lambda: os.chdir(SCENE / "truth") or "there",
    "dots": lambda: (SCENE / "capture" / ".." / "truth" / "truth.json").read_text(),
    "through_root": lambda: Path(f"/proc/self/root{TRUTH}").read_text(),
    "hard_link": lambda: os.link(TRUTH, _own("link")) or "linked",
    "rename": lambda: os.rename(VICTIMS / "folder", VICTIMS / "mine") or "renamed",
    "rename_scene": lambda: os.rename(SCENE.parent / "victim", SCENE.parent / "mine") or "renamed",
    "own_reader": lambda: read_layers(IMAGE),
    "open_truth": lambda: open_truth(SCENE / "truth", check=False),
    "original_capture": lambda: open_capture(SCENE / "capture"),
    "other_scene": lambda: os.listdir(SCENE.parent),
    "look": lambda: (SCENE.parents[1] / "look" / "scene.png").read_bytes(),
    "job_of_another": lambda: (ASIDE / "jobs" / "other" / "job.json").read_bytes(),
    "report": lambda: (ASIDE / "report" / "index.html").read_bytes(),
    "record": lambda: (ASIDE / "run.json").read_bytes(),
    "cat": lambda: _output(["cat", TRUTH]),
    "shell": lambda: _output(f"cat {TRUTH}", shell=True),
    "shell_cd": lambda: _output(f"cd {SCENE}; cat truth/truth.json", shell=True),
    "shell_glob": lambda: _output(f"cat {SCENE.parents[1]}/*/*/tr*/tr*.json", shell=True),
    "cwd": lambda: _output(["cat", "truth/truth.json"], cwd=SCENE),
    "environment": lambda: _output(["sh", "-c", 'cat "$WHERE"'], env={**os.environ, "WHERE": str(TRUTH)}),
    "standard_input": lambda: _output(["sh"], input=f"cat {TRUTH}".encode()),
    "another_python": lambda: _output([sys.executable, "-c", f"print({READ})"]),
    "sqlite": lambda: sqlite3.connect(ASIDE / "jobs" / "data.db").execute("select x from data").fetchall(),
    "render": lambda: importlib.import_module("graycard.synth"),
    "render_part": lambda: importlib.import_module("graycard.synth.families"),
    "parent_memory": lambda: os.open(f"/proc/{os.getppid()}/mem", os.O_RDONLY),
    "parent_environment": lambda: Path(f"/proc/{os.getppid()}/environ").read_bytes(),
    "parent_command": lambda: Path(f"/proc/{os.getppid()}/cmdline").read_bytes(),
    "parent_folder": lambda: os.listdir(f"/proc/{os.getppid()}/cwd"),
    "parent_signal": lambda: os.kill(os.getppid(), 0) or "sent",
    "shared_memory": lambda: _written(Path(f"/dev/shm/routes-{os.getpid()}")),
    "remove": lambda: os.remove(VICTIMS / "one") or "removed",
    "truncate": lambda: os.truncate(VICTIMS / "two", 0) or "cut",
    "mkdir": lambda: os.mkdir(VICTIMS / "new") or "made",
    "overwrite_capture": lambda: (SCENE / "capture" / "victim").write_text("{}"),
    "write_beside_code": lambda: _written(Path(__file__).with_name("mine.txt")),
    "write_home": lambda: Path(os.environ["ROUTES_HOME"], "mine.txt").write_text("x"),
    "rmtree": lambda: shutil.rmtree(VICTIMS / "tree") or "removed",
}


@route
def token() -> Any:
    first = Path("/proc/self/environ").read_bytes()
    return os.environ.get("ROUTES_TOKEN") or first[first.index(b"ROUTES_TOKEN=") :]


@route
def kernel_cache() -> Any:
    folder = Path(os.environ["GRAYCARD_SHARED_KERNELS"], f"mine-{os.getpid()}")
    folder.mkdir(parents=True)
    folder.rmdir()
    return "made"


@route
def through_cwd() -> Any:
    return Path(f"/proc/self/cwd/{os.path.relpath(TRUTH)}").read_text()


@route
def fchdir() -> Any:
    folder = os.open(SCENE, os.O_PATH)
    os.fchdir(folder)
    return Path("truth/truth.json").read_text()


@route
def dir_fd() -> Any:
    folder = os.open("/", os.O_RDONLY | os.O_DIRECTORY)
    return _file(os.open(str(TRUTH).lstrip("/"), os.O_RDONLY, dir_fd=folder))


@route
def dir_fd_of_path() -> Any:
    folder = os.open(SCENE.parent, os.O_PATH)
    return _file(os.open(f"{SCENE.name}/truth/truth.json", os.O_RDONLY, dir_fd=folder))


@route
def descriptor_path() -> Any:
    folder = os.open(SCENE.parents[2], os.O_PATH)
    return Path(f"/proc/self/fd/{folder}/{TRUTH.relative_to(SCENE.parents[2])}").read_text()


@route
def memory_map() -> Any:
    with TRUTH.open("rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ).read()


@route
def symbolic_link() -> Any:
    link = _own("link")
    link.symlink_to(TRUTH)
    return link.read_text()


@route
def link_by_native_code() -> Any:
    link = _own("link")
    if LIBC.symlink(os.fsencode(TRUTH), os.fsencode(link)):
        raise OSError
    return link.read_text()


@route
def native_open() -> Any:
    return _file(LIBC.open(os.fsencode(TRUTH), os.O_RDONLY))


@route
def native_stream() -> Any:
    LIBC.fopen.restype = ctypes.c_void_p
    stream = LIBC.fopen(os.fsencode(TRUTH), b"r")
    if not stream:
        raise OSError
    return stream


@route
def native_hard_link() -> Any:
    if LIBC.link(os.fsencode(TRUTH), os.fsencode(link := _own("link"))):
        raise OSError
    return link.read_bytes()


@route
def native_system() -> Any:
    copy = _own("copy")
    LIBC.system(f"cat {TRUTH} > {copy}".encode())
    return copy.read_bytes()


@route
def native_system_call() -> Any:
    return (
        _file(LIBC.syscall(257, -100, os.fsencode(TRUTH), os.O_RDONLY))
        if os.uname().machine == "x86_64"
        else b""
    )


@route
def memory_of_parent_by_native_code() -> Any:
    buffer = ctypes.create_string_buffer(8)
    shared = ctypes.cast(LIBC.getpid, ctypes.c_void_p).value or 0  # at one place in both
    local, remote = (ctypes.c_size_t * 2)(ctypes.addressof(buffer), 8), (ctypes.c_size_t * 2)(shared, 8)
    if LIBC.process_vm_readv(os.getppid(), local, 1, remote, 1, 0) < 0:
        raise OSError
    return buffer.raw


@route
def trace_of_parent() -> Any:
    if LIBC.ptrace(16, os.getppid(), 0, 0) < 0:
        raise OSError
    return "attached"


@route
def openexr() -> Any:
    import OpenEXR

    return OpenEXR.File(str(IMAGE)).header()


@route
def pillow() -> Any:
    from PIL import Image

    return Image.open(SCENE.parents[1] / "look" / "scene.png").size


@route
def scikit_image() -> Any:
    from skimage.io import imread

    return imread(str(SCENE.parents[1] / "look" / "scene.png"))


@route
def pytorch_file() -> Any:
    import torch

    return torch.from_file(str(TRUTH), False, 16, dtype=torch.uint8)


@route
def safetensors_file() -> Any:
    from safetensors import safe_open

    return safe_open(str(ASIDE / "weights.safetensors"), "np").keys()


@route
def mitsuba_bitmap() -> Any:
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    return np.array(mitsuba.Bitmap(str(IMAGE)))


@route
def base64_command() -> Any:
    hidden = base64.b64encode(f"cat {TRUTH}".encode()).decode()
    return _output(f"echo {hidden} | base64 -d | sh", shell=True)


@route
def terminal() -> Any:
    parts: list[bytes] = []

    def read(number: int) -> bytes:
        parts.append(os.read(number, 1024))
        return parts[-1]

    script = _own("script")
    script.write_text(f"cat {SCENE}/tr*/truth.json")
    if pty.spawn(["sh", str(script)], read):
        raise OSError
    return b"".join(parts)


@route
def replaced_process() -> Any:
    copy = _own("copy")
    if (child := os.fork()) == 0:
        try:
            os.execvp("sh", ["sh", "-c", f'cp {SCENE}/tr""uth/truth.json {copy}'])
        finally:
            os._exit(1)
    os.waitpid(child, 0)
    return copy.read_bytes()


@route
def forked() -> Any:
    copy = _own("copy")
    if (child := os.fork()) == 0:
        try:
            copy.write_bytes(TRUTH.read_bytes())
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    return copy.read_bytes()


@route
def spawned() -> Any:
    return _process_of("spawn")


@route
def forkserver() -> Any:
    return _process_of("forkserver")


def _process_of(how: str) -> bytes:
    copy = _own("copy")
    context: Any = multiprocessing.get_context(how)
    process = context.Process(target=shutil.copyfile, args=(str(TRUTH), str(copy)))
    process.start()
    process.join(20)
    return copy.read_bytes()


@route
def thread() -> Any:
    found: list[str] = []
    one = threading.Thread(target=lambda: found.append(_quiet(TRUTH.read_text)))
    one.start()
    one.join()
    return found[0]


@route
def event_loop() -> Any:
    async def read() -> str:
        return await asyncio.to_thread(TRUTH.read_text)

    return asyncio.run(read())


@route
def without_hook() -> Any:
    """Take the hook's rules away, as Python can with any object that it finds."""
    for thing in gc.get_objects():
        if type(thing).__name__ == "Guard":
            before, thing._closed = thing._closed, ()
            try:
                return TRUTH.read_text()
            finally:
                thing._closed = before
    return TRUTH.read_text()


@route
def names_in_frames() -> Any:
    """The scene's name or folder in variables of whoever called."""
    frame, found = sys._getframe(), []
    while frame is not None:
        found += [v for v in frame.f_locals.values() if SCENE.name in str(v)[:10_000] and v is not frame]
        frame = frame.f_back
    return [thing for thing in found if thing is not SCENE]


@route
def names_in_memory() -> Any:
    """A specification of the fit among all objects."""
    return [thing for thing in gc.get_objects() if type(thing).__name__ in ("FitSpec", "FitJob", "SceneSpec")]


@route
def names_in_arguments() -> Any:
    return [word for word in [*sys.argv, *sys.orig_argv] if SCENE.name in word]


@route
def network() -> Any:
    with socket.create_connection(("127.0.0.1", PORT), 5) as connection:
        return connection.getpeername()


@route
def listening() -> Any:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        return server.getsockname()


@route
def listening_without_address() -> Any:
    with socket.socket() as server:
        server.listen()
        return server.getsockname()


@route
def fast_open() -> Any:
    """TCP that no call of connect opens."""
    with socket.socket() as connection:
        return str(connection.sendto(b"x", socket.MSG_FASTOPEN, ("127.0.0.1", PORT)))


@route
def datagram() -> Any:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as connection:
        return str(connection.sendto(b"x", ("127.0.0.1", PORT)))


@route
def socket_with_a_path() -> Any:
    with socket.socket(socket.AF_UNIX) as connection:
        LIBC.chdir(bytes(ASIDE))  # such a path may have 107 bytes
        connection.connect("socket")
        return "connected"


@route
def letter_to_a_path() -> Any:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as connection:
        LIBC.chdir(bytes(ASIDE))
        return str(connection.sendto(b"x", "letters"))


@route
def message_to_a_path() -> Any:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as connection:
        LIBC.chdir(bytes(ASIDE))
        return str(connection.sendmsg([b"x"], [], 0, "letters"))


@route
def system_v_memory() -> Any:
    """Memory that another fit finds by its number, and that outlives this one."""
    number = LIBC.shmget(0, 4096, 0o600)
    if number < 0:
        raise OSError
    LIBC.shmctl(number, 0, None)
    return "shared"


@route
def end_of_parent() -> Any:
    if LIBC.kill(os.getppid(), signal.SIGURG):  # ignored by who gets it
        raise OSError
    return "sent"


def _quiet(work: Route) -> Any:
    try:
        return work()
    except BaseException:
        return ""


def _tried(work: Route) -> float:
    """Return 1 if a way gave anything, else 0."""
    here = os.getcwd()
    try:
        found = work()
        return float(found is not None and len(found if hasattr(found, "__len__") else [1]) > 0)
    except BaseException:
        return 0.0
    finally:
        if os.getcwd() != here:
            os.chdir(here)


class Routes(GrayMethod):
    """Tries all ways, and goes on."""

    summary = "Looks everywhere"

    @property
    def needs(self) -> tuple[str, ...]:
        return tuple(_quiet(TRUTH.read_text)[:0])

    def fit(self, capture: Any, priors: Any, settings: Any, seed: int, progress: Any) -> Any:
        found = {name: _tried(work) for name, work in ROUTES.items()}
        found["scene_by_name"] = float(SCENE.name in (capture.root / "capture.json").read_text())
        found["scene_by_manifest"] = float(SCENE.name in (capture.root / "manifest.json").read_text())
        late: list[str] = []
        threading.Thread(
            target=lambda: (time.sleep(0.2), late.append(_quiet(TRUTH.read_text))), daemon=True
        ).start()
        return Tells(super().fit(capture, priors, settings, seed, progress), found, late)


class Tells:
    """A gray decomposition that counts the ways which gave anything."""

    def __init__(self, gray: Any, found: dict[str, float], late: list[str]) -> None:
        self.gray, self.found, self.late = gray, found, late
        self.by_attribute = 0.0

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or "gray" not in self.__dict__:
            raise AttributeError(name)
        if _quiet(TRUTH.read_text):
            self.__dict__["by_attribute"] = 1.0
        return getattr(self.gray, name)

    @property
    def provides(self) -> frozenset[str]:
        if _quiet(TRUTH.read_text):
            self.found["property"] = 1.0
        return self.gray.provides

    def render(self, camera: Camera, layers: Any) -> Any:
        if _quiet(TRUTH.read_text):
            self.found["rendering"] = 1.0
        return self.gray.render(camera, layers)

    def counts(self, camera: Camera) -> dict[str, float]:
        time.sleep(0.1)
        beside = {"attribute": self.by_attribute, "late_thread": float(any(self.late))}
        return {"property": 0.0, "rendering": 0.0, **self.found, **beside}
