# SPDX-License-Identifier: Apache-2.0
"""Jobs on Dask workers end as they do in worker processes, also where workers and schedulers do not last."""

import dataclasses
import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, cast

import pytest

from graycard.benchmarks._run_record import of_machines
from graycard.benchmarks._sources import hardware
from graycard.io import silent
from graycard.machines import ClusterSpec, MachineError, Machines, _origin, connected
from graycard.machines import _engine as engine
from graycard.machines._hand import Errand, Placed
from graycard.machines._origin import differences, origin
from graycard.processes import USUAL, Limits, Outcome, StandingWorker
from graycard.synth import LLVM
from worker_jobs import (
    die_at_one,
    end,
    leave_mark,
    refuse_to_write,
    tell_folder,
    tell_looks,
    tell_memory,
    tell_process,
    tick_of,
)

if TYPE_CHECKING:
    from distributed import Client

pytest.importorskip("distributed", reason="needs distributed (`pip install 'graycard[cluster]'`)")


@pytest.fixture(scope="module")
def machines() -> Iterator[Machines]:
    """Two workers of this machine, that offer what two kinds of job ask for."""
    from dask.config import set as set_options

    heard: list[str] = []
    usual = {"distributed.worker.profile.enabled": True, "distributed.admin.tick.interval": "20ms"}
    with (
        set_options(usual),
        connected(ClusterSpec("local", workers=2, memory_gib=2.0), heard.append) as found,
    ):
        assert heard[0].startswith("dashboard: http://127.0.0.1:")
        yield found


def test_outcomes_come_in_the_order_of_the_jobs(machines: Machines) -> None:
    heard: list[str] = []
    outcomes = machines.run_all(end, ["a", "b", "c", "d"], 1, lambda done, what: heard.append(what))
    assert [outcome.value for outcome in outcomes] == ["a", "b", "c", "d"]
    assert heard == ["1 of 4", "2 of 4", "3 of 4", "4 of 4"]


def test_a_worker_process_does_as_many_jobs_as_are_said_and_is_no_dask_worker(machines: Machines) -> None:
    found = machines.run_all(tell_process, range(6), 1, silent, tasks_each=3)
    ids = {outcome.value for outcome in found}
    assert 2 <= len(ids) <= 4
    hands = cast("dict[str, int]", machines.client.run(os.getpid))
    assert not ids & {*hands.values()}
    alone = machines.run_all(tell_process, range(3), 1, silent)
    assert len({outcome.value for outcome in alone}) == 3


ENDS = {"exit 7": "exit code 7", "killed": "exit code -9", "hang": "expected an end within 5 s"}


def test_each_way_to_end_fails_its_own_job_as_in_a_process(machines: Machines) -> None:
    outcomes = machines.run_all(end, [*ENDS, "well"], 1, silent, limits=Limits(5.0))
    found = dict(zip([*ENDS, "well"], outcomes, strict=True))
    assert found["well"] == Outcome(value="well")
    assert {how: words in found[how].reason for how, words in ENDS.items()} == dict.fromkeys(ENDS, True)


def test_what_is_found_is_not_handed_out(machines: Machines) -> None:
    found = machines.run_all(
        die_at_one, range(2), 1, silent, lambda n: Outcome(reused=True, value="found") if n == 1 else None
    )
    assert [outcome.value for outcome in found] == [0, "found"]


def test_memory_of_a_job_is_that_of_the_spec(machines: Machines) -> None:
    (outcome,) = machines.run_all(tell_memory, [0], 1, silent)
    assert outcome.value == 2 * 2**30
    (outcome,) = machines.run_all(tell_memory, [0], 1, silent, limits=Limits(None, 1024))
    assert outcome.value == 2**30


def test_each_worker_is_asked(machines: Machines) -> None:
    found = machines.ask(os.getpid)
    assert len({*found}) == 2
    assert os.getpid() not in found
    told = of_machines(machines)["machines"]
    assert [(kind["workers"], kind["cpu"]) for kind in told] == [(2, hardware()["cpu"])]
    assert of_machines(None) == {}


def test_workers_of_this_machine_leave_its_cores_to_the_jobs(machines: Machines) -> None:
    """By default Dask looks at each 150 times a second."""
    assert machines.ask(tell_looks) == [(False, "500ms")] * 2
    assert machines.client.run_on_scheduler(tick_of) == 500
    assert tell_looks() == (True, "20ms")  # other work of this process with Dask is not touched


def test_jobs_work_in_the_folder_of_the_bench(
    machines: Machines, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (outcome,) = machines.run_all(tell_folder, [0], 1, silent)
    assert outcome.value == str(tmp_path)


def test_a_machine_without_that_folder_ends_the_run() -> None:
    outcome = Placed(tell_folder, Path("/not/there"))(0)
    assert outcome.fatal
    assert outcome.reason.startswith("expected /not/there, where the bench runs, got No such file")


def test_a_disk_that_is_full_ends_the_run_and_names_the_machine(machines: Machines) -> None:
    with pytest.raises(MachineError, match=r"^machine \S+: no space"):
        machines.run_all(refuse_to_write, range(3), 1, silent)


def test_a_machine_with_other_code_does_nothing(machines: Machines, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "origin", lambda: {"graycard's code": "abc", "Python": "2.7.18"})
    with pytest.raises(MachineError, match=r"got graycard's code \w+ and not abc, Python 3\.\S+ and not 2"):
        machines.run_all(end, ["a"], 1, silent)


def test_a_machine_without_the_weights_of_the_bench_is_another(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Its scores would lack metrics that the bench has."""
    monkeypatch.delenv("GRAYCARD_LPIPS", raising=False)
    monkeypatch.setenv("GRAYCARD_WEIGHTS", str(tmp_path))
    (tmp_path / "inception.safetensors").touch()
    wanted = origin()
    assert differences(wanted) == []
    (tmp_path / "inception.safetensors").unlink()
    assert differences(wanted) == ["weights of nothing and not FID and KID"]


@pytest.mark.parametrize("path", [None, Path("/lib/libLLVM.so.18.1")])
def test_a_machine_with_another_compiler_of_the_renderer_is_another(
    path: Path | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its scenes would have other bits, or lack layers."""
    wanted = origin()
    found = LLVM(path, 18) if path else LLVM(None, None, "No LLVM library was found")
    monkeypatch.setattr(_origin, "find_llvm", lambda: found)
    _origin._installed.cache_clear()
    own = f"18 ({path.name})" if path else "none"
    assert differences(wanted) == [f"LLVM of the renderer {own} and not {wanted['LLVM of the renderer']}"]
    _origin._installed.cache_clear()


@pytest.mark.parametrize(("here", "there", "same"), [("none", "1.5.3", True), ("1.5.2", "1.5.3", False)])
def test_machines_without_a_gpu_need_no_gsplat(
    here: str, there: str, same: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = {**origin(), "gsplat": here}
    monkeypatch.setattr(_origin, "origin", lambda: own)
    assert (differences({**own, "gsplat": there}) == []) is same
    assert (_origin.differences({**own, "gsplat": "none"}) == []) is True


class Few:
    """A connection to a cluster whose batch jobs have not all begun."""

    def __init__(self, workers: int | None) -> None:
        self.workers = workers

    def nthreads(self) -> dict[str, int]:
        if self.workers is None:
            raise OSError("the scheduler is gone")
        return {f"tcp://node:{n}": 1 for n in range(self.workers)}


@pytest.mark.parametrize(("present", "jobs"), [(None, 8), (0, 8), (1, 8), (9, 9)])
def test_workers_that_are_still_to_come_count(present: int | None, jobs: int) -> None:
    spec = ClusterSpec("slurm", workers=8, memory_gib=1.0)
    found = Machines(spec, lambda: cast("Client", None), print, _client=cast("Client", Few(present)))
    assert found.jobs_at_a_time() == jobs
    alone = dataclasses.replace(found, spec=ClusterSpec(address="tcp://node:8786"))
    assert alone.jobs_at_a_time() == max(1, present or 0), "nobody knows who else will join"


def test_resources_that_no_worker_offers_are_told_of(
    machines: Machines, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard: list[str] = []
    spec = dataclasses.replace(machines.spec, gpus=1)
    wanting = Machines(spec, machines.new_client, heard.append, _client=machines.client)
    words = engine._awaited(wanting, [False, True])
    assert words.startswith("no worker offers what a job asks for; start one with `dask worker")
    assert f'"MEMORY={2**31} GPU=1"' in words
    assert engine._awaited(wanting, [False]) == ""
    assert engine._awaited(machines, [True]) == ""


@dataclasses.dataclass(frozen=True)
class Fit:
    """A job that may use a GPU, or may not."""

    name: str
    may_use_gpu: bool


class Hands:
    """A client that notes what each job asks for, and does none."""

    status = "running"

    def __init__(self, *offers: dict[str, float]) -> None:
        self.asked: dict[str, dict[str, float] | None] = {}
        self.offers = offers

    @property
    def scheduler(self) -> "Hands":
        return self

    def identity(self, n_workers: int) -> dict[str, dict[str, dict[str, object]]]:
        return {"workers": {str(n): {"nthreads": 1, "resources": o} for n, o in enumerate(self.offers)}}

    def sync(self, question: Callable[..., object], **asked: int) -> object:
        return question(**asked)

    def nthreads(self) -> dict[str, int]:
        return {str(n): 1 for n in range(len(self.offers))}

    def submit(
        self, work: object, errand: object, job: Fit, origin: object, **options: dict[str, float] | None
    ) -> object:
        self.asked[job.name] = options["resources"]
        return object()


GPU = {"GPU": 1.0}


@pytest.mark.parametrize(
    ("offers", "confines", "asked"),
    [
        # One worker of three has a GPU, so one fit that may use it is out, beside two others.
        ((GPU, {}, {}), "serve", {"2dgs": GPU, "gray": None, "input": None}),
        # To render and to score takes no GPU; three workers, three jobs.
        ((GPU, {}, {}), "", {"2dgs": None, "gsir": None, "gray": None}),
        # Without a worker that has one, a fit waits for it and holds up no other.
        (({},), "serve", {"2dgs": GPU, "gray": None}),
        ((GPU,), "serve", {"2dgs": GPU}),
    ],
)
def test_only_fits_that_may_use_a_gpu_ask_for_one(
    offers: tuple[dict[str, float], ...], confines: str, asked: dict[str, dict[str, float] | None]
) -> None:
    hands = Hands(*offers)
    spec = ClusterSpec(address="tcp://node:8786", gpus=1)
    machines = Machines(spec, lambda: cast("Client", None), print, _client=cast("Client", hands))
    jobs = [Fit("2dgs", True), Fit("gsir", True), *(Fit(n, False) for n in ("gray", "input", "retinex"))]
    errand = Errand(Placed(tell_process, Path.cwd()), USUAL, 1, confines)
    course = engine._Course(machines, errand, jobs, lambda job: None, silent)
    course.skip_done(range(len(jobs)))
    for _ in range(2):
        course._hand_out()
        assert hands.asked == asked


def test_a_worker_that_dies_is_replaced_and_its_job_done_again(machines: Machines, tmp_path: Path) -> None:
    """The first job waits for its Dask worker to be killed; done again, it finds that it was begun."""
    killed: list[int] = []

    def kill() -> None:
        until = time.monotonic() + 120
        while time.monotonic() < until and not killed:
            time.sleep(0.2)
            for path in tmp_path.glob("begun-*"):
                killed.append(int(path.read_text()))
                os.kill(killed[0], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    outcomes = machines.run_all(leave_mark, [(str(tmp_path), n) for n in range(4)], 1, silent)
    killer.join()
    assert len(killed) == 1
    assert [outcome.value for outcome in outcomes] == [0, 1, 2, 3]
    assert len([*tmp_path.glob("begun-*")]) == 1
    machines.client.wait_for_workers(2)
    assert machines.ask(tell_looks) == [(False, "500ms")] * 2  # of the new one, too


def test_a_worker_process_that_dies_between_jobs_costs_none() -> None:
    worker = StandingWorker(tell_process, tasks_each=20, confines="")
    try:
        first = worker.do(0).value
        assert worker.do(1).value == first
        os.kill(first, signal.SIGKILL)
        time.sleep(0.5)
        assert worker.do(2).value != first
    finally:
        worker.end()


def test_a_worker_whose_job_cannot_write_begins_anew() -> None:
    from graycard import OutputError

    worker = StandingWorker(refuse_to_write, tasks_each=20, confines="")
    for _ in range(2):
        with pytest.raises(OutputError, match="no space"):
            worker.do(0)


def test_nothing_that_answers_is_said(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL)
    with (
        pytest.raises(MachineError, match=r"expected a scheduler at tcp://127.0.0.1:9, got no answer"),
        connected(ClusterSpec(address="tcp://127.0.0.1:9"), print),
    ):
        pass


class Gone:
    """A client whose scheduler is lost."""

    status = "closed"

    def close(self, timeout: float) -> None:
        raise OSError("no scheduler")


def test_a_scheduler_that_does_not_come_back_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> Gone:
        raise OSError("refused")

    heard: list[str] = []
    gone = Machines(ClusterSpec(address="tcp://h:1"), refuse, heard.append, 0.0, Gone())  # pyright: ignore
    with pytest.raises(MachineError, match=r"has not answered for 0 s. Start it again"):
        gone.run_all(end, ["a"], 1, silent)
    assert heard == ["the scheduler at tcp://h:1 is gone; waiting for it to come back"]
