# SPDX-License-Identifier: Apache-2.0
"""Work that a fresh process can import, most of it ill-behaved."""

import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from graycard.io import file_lock, silent
from graycard.processes import Outcome, worker_progress

LONG_S = 600


def tell_process(number: int) -> Outcome:
    return Outcome(value=os.getpid())


def die_at_one(number: int) -> Outcome:
    if number == 1:
        os._exit(9)
    return Outcome(value=number)


def end(how: str) -> Outcome:
    """End without an outcome, or keep the worker busy."""
    match how:
        case "exit 0":
            os._exit(0)
        case "exit 7":
            os._exit(7)
        case "abort":
            os.abort()
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "descriptors":
            os.closerange(0, 256)
            time.sleep(LONG_S)
        case "memory":
            np.ones(50 * 2**30, np.uint8)
        case "hang":
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            time.sleep(LONG_S)
        case "system exit":
            sys.exit(3)
        case "unpicklable":
            return Outcome(value=threading.Lock())
    return Outcome(value=how)


def tell_memory(number: int) -> Outcome:
    """Tell how much memory may be written to."""
    return Outcome(value=resource.getrlimit(resource.RLIMIT_DATA)[0])


def tell_looks() -> tuple[bool, str]:
    """Tell whether Dask profiles this process, and how often it looks whether it answers."""
    from dask import config

    return config.get("distributed.worker.profile.enabled"), config.get("distributed.admin.tick.interval")


def tick_of(dask_scheduler: Any) -> float:
    """Return how often a scheduler looks whether it answers, ms."""
    return dask_scheduler.periodic_callbacks["tick"].callback_time


def tell_folder(number: int) -> Outcome:
    return Outcome(value=str(Path.cwd()))


def refuse_to_write(number: int) -> Outcome:
    return Outcome(reason="no space left", fatal=True)


def leave_mark(job: tuple[str, int]) -> Outcome:
    """Note the process above this one, and wait to die with it, unless another job or call has done so."""
    folder, number = job
    try:
        with (Path(folder) / "begun-once").open("x") as file:
            file.write(str(os.getppid()))
    except FileExistsError:
        return Outcome(value=number)
    time.sleep(LONG_S)
    return Outcome(value=-1)


def leave_children(how: str, folder: str) -> Outcome:
    """Start processes that outlive the job, note their ids, and return or die."""
    ids = []
    if (child := os.fork()) == 0:
        time.sleep(LONG_S)
    ids.append(child)
    if (child := os.fork()) == 0:
        os.setsid()
        time.sleep(LONG_S)
    ids.append(child)
    ids.append(subprocess.Popen(["sleep", str(LONG_S)], start_new_session=True).pid)
    process = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(LONG_S,))
    process.start()
    ids.append(process.pid)
    (Path(folder) / "ids").write_text(" ".join(map(str, ids)))
    if how == "abort":
        os.abort()
    return Outcome(value=how)


def leave_with(job: tuple[str, str]) -> Outcome:
    return leave_children(*job)


def fork_with_lock(folder: str) -> Outcome:
    """Die in a lock while a child sleeps."""
    with file_lock(Path(folder) / "lock", lambda who: None):
        if os.fork() == 0:
            time.sleep(LONG_S)
        os.abort()


def speak(text: str) -> Outcome:
    """Print on both streams, from Python and past it."""
    sys.stdout.write(f"out {text}\n")
    sys.stderr.write(f"err {text}\n")
    os.write(1, b"raw \x1b[2J\xff\n")
    return Outcome(value=text)


def report(number: int) -> Outcome:
    progress = worker_progress()
    progress(0.5, f"half of {number}")
    return Outcome(value=progress is silent)


def wait_for(job: tuple[str, float]) -> Outcome:
    """Hold a lock until another process waits for it, at most some seconds; say for whom it was waited."""
    folder, seconds = job
    waits, heard = Path(folder) / "waits", list[str]()

    def hear(who: str) -> None:
        heard.append(who)
        waits.touch()

    with file_lock(Path(folder) / "lock", hear):
        until = time.monotonic() + seconds
        while not waits.exists() and time.monotonic() < until:
            time.sleep(0.01)
    return Outcome(value=heard)


def raise_words(words: str) -> NoReturn:
    raise RuntimeError(words)
