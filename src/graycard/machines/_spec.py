# SPDX-License-Identifier: Apache-2.0
"""The machines that a bench asks for: ``--scheduler`` as text or as a TOML file."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from graycard import GraycardError
from graycard.io import from_builtins, read_toml

Kind = Literal["address", "local", "slurm", "pbs", "lsf"]
PROTOCOLS = ("tcp://", "tls://", "ucx://")
"""Begins of addresses that Dask connects to."""
_GIB = 2**30


class MachineError(GraycardError):
    """Other machines cannot do jobs: the scheduler is gone, they have other code, or a package is missing."""


@dataclass(frozen=True, slots=True)
class ClusterSpec:
    """A scheduler to connect to or to start, and what each job takes of a worker."""

    kind: Kind = "address"
    """``address`` for a scheduler that runs; ``slurm``, ``pbs`` and ``lsf`` submit workers as batch jobs."""
    address: str = ""
    """``tcp://host:port`` of a scheduler that runs."""
    workers: int = 1
    """Workers to start; each does one job at a time. Without meaning for ``address``."""
    threads: int = 1
    """Threads of a job, and cores that a batch job asks for."""
    memory_gib: float | None = None
    """Memory of a job, GiB; None: a job may take what its machine has, and asks for none."""
    gpus: int = 0
    """GPUs of a fit that may use one."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Further arguments of the cluster's class in ``dask_jobqueue``, as ``queue`` and ``walltime``."""

    def __post_init__(self) -> None:
        if (self.kind == "address") != bool(self.address):
            raise ValueError(
                f"expected an address, or a kind of cluster to start, got kind {self.kind!r} with address "
                f"{self.address!r}. Give one of them"
            )
        if self.address and not self.address.startswith(PROTOCOLS):
            raise ValueError(f"expected an address as tcp://host:8786, got {self.address!r}. Mend address")
        if self.options and self.kind in ("address", "local"):
            raise ValueError(
                f"expected options for slurm, pbs or lsf, got some for {self.kind}. Leave them out"
            )
        for name, least in (("workers", 1), ("threads", 1), ("gpus", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"expected {least} or more {name}, got {getattr(self, name)}. Mend {name}")
        if self.memory_gib is not None and not 0 < self.memory_gib < math.inf:
            raise ValueError(f"expected a memory_gib above 0, got {self.memory_gib}. Mend memory_gib")
        if self.kind in ("slurm", "pbs", "lsf") and self.memory_gib is None:
            raise ValueError(f"expected memory_gib for {self.kind}, got none. Say how much a job may take")

    @property
    def memory_mib(self) -> int | None:
        """Memory of a job, MiB; None where none is asked for."""
        return None if self.memory_gib is None else max(1, round(1024 * self.memory_gib))

    @property
    def resources(self) -> dict[str, float]:
        """Return what each worker that is started offers, by the names that Dask's manual gives them."""
        return self.asked(gpu=True)

    def asked(self, *, gpu: bool) -> dict[str, float]:
        """Return what a job asks of a worker, by the same names.

        Args:
            gpu: It may use a GPU.
        """
        memory = {} if self.memory_gib is None else {"MEMORY": float(round(self.memory_gib * _GIB))}
        return memory | ({"GPU": float(self.gpus)} if gpu and self.gpus else {})


def read_scheduler(text: str, jobs: int, cores: int) -> ClusterSpec:
    """Return the machines that an option asks for.

    Args:
        text: ``local``, an address as ``tcp://host:8786``, or a path that ends in ``.toml``.
        jobs: At a time, where workers of this machine are asked for.
        cores: Those that this process may use, which they share.

    Raises:
        MachineError: It is none of these.
        RecordError: The file is missing, no TOML, or asks for something that there is not.
    """
    if text == "local":
        return ClusterSpec("local", workers=jobs, threads=max(1, cores // jobs))
    if text.startswith(PROTOCOLS):
        return ClusterSpec(address=text)
    if text.endswith(".toml"):
        return from_builtins(ClusterSpec, read_toml(Path(text)), MachineError, text)
    raise MachineError(
        f"expected local, an address as tcp://host:8786 or a path that ends in .toml, got {text!r}. "
        "Mend --scheduler"
    )
