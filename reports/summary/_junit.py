# SPDX-License-Identifier: Apache-2.0
"""A summary as JUnit XML, which continuous integration systems read.

Elements and attributes are those of the schema of Jenkins (junit-10.xsd), which others read too.
"""

import xml.etree.ElementTree as Xml
from collections.abc import Sequence

from graycard.reports._format import format_number
from graycard.reports.summary._escape import xml_text
from graycard.reports.summary._gate import GateCheck
from graycard.reports.summary._summary import ClaimSummary, JobSummary, RunSummary

_UNDECIDED = ("undecided", "not testable here", "open")
"""Verdicts that say that nothing was found."""


def junit_of(summary: RunSummary) -> str:
    """Return the summary as JUnit XML: suites of jobs, of scores against a baseline, and of claims.

    A job fails with the words of its error, and so does one with a score that failed. A score fails where it
    is worse than the baseline allows, and is an error where it is missing. A claim passes whatever was found,
    as a finding is no fault of the code, and is skipped where nothing was. A run without jobs is an error.
    """
    root = Xml.Element("testsuites", name=xml_text(f"graycard {summary.suite}"))
    jobs = [_job(summary.suite, job) for job in summary.jobs] or [_nothing(summary.suite)]
    _add_suite(root, f"{summary.suite}.jobs", jobs, summary.started)
    if summary.gate:
        gate = [_check(summary.suite, check) for check in summary.gate.checks]
        _add_suite(root, f"{summary.suite}.gate", gate or [_no_gate(summary.suite)], summary.started)
    if summary.claims:
        claims = [_claim(summary.suite, claim) for claim in summary.claims]
        _add_suite(root, f"{summary.suite}.claims", claims, summary.started)
    for name in ("tests", "failures", "errors"):
        root.set(name, str(sum(int(suite.get(name, "0")) for suite in root)))
    root.set("time", f"{sum(float(suite.get('time', '0')) for suite in root):.3f}")
    Xml.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{Xml.tostring(root, encoding="unicode")}\n'


def _add_suite(root: Xml.Element, name: str, cases: Sequence[Xml.Element], started: str) -> None:
    counted = {
        noun: sum(case.find(kind) is not None for case in cases)
        for noun, kind in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped"))
    }
    seconds = sum(float(case.get("time", "0")) for case in cases)
    suite = Xml.SubElement(
        root,
        "testsuite",
        {"name": xml_text(name), "tests": str(len(cases))}
        | {noun: str(number) for noun, number in counted.items()}
        | {"time": f"{seconds:.3f}", "timestamp": xml_text(started[:19])},
    )
    suite.extend(cases)


def _case(classname: str, name: str, seconds: float = 0.0) -> Xml.Element:
    told = {"classname": xml_text(classname), "name": xml_text(name), "time": f"{seconds:.3f}"}
    return Xml.Element("testcase", told)


def _say(case: Xml.Element, kind: str, message: str, text: str = "", type_: str = "") -> None:
    told = {"message": xml_text(message)} | ({"type": type_} if type_ else {})
    Xml.SubElement(case, kind, told).text = xml_text(text or message)


def _job(suite: str, job: JobSummary) -> Xml.Element:
    case = _case(f"{suite}.{job.track}.{job.scene}", f"{job.method}, seed {job.seed}", job.wall_s or 0.0)
    if job.status == "failed":
        _say(case, "failure", job.reason or "no reason is known", type_="job")
    elif job.failed_scores:
        message = f"{len(job.failed_scores)} of {len(job.failed_scores) + job.scored} scores failed"
        reasons = "\n".join(f"{score.metric}: {score.reason}" for score in job.failed_scores)
        _say(case, "failure", message, reasons, "score")
    else:
        Xml.SubElement(case, "system-out").text = f"{job.scored} scores"
    return case


def _nothing(suite: str) -> Xml.Element:
    case = _case(f"{suite}.jobs", "the run has jobs")
    _say(case, "error", "expected jobs in the run, got none: nothing was measured", type_="nothing")
    return case


def _no_gate(suite: str) -> Xml.Element:
    case = _case(f"{suite}.gate", "the baseline expects scores")
    _say(case, "error", "expected scores in the baseline, got none: nothing was compared", type_="nothing")
    return case


def _check(suite: str, check: GateCheck) -> Xml.Element:
    case = _case(
        f"{suite}.gate.{check.track}.{check.scene}.{check.method}", f"{check.metric}, seed {check.seed}"
    )
    unit = "" if check.unit in ("", "1") else f" {check.unit}"
    wanted = f"expected {format_number(check.expected)}{unit} (tolerance {check.tolerance:g})"
    if check.found is None:
        _say(case, "error", f"{wanted}, got no score: {check.reason}", type_="missing")
        return case
    got = f"{wanted}, got {format_number(check.found)}{unit}"
    if check.status == "worse":
        _say(case, "failure", got, type_="worse")
    else:
        Xml.SubElement(case, "system-out").text = xml_text(got)
    return case


def _claim(suite: str, claim: ClaimSummary) -> Xml.Element:
    case = _case(f"{suite}.claims.{claim.paper}", f"{claim.id}: {claim.sentence}")
    found = f"{claim.verdict}. {claim.why}"
    if claim.verdict in _UNDECIDED:
        needs = f" To decide it: {claim.needs}" if claim.needs else ""
        _say(case, "skipped", claim.verdict, found + needs)
    else:
        Xml.SubElement(case, "system-out").text = xml_text(found)
    return case
