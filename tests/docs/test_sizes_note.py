# SPDX-License-Identifier: Apache-2.0
"""``docs/lab-notes/2026-11-sizes.md``: its figures are those of the published runs."""

from statistics import fmean

from docs_of_editions import values_of
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


def test_the_table_of_dark_rooms_has_the_means_of_its_runs():
    note = (DOCS / "lab-notes" / "2026-11-sizes.md").read_text(encoding="utf-8")
    runs = [read_run(OWN / run) for run in RUNS]
    for title, (row, metric, form) in ROWS.items():
        values = [values_of(run)[row, metric] for run in runs]
        assert list(map(len, values)) == [len(run.scenes) for run in runs]
        assert f"| {title} | {' | '.join(form.format(fmean(of_run)) for of_run in values)} |" in note
