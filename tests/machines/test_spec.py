# SPDX-License-Identifier: Apache-2.0
"""The machines that ``--scheduler`` asks for, and what is refused before anything is started."""

import importlib.util
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from graycard import GraycardError
from graycard.cli import main
from graycard.machines import ClusterSpec, MachineError, connected, read_scheduler
from graycard.machines._clusters import batch_options, check_installed, cluster_class

Written = Callable[[str], ClusterSpec]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    def read(text: str) -> ClusterSpec:
        (tmp_path / "machines.toml").write_text(text)
        return read_scheduler(str(tmp_path / "machines.toml"), 2, 8)

    return read


def test_workers_of_this_machine_share_its_cores_as_processes_do() -> None:
    assert read_scheduler("local", 2, 8) == ClusterSpec("local", workers=2, threads=4)
    assert read_scheduler("local", 16, 8) == ClusterSpec("local", workers=16, threads=1)


@pytest.mark.parametrize("address", ["tcp://host:8786", "tls://10.0.0.1:8786"])
def test_an_address_asks_for_nothing(address: str) -> None:
    spec = read_scheduler(address, 2, 8)
    assert spec == ClusterSpec(address=address)
    assert spec.resources == {}
    assert spec.threads == 1


def test_a_file_says_what_a_job_takes(written: Written) -> None:
    spec = written('address = "tcp://host:8786"\nthreads = 4\nmemory_gib = 1.5\ngpus = 1')
    assert spec.threads == 4
    assert spec.memory_mib == 1536
    assert spec.resources == {"MEMORY": 1.5 * 2**30, "GPU": 1.0}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected an address, or a kind of cluster to start"),
        ('kind = "slurm"\naddress = "tcp://host:1"\nmemory_gib = 1', "expected an address, or a kind"),
        ('kind = "moon"', "moon"),
        ('address = "host:8786"', "expected an address as tcp://host:8786"),
        ('kind = "slurm"', "expected memory_gib for slurm"),
        ('kind = "local"\nworkers = 0', "expected 1 or more workers, got 0"),
        ('kind = "local"\nthreads = 0', "expected 1 or more threads, got 0"),
        ('kind = "local"\ngpus = -1', "expected 0 or more gpus, got -1"),
        ('kind = "local"\nmemory_gib = 0', "expected a memory_gib above 0"),
        ('kind = "local"\nmemory_gib = nan', "expected a memory_gib above 0"),
        (
            'kind = "local"\n[options]\nqueue = "q"',
            "expected options for slurm, pbs or lsf, got some for local",
        ),
        ('kind = "local"\nqueue = "q"', "queue"),
        ("kind = ", "machines.toml"),
    ],
)
def test_a_file_that_asks_for_what_there_is_not_is_refused(written: Written, text: str, words: str) -> None:
    with pytest.raises(GraycardError, match=words):
        written(text)


@pytest.mark.parametrize("text", ["", "slurm", "host:8786", "http://host:8786", "machines.yaml"])
def test_so_is_what_is_neither_address_nor_file(text: str) -> None:
    with pytest.raises(MachineError, match=r"expected local, an address .* Mend --scheduler"):
        read_scheduler(text, 1, 1)


def test_a_batch_job_is_one_worker_with_what_a_job_takes(written: Written) -> None:
    spec = written(
        'kind = "slurm"\nworkers = 8\nthreads = 4\nmemory_gib = 15\ngpus = 1\n[options]\nqueue = "gpu"\n'
        'job_extra_directives = ["--exclusive"]'
    )
    options = batch_options(spec)
    assert (options["cores"], options["processes"], options["job_cpu"]) == (1, 1, 4)
    assert options["memory"] == "16GiB"
    assert options["queue"] == "gpu"
    assert options["job_extra_directives"] == ["--gres=gpu:1", "--exclusive"]
    assert f'"MEMORY={15 * 2**30} GPU=1"' in options["worker_extra_args"]


def test_arguments_of_workers_come_before_those_that_jobs_need(written: Written) -> None:
    """Dask takes the last of two that are alike: without what they offer, workers would be given no job."""
    more = '[options]\nworker_extra_args = ["--lifetime", "55m", "--resources", "x=1"]'
    args = batch_options(written(f'kind = "slurm"\nmemory_gib = 1\n{more}'))["worker_extra_args"]
    assert args == [
        "--lifetime", "55m", "--resources", "x=1", "--resources", f'"MEMORY={2**30}"', "--memory-limit", "0",
    ]  # fmt: skip
    text = '[options]\nworker_extra_args = "--lifetime 55m"'
    with pytest.raises(MachineError, match="expected a list of worker_extra_args, got '--lifetime 55m'"):
        batch_options(written(f'kind = "slurm"\nmemory_gib = 1\n{text}'))


def test_a_job_gets_no_more_memory_than_its_worker_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "machines.toml").write_text('kind = "local"\nmemory_gib = 2')
    told = ["bench", "demo", "--scheduler", str(tmp_path / "machines.toml"), "--memory", "8"]
    assert main([*told, "--out", str(tmp_path / "run")]) == 2
    words = " ".join(capsys.readouterr().err.split())
    assert "expected --memory of at most 2 GiB, which memory_gib asks for, got 8" in words


def test_each_batch_system_is_asked_in_its_own_words(written: Written) -> None:
    pbs = batch_options(written('kind = "pbs"\nthreads = 4\nmemory_gib = 3\ngpus = 2'))
    assert pbs["resource_spec"] == "select=1:ncpus=4:mem=4096mb:ngpus=2"
    lsf = batch_options(written('kind = "lsf"\nthreads = 4\nmemory_gib = 3\ngpus = 2'))
    assert lsf["ncpus"] == 4
    assert lsf["job_extra_directives"] == ['-gpu "num=2"']
    assert "job_extra_directives" not in batch_options(written('kind = "lsf"\nmemory_gib = 3'))


@pytest.mark.parametrize(("kind", "lacking"), [("local", "distributed"), ("slurm", "distributed and dask_")])
def test_without_dask_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], kind: str, lacking: str
) -> None:
    monkeypatch.setattr("graycard.machines._clusters.find_spec", lambda name: None)
    spec = ClusterSpec("local") if kind == "local" else ClusterSpec("slurm", memory_gib=1.0)
    with pytest.raises(MachineError, match=rf"expected {lacking}.*Run `pip install 'graycard\[cluster\]'`"):
        check_installed(spec)
    assert main(["bench", "demo", "--scheduler", "local"]) == 2
    assert "pip install 'graycard[cluster]'" in capsys.readouterr().err


@pytest.mark.skipif(importlib.util.find_spec("dask_jobqueue") is None, reason="needs dask-jobqueue")
@pytest.mark.parametrize("kind", ["slurm", "pbs", "lsf"])
def test_the_batch_script_asks_for_cores_and_memory(written: Written, kind: str) -> None:
    """Text is that which dask-jobqueue writes; nothing is submitted."""
    asked = {
        "slurm": ["--cpus-per-task=3", "--mem=4G"],
        "pbs": ["select=1:ncpus=3:mem=4096mb"],
        "lsf": ["-n 3", "-M 4"],
    }
    spec = written(f'kind = "{kind}"\nthreads = 3\nmemory_gib = 3')
    options = batch_options(spec)
    options.pop("scheduler_options")
    script = cluster_class(spec).job_cls("tcp://host:1", name="w", **options).job_script()
    assert all(words in script for words in asked[kind]), script
    assert "--nthreads 1" in script
    assert f'--resources "MEMORY={3 * 2**30}"' in script


@pytest.mark.skipif(importlib.util.find_spec("dask_jobqueue") is None, reason="needs dask-jobqueue")
@pytest.mark.parametrize(("kind", "command"), [("slurm", "sbatch"), ("pbs", "qsub"), ("lsf", "bsub")])
def test_a_machine_that_submits_no_jobs_says_so_at_once(
    written: Written, kind: str, command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    spec = written(f'kind = "{kind}"\nmemory_gib = 3')
    with (
        pytest.raises(MachineError, match=f"expected the command {command}.*got none"),
        connected(spec, print),
    ):
        pass


TOLD = """
import signal, sys
from graycard.machines import ClusterSpec
from graycard.machines._clusters import cluster_class
cluster_class(ClusterSpec("slurm", memory_gib=1.0))
sys.exit(signal.getsignal(signal.SIGINT) is not signal.default_int_handler)
"""


@pytest.mark.skipif(importlib.util.find_spec("dask_jobqueue") is None, reason="needs dask-jobqueue")
def test_a_batch_system_does_not_take_the_interrupt_key() -> None:
    assert subprocess.run([sys.executable, "-c", TOLD], check=False).returncode == 0
