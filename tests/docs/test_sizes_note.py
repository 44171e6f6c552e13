# SPDX-License-Identifier: Apache-2.0
"""``docs/lab-notes/2026-11-sizes.md``: its figures are those of the published runs."""

from statistics import fmean

from docs_of_reference import DOCS
from graycard.records import read_run
from graycard.reports.history._keep import OWN

RUNS = ("sizes/dark-20-views", "sizes/dark-20-views-quarter-steps", "sizes/dark-60-views", "large/dark-hd")
"""The columns of the table of dark rooms."""
ROWS = {
    "`appearance`, photographs": ("appearance", "training_view.psnr", "{:.1f} dB"),
    "`appearance`, held-out views": ("appearance", "novel_view.psnr", "{:.1f} dB"),
    "`darkgs`, photographs": ("darkgs", "training_view.psnr", "{:.1f} dB"),
    "`darkgs`, held-out views": ("darkgs", "novel_view.psnr", "{:.1f} dB"),
    "LPIPS of `appearance`": ("appearance", "novel_view.lpips", "{:.3f}"),
    "LPIPS of `darkgs`": ("darkgs", "novel_view.lpips", "{:.3f}"),
}


def mean_of(run: str, row: str, metric: str) -> float:
    """Return the mean of a metric of one row over the scenes of a published run."""
    sheets = [result.sheet for result in read_run(OWN / run).results if result.job.method == row]
    scores = [score for sheet in sheets if sheet for score in sheet.scores if score.metric == metric]
    values = [score.value for score in scores if score.value is not None]
    assert len(values) == len(sheets) > 0
    return fmean(values)


def test_the_table_of_dark_rooms_has_the_means_of_its_runs():
    note = (DOCS / "lab-notes" / "2026-11-sizes.md").read_text(encoding="utf-8")
    for title, (row, metric, form) in ROWS.items():
        cells = [form.format(mean_of(run, row, metric)) for run in RUNS]
        assert f"| {title} | {' | '.join(cells)} |" in note
