# SPDX-License-Identifier: Apache-2.0
"""Timing: time that counts, time that does not, and the measure beside it."""

import itertools
import time
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
import pytest
import torch

from graycard.benchmarks.speed import _machine as machine
from graycard.benchmarks.speed._fma import KERNELS, LANES


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_busy_seconds_leave_out_idle_and_waiting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(machine.os, "sysconf", lambda name: 50)
    stat = write(tmp_path / "stat", "cpu  10 20 30 4000 500 6 7 8 99 99\ncpu0 1 2 3 4\n")
    assert machine.busy_s(stat) == pytest.approx((10 + 20 + 30 + 6 + 7 + 8) / 50)


@pytest.mark.parametrize("text", ["", "cpu  one two\n", "cpu 1 2 3\n"])
def test_a_machine_that_tells_nothing(tmp_path: Path, text: str):
    assert machine.busy_s(write(tmp_path / "stat", text)) is None
    assert machine.busy_s(tmp_path / "none") is None


def fake_load(monkeypatch: pytest.MonkeyPatch, cores: Callable[[int], float]) -> None:
    """Other processes use so many cores while group number n (from 0) is timed."""
    looks = itertools.count()
    started: list[tuple[float, float]] = []

    def busy() -> float:
        number = next(looks)
        now = time.perf_counter(), time.process_time()
        if number % 2 == 0:
            started[:] = [now]
            return 0.0
        wall, own = (after - before for after, before in zip(now, started[0], strict=True))
        return own + cores(number // 2) * wall

    monkeypatch.setattr(machine, "busy_s", busy)


def test_quiet_groups_count(monkeypatch: pytest.MonkeyPatch):
    fake_load(monkeypatch, lambda group: 0.0)
    timing = machine.time_calls(lambda: time.sleep(0.002), machine.Patience(3, 0.01, 10))
    assert (timing.counted, timing.rejected, timing.disturbed) == (3, 0, False)
    assert 2 <= timing.best_ms <= timing.ms
    assert timing.others is not None
    assert timing.others < machine.QUIET


def test_disturbed_groups_do_not_count(monkeypatch: pytest.MonkeyPatch):
    fake_load(monkeypatch, lambda group: 1.0 if group in (0, 2) else 0.0)
    timing = machine.time_calls(lambda: time.sleep(0.005), machine.Patience(2, 0.05, 30))
    assert (timing.counted, timing.rejected) == (2, 2)
    assert timing.others is not None
    assert timing.others < machine.QUIET


def test_without_quiet_the_time_says_so(monkeypatch: pytest.MonkeyPatch):
    fake_load(monkeypatch, lambda group: 1.5)
    timing = machine.time_calls(lambda: time.sleep(0.005), machine.Patience(2, 0.02, 0.1))
    assert timing.disturbed
    assert timing.rejected >= 1
    assert timing.others is not None
    assert timing.others > 1
    assert timing.ms >= 5


def test_where_nobody_knows_every_group_counts(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(machine, "busy_s", lambda: None)
    calls: list[int] = []
    timing = machine.time_calls(lambda: calls.append(1), machine.Patience(4, 0.0, 10))
    assert (timing.counted, timing.others) == (4, None)
    assert len(calls) == 1 + 1 + 4  # to warm up, to see how long it takes, and to be timed


def test_memory_is_that_of_the_peak():
    size = 48 * 2**20

    def grow() -> None:
        block = np.ones(size, np.uint8)
        time.sleep(0.02)
        del block

    assert machine.peak_memory_mib(grow) > 40
    assert machine.peak_memory_mib(lambda: time.sleep(0.02)) < 20


def test_another_c_library_gives_nothing_back(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(machine.ctypes, "CDLL", lambda name: object())
    assert not machine.give_back_memory()


def test_memory_is_no_longer_watched_after_a_failure():
    import threading

    before = threading.active_count()
    with pytest.raises(ZeroDivisionError):
        machine.peak_memory_mib(lambda: 1 / 0)
    assert threading.active_count() == before


def test_threads_are_set_for_a_block_and_put_back():
    before = numba.get_num_threads(), torch.get_num_threads()
    with machine.threads(1):
        assert (numba.get_num_threads(), torch.get_num_threads()) == (1, 1)
    with pytest.raises(RuntimeError, match="inside"), machine.threads(1):
        raise RuntimeError("inside")
    assert (numba.get_num_threads(), torch.get_num_threads()) == before


@pytest.mark.parametrize(("kernel", "chains"), KERNELS)
def test_every_chain_is_computed(kernel: Callable[..., None], chains: int):
    """Else the compiler saw through it, and the peak would be no peak."""
    state = np.random.default_rng(0).random(2 * chains * LANES, np.float32) * 8
    values = state.reshape(2, chains, LANES).copy()
    kernel(state, 2, 3)
    for _ in range(3):
        values = values / 2 + np.float32(0.5)
    sums = state.reshape(2, chains, LANES)[:, 0]
    np.testing.assert_allclose(sums, values.sum(axis=1), rtol=1e-5)


def test_the_peak_is_operations_over_time():
    peak = machine.fma_peak(1, machine.QUICK, rounds=50)
    operations = [2 * chains * LANES * 50 / 1e6 for _, chains in KERNELS]
    assert any(peak.gflops * peak.timing.best_ms == pytest.approx(count) for count in operations)
    assert peak.threads == 1
