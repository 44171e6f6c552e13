# SPDX-License-Identifier: Apache-2.0
"""``docs/lab-notes/2026-11-large-scenes.md``: its figures of a whole run are those of the published one."""

from docs_of_editions import means_table
from docs_of_reference import DOCS, table
from graycard.records import RunRecord, read_run
from published import PAPER
from written_blocks import told_and_wanted

PAGE = DOCS / "lab-notes" / "2026-11-large-scenes.md"
RUN = PAPER / "dark-cpu"


def costs_table(run: RunRecord) -> str:
    """Return what each fit of a run cost; rows that fit nothing are left out."""
    head = ("row", "steps", "surfels", "time", "CPU time", "memory at the peak")
    rows = []
    for result in run.results:
        told, cost = result.job.settings, result.cost
        if "surfels" not in told or cost is None or cost.cpu_s is None:
            continue
        times = [f"{seconds / 60:.0f} min" for seconds in (cost.wall_s, cost.cpu_s)]
        counts = [f"{told[name]:,}" for name in ("iterations", "surfels")]
        rows.append((f"`{result.job.method}`", *counts, *times, f"{cost.peak_memory_mib / 1024:.1f} GiB"))
    return table(head, rows)


def test_the_run_of_a_papers_size_is_told_with_its_costs_and_scores():
    run = read_run(RUN)
    wanted = f"\n{costs_table(run)}\n{means_table(run)}\n"
    told, wanted = told_and_wanted(PAGE, "paper-dark-cpu", wanted)
    assert told == wanted, "run `make docs`"


def test_the_run_of_a_papers_size_is_of_a_scene_that_judges_nothing():
    run = read_run(RUN)
    assert (run.suite, run.budget, run.edition) == ("paper-dark-cpu", 0.5, None)
    assert [(scene.track, scene.seed) for scene in run.scenes] == [("dark", 1011)]
    assert all(result.status == "done" for result in run.results)
