# SPDX-License-Identifier: Apache-2.0
"""A Slurm of two nodes on this machine: its daemons, each node on a port of its own.

Debian: ``apt-get install slurm-wlm``. The daemons run as root, as they do on a cluster.
"""

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

DAEMONS = ("munged", "slurmctld", "slurmd")
NODES = ("node1", "node2")
_CONFIGURATION = """
ClusterName=graycard
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={root}/munge.socket
CredType=cred/munge
StateSaveLocation={root}/state
SlurmdSpoolDir={root}/spool-%n
SlurmctldPidFile={root}/slurmctld.pid
SlurmdPidFile={root}/slurmd-%n.pid
SlurmctldLogFile={root}/slurmctld.log
SlurmdLogFile={root}/slurmd-%n.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerType=sched/backfill
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
ReturnToService=2
{nodes}
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""
_PATIENCE_S = 60.0


def lacking() -> str:
    """Say what a Slurm here lacks; empty if it can be started."""
    missing = [name for name in DAEMONS if shutil.which(name, path=_path()) is None]
    if missing:
        return f"needs {', '.join(missing)} (Debian: apt-get install slurm-wlm)"
    return "" if os.geteuid() == 0 else "needs root"


def _path() -> str:
    return f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"


@contextmanager
def slurm(root: Path) -> Iterator[dict[str, str]]:
    """Run a Slurm for the length of a block; yields the environment in which ``sbatch`` finds it.

    Args:
        root: An empty folder with a short path: sockets are in it.
    """
    environment = {**os.environ, "SLURM_CONF": str(root / "slurm.conf"), "PATH": _path()}
    _configure(root)
    munge = [f"--{kind}-file={root}/munge.{kind}" for kind in ("key", "pid", "log", "seed")]
    daemons = [["munged", "--foreground", "--force", f"--socket={root}/munge.socket", *munge]]
    daemons += [["slurmctld", "-D"], *(["slurmd", "-D", "-N", node] for node in NODES)]
    running = []
    try:
        with (root / "daemons.log").open("wb") as log:
            for command in daemons:
                running.append(subprocess.Popen(command, env=environment, stdout=log, stderr=log))
                time.sleep(0.5)
        _await_nodes(environment)
        yield environment
        _await_end_of_jobs(environment)
    finally:
        for daemon in reversed(running):
            daemon.terminate()
        for daemon in running:
            try:
                daemon.wait(_PATIENCE_S)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()


def _configure(root: Path) -> None:
    (root / "state").mkdir()
    key = root / "munge.key"
    key.touch(mode=0o600)
    key.write_bytes(os.urandom(1024))
    ports = _free_ports(1 + len(NODES))
    host = socket.gethostname()
    told = f"NodeHostname={host} NodeAddr=127.0.0.1 CPUs=1 RealMemory=8000 State=UNKNOWN"
    nodes = [f"NodeName={node} Port={port} {told}" for node, port in zip(NODES, ports[1:], strict=True)]
    text = _CONFIGURATION.format(host=host, port=ports[0], root=root, nodes="\n".join(nodes))
    (root / "slurm.conf").write_text(text)


def _free_ports(count: int) -> list[int]:
    taken = [socket.socket() for _ in range(count)]
    for one in taken:
        one.bind(("127.0.0.1", 0))
    found = [one.getsockname()[1] for one in taken]
    for one in taken:
        one.close()
    return found


def _await_end_of_jobs(environment: dict[str, str]) -> None:
    """Wait a while until no job is left: a node whose job ends without a controller never ends."""
    until = time.monotonic() + _PATIENCE_S
    while time.monotonic() < until:
        asked = subprocess.run(
            ["squeue", "--noheader"], env=environment, capture_output=True, check=False, timeout=_PATIENCE_S
        )
        if asked.returncode or not asked.stdout.strip():
            return
        time.sleep(0.5)


def _await_nodes(environment: dict[str, str]) -> None:
    """Wait until both nodes take jobs.

    Raises:
        TimeoutError: They do not.
    """
    asked = ["sinfo", "--noheader", "--Node", "--format=%T"]
    until, states = time.monotonic() + _PATIENCE_S, [""]
    while states != ["idle"] * len(NODES):
        if time.monotonic() > until:
            raise TimeoutError(f"expected idle nodes, got {states}")
        time.sleep(0.5)
        told = subprocess.run(asked, env=environment, capture_output=True, text=True, check=False)
        states = told.stdout.split()
