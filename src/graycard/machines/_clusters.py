# SPDX-License-Identifier: Apache-2.0
"""Connect to a scheduler that runs, or start one: on this machine, or with workers as batch jobs."""

import logging
import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from graycard.io import temporary_folder
from graycard.machines._engine import Machines
from graycard.machines._spec import ClusterSpec, MachineError

if TYPE_CHECKING:
    from distributed import Client

_CLASSES = {"slurm": "SLURMCluster", "pbs": "PBSCluster", "lsf": "LSFCluster"}
_OVERHEAD_GIB = 1.0
"""Memory of the Dask worker beside that of the job."""
_CONNECT_S = 10.0
"""Time that a scheduler has to answer."""
_QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.admin.system-monitor.interval": "2s",
}
"""Options of Dask for workers of this machine and its scheduler: they share its cores with the jobs.

By default Dask looks a hundred times a second at what a worker does. It looks fifty times whether each
process answers, and twice at memory and load.
"""


@contextmanager
def connected(spec: ClusterSpec, say: Callable[[str], None]) -> Iterator[Machines]:
    """Yield the machines of a spec; what was started for them ends with the block.

    Args:
        spec: Which.
        say: Told lines for the user: the link of the dashboard, and what is waited for.

    Raises:
        MachineError: Dask is not installed, nothing answers, or the cluster cannot be started.
    """
    check_installed(spec)
    from dask.config import set as set_options
    from distributed import Client

    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # of what is lost, `say` tells
    with ExitStack() as stack:
        folder = stack.enter_context(temporary_folder())
        stack.enter_context(set_options({"temporary-directory": str(folder)}))
        target = spec.address if spec.kind == "address" else _started(spec, stack)

        def connect() -> "Client":
            return Client(target, timeout=_CONNECT_S, set_as_default=False)

        machines = Machines(spec, connect, say)
        stack.callback(machines.close)
        machines.connect()
        if link := machines.dashboard:
            lacks = "" if find_spec("bokeh") else " (empty without bokeh: `pip install 'graycard[cluster]'`)"
            say(f"dashboard: {link}{lacks}")
        yield machines


def check_installed(spec: ClusterSpec) -> None:
    """Refuse machines without the packages that reach them.

    Raises:
        MachineError: One is not installed.
    """
    wanted = ["distributed", *(["dask_jobqueue"] if spec.kind in _CLASSES else [])]
    if lacking := [name for name in wanted if find_spec(name) is None]:
        raise MachineError(
            f"expected {' and '.join(lacking)} for --scheduler, got none. "
            "Run `pip install 'graycard[cluster]'`"
        )


def _started(spec: ClusterSpec, stack: ExitStack) -> Any:
    """Start a cluster; it ends with the stack."""
    try:
        cluster = _local(spec) if spec.kind == "local" else _batch(spec)
    except (OSError, ValueError, TypeError, RuntimeError) as cause:
        raise MachineError(
            f"no {spec.kind} cluster could be started: {type(cause).__name__}: {cause}"
        ) from cause
    stack.callback(cluster.close)
    return cluster


def _local(spec: ClusterSpec) -> Any:
    """Return workers of this machine, a process each."""
    from dask.config import set as set_options
    from distributed import LocalCluster

    # scheduler and nannies are in this process; `config` reaches workers, also those that replace others
    with set_options(_QUIET):
        return LocalCluster(
            n_workers=spec.workers,
            threads_per_worker=1,
            memory_limit=0,  # what a job may take is limited in its own process
            dashboard_address=":0",
            resources=spec.resources,
            config=_QUIET,
            silence_logs=logging.CRITICAL,  # a worker that dies is replaced, and its job done again
        )


def _batch(spec: ClusterSpec) -> Any:
    """Return workers that are submitted as batch jobs, and again when one ends before its time.

    Raises:
        MachineError: This machine submits no such jobs.
    """
    batch = cluster_class(spec)
    if shutil.which(command := batch.job_cls.submit_command.split()[0]) is None:
        raise MachineError(
            f"expected the command {command}, which submits batch jobs of kind {spec.kind!r}, got none on "
            "this machine. Run this where jobs are submitted, or mend kind"
        )
    cluster = batch(**batch_options(spec))
    cluster.adapt(minimum_jobs=spec.workers, maximum_jobs=spec.workers)
    return cluster


def cluster_class(spec: ClusterSpec) -> Any:
    """Return the class of ``dask_jobqueue`` for a batch system.

    Its import takes SIGINT for itself; that goes back to whoever had it.
    """
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    import dask_jobqueue

    for number, handler in handlers.items():
        signal.signal(number, handler)
    return getattr(dask_jobqueue, _CLASSES[spec.kind])


def batch_options(spec: ClusterSpec) -> dict[str, Any]:
    """Return the arguments of a cluster of ``dask_jobqueue``: one worker a batch job, one job at a time.

    Raises:
        MachineError: ``worker_extra_args`` is no list.
    """
    assert spec.memory_gib is not None, "the spec has refused that"
    memory = f"{spec.memory_gib + _OVERHEAD_GIB:g}GiB"
    offered = " ".join(f"{name}={count:.0f}" for name, count in spec.resources.items())
    options = dict(spec.options)
    asked: dict[str, Any] = {
        "cores": 1,  # threads of the Dask worker
        "processes": 1,
        "memory": memory,
        "python": sys.executable,
        "scheduler_options": {"dashboard_address": ":0"},
    }
    own = ["--resources", f'"{offered}"', "--memory-limit", "0"]
    given = options.pop("worker_extra_args", ())
    if isinstance(given, str):
        raise MachineError(f"expected a list of worker_extra_args, got {given!r}. Put them into brackets")
    more = {"worker_extra_args": [*given, *own]}  # of two that are alike the last one counts
    return asked | _of_system(spec) | options | more | _extra(spec)


def _of_system(spec: ClusterSpec) -> dict[str, Any]:
    """Return how each batch system is asked for cores."""
    if spec.kind == "slurm":
        return {"job_cpu": spec.threads}
    if spec.kind == "lsf":
        return {"ncpus": spec.threads}
    assert spec.memory_gib is not None, "the spec has refused that"
    mib = round(1024 * (spec.memory_gib + _OVERHEAD_GIB))
    gpus = f":ngpus={spec.gpus}" if spec.gpus else ""
    return {"resource_spec": f"select=1:ncpus={spec.threads}:mem={mib}mb{gpus}"}


def _extra(spec: ClusterSpec) -> dict[str, Any]:
    """Return directives for GPUs, before those that the file has."""
    own = list(spec.options.get("job_extra_directives", ()))
    gpus = {"slurm": [f"--gres=gpu:{spec.gpus}"], "lsf": [f'-gpu "num={spec.gpus}"']}
    more = gpus.get(spec.kind, []) if spec.gpus else []
    return {"job_extra_directives": [*more, *own]} if more or own else {}
