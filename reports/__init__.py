# SPDX-License-Identifier: Apache-2.0
"""A run as one HTML file that opens offline: who is best and how surely, leaderboards, pictures, where each
method is most wrong, lights and the facts of the run; a scene as one contact sheet.

The report reads run records and the folders that they name; how a score was made it does not know.
"""

from graycard.records import is_published as is_published
from graycard.reports._publish import ledger_of_run as ledger_of_run
from graycard.reports._publish import publish_run as publish_run
from graycard.reports._scene_section import Shown as Shown
from graycard.reports._write import write_report as write_report
from graycard.reports.captures._page import CaptureRow as CaptureRow
from graycard.reports.captures._write import write_capture_report as write_capture_report
from graycard.reports.figures._content import FigureSpec as FigureSpec
from graycard.reports.figures._write import write_figure as write_figure
from graycard.reports.history._changes import Change as Change
from graycard.reports.history._keep import HISTORY_PAGE as HISTORY_PAGE
from graycard.reports.history._keep import verdict_changes as verdict_changes
from graycard.reports.history._republish import republish_claims as republish_claims
from graycard.reports.history._republish import republish_tables as republish_tables
from graycard.reports.pictures._contact_sheet import contact_sheet as contact_sheet
from graycard.reports.pictures._contact_sheet import write_contact_sheets as write_contact_sheets
from graycard.reports.site._sources import beside_runs as beside_runs
from graycard.reports.site._write import write_site as write_site
from graycard.reports.summary._gate import GateCheck as GateCheck
from graycard.reports.summary._gate import GateStatus as GateStatus
from graycard.reports.summary._gate import GateSummary as GateSummary
from graycard.reports.summary._summary import RunSummary as RunSummary
from graycard.reports.summary._summary import headline_ids as headline_ids
from graycard.reports.summary._summary import summarise as summarise
from graycard.reports.summary._write import SummaryFormat as SummaryFormat
from graycard.reports.summary._write import summary_text as summary_text
