# SPDX-License-Identifier: Apache-2.0
"""A summary in one of its formats."""

from typing import Literal, assert_never

from graycard.io import dumps
from graycard.reports.summary._junit import junit_of
from graycard.reports.summary._markdown import markdown_of
from graycard.reports.summary._summary import RunSummary

SummaryFormat = Literal["md", "junit", "json"]


def summary_text(summary: RunSummary, form: SummaryFormat) -> str:
    """Return a summary as Markdown, JUnit XML or JSON, with a line break at its end."""
    match form:
        case "md":
            return markdown_of(summary)
        case "junit":
            return junit_of(summary)
        case "json":
            return dumps(summary)
        case _:
            assert_never(form)
