# SPDX-License-Identifier: Apache-2.0
"""Does cases that it is told of, one after another, in a process that may crash or hang."""

import json
import os
import resource
import shutil
import sys
import time
import traceback
import warnings
from dataclasses import asdict
from pathlib import Path
from random import Random

from fuzzer.hostile import OUTSIDE
from fuzzer.kind import Kind, check_words
from fuzzer.kinds import KINDS
from fuzzer.outcome import Outcome
from fuzzer.watch import Watch, forget_peak_memory, peak_memory_mib

MOST_MIB = 2048
"""Memory that a case may take beyond what the process had before it."""
MOST_ADDRESSES = 8 << 30
"""Bytes of address space beyond that of the process when it begins."""
MOST_S = 30.0
"""Seconds of processor time that a case may take."""
MOST_STEPS = 3


class Room:
    """The folders of a case, in which everything is made anew for each."""

    def __init__(self, root: Path) -> None:
        self.corpus, self.around = root / "corpus", root / "around"
        self.case = self.around / "a" / "b" / "c" / "case"
        self.input, self.target = self.case / "in", self.case / "out"
        self.temporary = root / "tmp"

    def lay(self, kind: Kind) -> None:
        """Lay the unchanged input of a kind, with things around it that must stay as they are."""
        shutil.rmtree(self.around, ignore_errors=True)
        for folder in (self.around / "outside", self.case.parent / "outside"):
            folder.mkdir(parents=True)
            (folder / "secret.json").write_text('{"secret": 1}')
        self.input.mkdir(parents=True)
        for name in kind.inputs:
            source, target = self.corpus / name, self.input / Path(name).name
            shutil.copytree(source, target) if source.is_dir() else shutil.copy(source, target)
        self.temporary.mkdir(exist_ok=True)


def steps_of(seed: int, kind: Kind, number: int) -> list[str]:
    """Return the seeds of the changes of a case; that of number 0 is not changed at all."""
    rng = Random(f"{seed}/{kind.name}/{number}")
    return [
        f"{seed}/{kind.name}/{number}/{step}" for step in range(rng.randint(1, MOST_STEPS) if number else 0)
    ]


def attack(kind: Kind, room: Room, seeds: list[str]) -> tuple[str, ...]:
    """Change the input, step by step, and seal it again."""
    said = []
    for seed in seeds:
        try:
            said.append(kind.attack(Random(seed), room.input))
        except Exception as error:
            said.append(f"no change ({type(error).__name__})")  # what was to be changed is gone
    if kind.seal is not None:
        try:
            kind.seal(room.input)
        except Exception:  # what is to be sealed may be anything by now
            said.append("not sealed")
    return tuple(ascii(words)[1:-1] for words in said)


def run(kind: Kind, room: Room, watch: Watch, seed: int, number: int, seeds: list[str]) -> Outcome:
    """Do one case."""
    room.lay(kind)
    said = attack(kind, room, seeds)
    targets = [room.target, *(room.input / name for name in kind.writes)]
    printed, before = os.lseek(1, 0, os.SEEK_END), _memory_mib()
    forget_peak_memory()
    fault = detail = ""
    refused, start = False, time.process_time()
    with watch.over(room.around, targets) as written:
        try:
            kind.read(room.input, room.target)
        except BaseException as error:
            refused, fault, detail = _judge(error)
    spent, peak = time.process_time() - start, peak_memory_mib() - before
    noise = os.lseek(1, 0, os.SEEK_END) - printed
    if not fault:
        fault, words = _beside(written, spent, peak, noise)
        detail = words or detail
    return Outcome(kind.name, number, fault, refused, said, detail, spent)


def _memory_mib() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def _judge(error: BaseException) -> tuple[bool, str, str]:
    """Return whether it is a refusal, and else the fault and its detail."""
    from graycard import GraycardError

    if isinstance(error, GraycardError):
        try:
            check_words(str(error))
        except Exception as wrong:
            return True, f"{type(wrong).__name__}: {wrong}", ""
        return True, "", str(error)[:2000]
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "/fuzzer/" not in f.filename]
    ours = [
        f for f in frames if "site-packages" not in f.filename and "/lib/python" not in f.filename
    ] or frames
    place = f"{'/'.join(Path(ours[-1].filename).parts[-2:])}:{ours[-1].name}" if ours else "?"
    return False, f"{type(error).__name__} in {place}: {str(error)[:90]!a}", traceback.format_exc()[-4000:]


def _beside(written: list[str], spent: float, peak: float, noise: int) -> tuple[str, str]:
    """Return the fault of a case that raised nothing wrong, and its detail."""
    if written:
        return f"written outside: {written[0].partition(':')[0]}", "\n".join(written[:20])
    if spent > MOST_S:
        return f"more than {MOST_S:g} s of processor time", f"{spent:.1f} s"
    if peak > MOST_MIB:
        return f"more than {MOST_MIB} MiB of memory", f"{peak:.0f} MiB"
    if noise:
        return "native code prints to stdout", f"{noise} bytes"
    return "", ""


def smaller(kind: Kind, room: Room, watch: Watch, seed: int, found: Outcome, seeds: list[str]) -> Outcome:
    """Return a case of one step with the same fault, if there is one; its input is then in the room."""
    for one in seeds if len(seeds) > 1 else ():
        again = run(kind, room, watch, seed, found.number, [one])
        if again.fault == found.fault:
            return again
    return run(kind, room, watch, seed, found.number, seeds)


def _nothing(*_: object) -> None:
    """Do nothing."""


def main() -> None:
    """Read cases from stdin, a line of JSON each; answer on the descriptor that is named first."""
    answers, root, seed = os.fdopen(int(sys.argv[1]), "w"), Path(sys.argv[2]), int(sys.argv[3])
    room = Room(root)
    os.fsync = _nothing  # no case is about power cuts, and disks are slow
    warnings.simplefilter("ignore")  # hostile numbers overflow; what comes of that is what counts
    os.environ["TMPDIR"] = str(room.temporary)
    from platformdirs import user_cache_path

    watch = Watch([room.temporary, user_cache_path("graycard")])
    addresses = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    most = addresses + MOST_ADDRESSES
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for line in sys.stdin:
        name, number = json.loads(line)
        kind, seeds = KINDS[name], steps_of(seed, KINDS[name], number)
        outcome = run(kind, room, watch, seed, number, seeds)
        if outcome.fault:
            outcome = smaller(kind, room, watch, seed, outcome, seeds)
        if os.path.lexists(OUTSIDE):
            shutil.rmtree(OUTSIDE, ignore_errors=True)
            Path(OUTSIDE).unlink(missing_ok=True)
        answers.write(json.dumps(asdict(outcome)) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
