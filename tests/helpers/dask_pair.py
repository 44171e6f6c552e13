# SPDX-License-Identifier: Apache-2.0
"""Compare jobs an hour of two Dask workers with those of one, on eight fits of one thread each.

``python tests/helpers/dask_pair.py --pairs 3`` on a quiet machine. The scene is rendered before. Each pair
runs the same bench with one worker and with two, in turn the one and the other first. The time is that of the
whole command, from its start to the report. Two fits beside each other, without Dask, say what the machine
gives.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from kill_bench import say

SUITE = """
name = "pair"
version = 1
title = "Eight fits"
seeds = [0, 1, 2, 3, 4, 5, 6, 7]
[render]
width = 96
height = 96
train_views = 8
test_views = 2
samples = 16
[[scenes]]
track = "tabletop"
family = "glossy-table"
seed = 1000
[[methods]]
name = "do-nothing"
settings = {{ iterations = {iterations} }}
"""
FITS = 8
WORKERS = (1, 2)


def bench(root: Path, workers: int) -> float:
    """Run the bench anew on so many workers; return its time, seconds."""
    run = root / f"run-{workers}"
    shutil.rmtree(run, ignore_errors=True)
    machines = root / f"{workers}.toml"
    machines.write_text(f'kind = "local"\nworkers = {workers}\nthreads = 1\n')
    told = ["--out", str(run), "--dataset", str(root / "dataset"), "--scheduler", str(machines)]
    command = [sys.executable, "-m", "graycard", "bench", str(root / "pair.toml"), *told]
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, "OMP_NUM_THREADS": "1"})
    return time.perf_counter() - start


def machine_gain(root: Path, iterations: int) -> float:
    """Return how many times the fits of one two fits make in the same time, without Dask."""
    (scene,) = (root / "dataset" / "tabletop").iterdir()
    command = [
        sys.executable,
        "-m",
        "graycard",
        "fit",
        "do-nothing",
        str(scene),
        "--iterations",
        str(iterations),
    ]
    one = {**os.environ, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    spent = []
    for number in WORKERS:
        start = time.perf_counter()
        fits = [
            subprocess.Popen(
                [*command, "--out", str(root / f"fit-{number}-{n}")], env=one, stdout=subprocess.DEVNULL
            )
            for n in range(number)
        ]
        if any(fit.wait() for fit in fits):
            raise SystemExit("a fit failed")
        spent.append(time.perf_counter() - start)
    return 2 * spent[0] / spent[1]


def main() -> int:
    """Compare as the command line asks; 1 below 1.8 times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=3)
    parser.add_argument("--iterations", type=int, default=4000)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="pair-") as name:
        root = Path(name)
        suite = root / "pair.toml"
        suite.write_text(SUITE.format(iterations=20))
        bench(root, 2)  # renders, and compiles kernels
        suite.write_text(SUITE.format(iterations=given.iterations))
        say(f"two fits beside each other, without Dask: {machine_gain(root, given.iterations):.2f} times")
        ratios = []
        for number in range(given.pairs):
            spent = {workers: bench(root, workers) for workers in WORKERS[:: 1 - 2 * (number % 2)]}
            ratios.append(spent[1] / spent[2])
            rates = " and ".join(f"{FITS * 3600 / spent[workers]:.0f}" for workers in WORKERS)
            say(f"{rates} jobs an hour with one worker and with two: {ratios[-1]:.2f} times")
    say(f"median of {given.pairs} pairs: {median(ratios):.2f} times")
    return 0 if median(ratios) >= 1.8 else 1


if __name__ == "__main__":
    raise SystemExit(main())
