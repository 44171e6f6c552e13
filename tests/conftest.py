# SPDX-License-Identifier: Apache-2.0
"""Fixtures that most tests stand on: tiny scenes with closed-form truth, a small disk, weights."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path

import numba
import pytest
from threadpoolctl import threadpool_limits

from graycard import TRACKS, MethodError, RenderError
from graycard.networks import HOME, LPIPS_VARIABLE, SETS, is_whole, weights_home
from graycard.tiny import write_tiny_scene

os.environ.setdefault("OMP_WAIT_POLICY", "passive")
"""Let threads of OpenMP sleep while they wait for work. With a test on each core they take the cores from
each other: a fit of 20 s takes 340 s. PyTorch and Numba, which read this, are not loaded yet."""

REAL_WEIGHTS = "GRAYCARD_TEST_WEIGHTS"
"""Environment variable that keeps where this machine's weights are; tests do not see them unless they ask."""
os.environ.setdefault(REAL_WEIGHTS, str(weights_home()))
os.environ[HOME] = os.path.join(os.path.dirname(__file__), "no-weights-here")
os.environ.pop(LPIPS_VARIABLE, None)

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Variables that a fit sets in its own process; Numba compiles nothing once its own has changed."""

CHEAP = {"run_python", "loaded", "in_process", "world"}
"""Fixtures of a session that cost next to nothing."""


def pytest_sessionstart() -> None:
    """Start Numba's threads, and give each worker of xdist one thread of OpenBLAS.

    A test that sets the number of Numba's threads and starts them would fix it for all after it. Threads of
    OpenBLAS spin while they wait: with a test on each core a small matrix is solved in 57 ms, not in 1 ms.
    """
    numba.get_num_threads()
    if "PYTEST_XDIST_WORKER" in os.environ:
        threadpool_limits(1, "blas")  # NumPy's is loaded already
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@pytest.hookimpl(tryfirst=True)  # xdist's own hook reads the marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Send tests that share a fixture to one worker of xdist: none is built twice. Begin with them.

    Those for a GPU share one worker, too: it has one card. Where there is none they are skipped.
    """
    for item in items:
        if any(item.iter_markers("gpu")):
            reason = without_gpu()
            item.add_marker(pytest.mark.skipif(bool(reason), reason=reason))
            item.add_marker(pytest.mark.xdist_group("gpu"))
            continue
        group = shared_fixture(item)
        if group:
            item.add_marker(pytest.mark.xdist_group(group))
    items.sort(key=lambda item: not any(item.iter_markers("xdist_group")))


@cache
def without_gpu() -> str:
    """Return why the back end ``cuda`` cannot run here; empty where it can."""
    from graycard.methods.splat.gpu import gsplat_kernels  # PyTorch takes long to import

    try:
        gsplat_kernels()
    except MethodError as cause:
        return str(cause)
    return ""


def shared_fixture(item: pytest.Item) -> str:
    """Return the fixture of a session, or else the file, that a test shares with others; empty if neither."""
    info = getattr(item, "_fixtureinfo", None)  # pytest has no public way to ask for the scope of a fixture
    found = [fixtures[-1] for fixtures in info.name2fixturedefs.values()] if info else []
    ours = [fixture for fixture in found if fixture.baseid not in ("", "tests")]  # not pytest's, nor of here
    session = sorted((f.baseid, f.argname) for f in ours if f.scope == "session" and f.argname not in CHEAP)
    if session:
        return "::".join(session[-1])  # of several the same one always, so that none is built by two workers
    return item.nodeid.partition("::")[0] if any(f.scope == "module" for f in ours) else ""


@pytest.fixture(autouse=True)
def threads_as_before() -> Iterator[None]:
    """Put back the numbers of threads that a fit in this very process has set for all that is to come."""
    before = {name: os.environ.get(name) for name in THREADS}
    yield
    for name, value in before.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


@pytest.fixture
def make_scene(tmp_path: Path, write_tiny: Callable[..., Path]) -> Callable[..., Path]:
    """``make_scene(track="dark", scene="tiny-0000", train=3, test=2)`` writes one, gives its folder."""
    return partial(write_tiny, tmp_path / "dataset")


@pytest.fixture(scope="session")
def write_tiny(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """``write_tiny(dataset, **options)`` writes the scene, for fixtures that outlive a test.

    A scene that was written before is copied, which is twenty times as fast.
    """

    @cache
    def written(**options: object) -> Path:
        return write_tiny_scene(tmp_path_factory.mktemp("written"), **options)  # pyright: ignore[reportArgumentType]

    def write(dataset: Path, **options: object) -> Path:
        scene = written(**options)
        folder = Path(dataset) / scene.parent.name / scene.name
        return Path(shutil.copytree(scene, folder, copy_function=shutil.copyfile, dirs_exist_ok=True))

    return write


@pytest.fixture(scope="session")
def tiny_scenes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One scene folder a track, shared and not to be changed."""
    dataset = tmp_path_factory.mktemp("tiny")
    return {track: write_tiny_scene(dataset, track=track) for track in TRACKS}


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 256 KiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(disk)]
    try:
        done = subprocess.run(mount, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("there is no mount command")
    if done.returncode:
        pytest.skip(f"a small file system needs root: {done.stderr.strip()}")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


@pytest.fixture
def llvm() -> str:
    """The variant that works on whole images at once, in use; without LLVM the test is skipped."""
    from graycard.synth import use_renderer  # tests without a renderer need not wait for it
    from graycard.synth.renderer._variant import LLVM_RGB

    try:
        return use_renderer(variant=LLVM_RGB).variant
    except RenderError as reason:
        pytest.skip(str(reason))


@pytest.fixture
def real_weights(monkeypatch: pytest.MonkeyPatch) -> Path:
    """The fetched weights, in use; without all of them the test is skipped, but in CI it fails."""
    folder = Path(os.environ[REAL_WEIGHTS])
    monkeypatch.setenv(HOME, str(folder))
    lacking = [one.name for one in SETS if not all(is_whole(file.name) for file in one.files)]
    if lacking:
        reason = f"needs weights: run {' and '.join(f'`graycard weights {name}`' for name in lacking)}"
        (pytest.fail if os.environ.get("GRAYCARD_REQUIRE_WEIGHTS") else pytest.skip)(reason)
    return folder
