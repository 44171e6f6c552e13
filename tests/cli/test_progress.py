# SPDX-License-Identifier: Apache-2.0
"""Progress says what, how far and how long, with and without a terminal."""

import io
import re
import threading
from dataclasses import dataclass
from types import SimpleNamespace

import pytest
from rich.console import Console

from graycard.cli._log import _clock, _Log, logged
from graycard.cli._terminal import Terminal
from graycard.processes import Ended, Outcome, named, part_of, run_all, worker_progress
from graycard.processes._pool import words_of_job


def console() -> tuple[Console, io.StringIO]:
    shown = io.StringIO()
    return Console(file=shown, width=1000), shown


def test_each_end_has_a_line_where_there_is_no_terminal():
    err, shown = console()
    with logged(err, "gray on dark/a", first_s=1e6, each_s=1e6) as report:
        report(0.1, "fitting")
        report(0.25, Ended("1 of 4: dark/a gray, 1.0 s"))
        report(0.3, "fitting more")
        report(1.0, Ended("4 of 4"))
    first, last = shown.getvalue().splitlines()
    assert re.fullmatch(r"\[25%, 0:0\d, about 0:0\d left\] 1 of 4: dark/a gray, 1.0 s", first)
    assert re.fullmatch(r"\[100%, 0:0\d\] 4 of 4", last)


def test_quick_work_says_nothing():
    err, shown = console()
    with logged(err, "gray on dark/a") as report:
        report(0.5, "checking")
    assert shown.getvalue() == ""


def test_the_first_line_says_what_is_done_on_what():
    err, shown = console()
    with logged(err, "gray on dark/a", first_s=0.0, each_s=1e6):
        threading.Event().wait(0.3)
    assert re.fullmatch(r"\[0%, 0:00\] gray on dark/a\n", shown.getvalue())


def test_work_that_says_nothing_is_said_to_go_on():
    err, shown = console()
    with logged(err, "gray on dark/a", first_s=0.0, each_s=0.02) as report:
        report(0.5, "fitting 400 surfels")
        threading.Event().wait(0.5)
    lines = shown.getvalue().splitlines()
    assert len(lines) >= 2
    assert {line.partition("] ")[2] for line in lines} <= {"gray on dark/a", "fitting 400 surfels"}


def test_control_characters_and_numbers_that_are_none_hurt_nothing():
    err, shown = console()
    with logged(err, "gray on dark/a", first_s=1e6, each_s=1e6) as report:
        report(float("nan"), Ended("\x1b[31mred"))
    assert shown.getvalue() == "[?, 0:00] \\x1b[31mred\n"


@pytest.mark.parametrize(("seconds", "told"), [(0.4, "0:00"), (64.0, "1:04"), (3725.0, "1:02:05")])
def test_times_are_said_as_a_clock_does(seconds: float, told: str):
    assert _clock(seconds) == told


def test_a_terminal_shows_share_and_time_from_the_start():
    shown = io.StringIO()
    terminal = Terminal(err=Console(file=shown, force_terminal=True, width=100))
    with terminal.progress("suite demo") as report:
        report(0.5, "fitting 1 of 2")
    assert re.search(r"suite demo.* 0%.*0:00:00", shown.getvalue())
    assert re.search(r"fitting 1 of 2.* 50%", shown.getvalue())


def test_a_narrow_terminal_cuts_the_words_and_not_the_times():
    shown = io.StringIO()
    terminal = Terminal(err=Console(file=shown, force_terminal=True, width=80))
    with terminal.progress("suite demo") as report:
        report(0.5, "fitting 7 of 12: dark/corridor-0000 sunfaded: fitting 5000 surfels of many")
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.getvalue())
    last = plain.replace("\r", "\n").strip().splitlines()[-1]
    assert re.fullmatch(r"fitting 7 of 12: dark/corridor-0000 .*… \S+ +50% 0:00:00 left \S+", last.strip())


def test_a_part_keeps_what_is_an_end():
    told: list[tuple[float, str]] = []
    report = part_of(lambda done, doing: told.append((done, doing)), 1, 4, "fitting")
    report(0.5, "surfels")
    report(1.0, Ended("3 of 3"))
    assert told == [(0.375, "fitting surfels"), (0.5, "fitting 3 of 3")]
    assert [isinstance(doing, Ended) for _, doing in told] == [False, True]


@dataclass(frozen=True)
class Named:
    """A job that says what it is."""

    words: str


def ends(job: Named) -> Outcome:
    """Fail where the job is called so."""
    return Outcome(reason="as asked") if job.words == "bad" else Outcome()


def test_jobs_are_named_as_they_end():
    told: list[tuple[float, str]] = []
    run_all(ends, [Named("good"), Named("bad")], 1, lambda done, doing: told.append((done, doing)))
    assert told[:2] == [(0.0, "0 of 2"), (0.0, "0 of 2: good")]
    assert re.fullmatch(r"1 of 2: good, \d+\.\d s", told[2][1])
    assert told[3:] == [(0.5, "1 of 2: bad"), (1.0, "2 of 2: bad failed")]
    assert [isinstance(doing, Ended) for _, doing in told] == [False, False, True, False, True]


@dataclass(frozen=True)
class Nameless:
    """A job that is the only one and has no name."""


def works(job: object) -> Outcome:
    """Say how far it is."""
    worker_progress()(0.5, "half way")
    return Outcome()


@pytest.mark.parametrize(
    ("job", "lines"),
    [
        (Named("dark/a gray"), ["0 of 1", "0 of 1: dark/a gray", "0 of 1: dark/a gray: half way"]),
        (Nameless(), ["starting a process", "half way"]),
    ],
)
def test_jobs_that_say_how_far_they_are_are_named(job: object, lines: list[str]):
    told: list[str] = []
    run_all(works, [job], 1, lambda done, doing: told.append(doing))
    assert told[: len(lines)] == lines


def test_work_is_named_before_what_it_says():
    told: list[tuple[float, str]] = []
    report = named(lambda done, doing: told.append((done, doing)), "2dgs on dark/a")
    report(0.5, "fitting 400 surfels")
    report(1.0, Ended("all"))
    assert told == [(0.5, "2dgs on dark/a: fitting 400 surfels"), (1.0, "2dgs on dark/a: all")]
    assert isinstance(told[1][1], Ended)


def test_a_job_without_a_name_is_counted():
    assert words_of_job(object(), Outcome(), 1.0) == ""
    assert words_of_job(object(), Outcome(reason="x"), 1.0) == ", the last one failed"


def test_what_is_left_is_counted_from_the_first_share_not_from_imports():
    err, shown = console()
    with logged(err, "gray on dark/a", first_s=1e6, each_s=1e6) as report:
        threading.Event().wait(1.0)
        report(0.01, "fitting")
        report(0.1, Ended("a tenth"))
    assert re.fullmatch(r"\[10%, 0:01, about 0:00 left\] a tenth\n", shown.getvalue())


def test_another_stage_has_a_pace_of_its_own():
    err, shown = console()
    with logged(err, "goris on tabletop/a", first_s=1e6, each_s=1e6) as report:
        report(0.01, "colours")
        report(0.99, "colours")
        threading.Event().wait(0.3)
        report(0.0, "light")
        report(0.1, Ended("a tenth"))
    assert re.fullmatch(r"\[10%, 0:00, about 0:00 left\] a tenth\n", shown.getvalue())


def test_one_of_many_jobs_that_begins_a_stage_keeps_the_pace():
    err, shown = console()
    with logged(err, "suite demo", first_s=1e6, each_s=1e6) as report:
        report(0.01, "fitting")
        threading.Event().wait(0.3)
        report(0.06, "fitting")
        report(0.04, Ended("1 of 20"))
    assert re.fullmatch(r"\[4%, 0:00, about 0:\d\d left\] 1 of 20\n", shown.getvalue())


END = Ended("one more")
LEAPS: dict[str, tuple[list[tuple[float, float, str]], str]] = {
    "found-after-a-minute": (
        [(1, 0.01, "a"), (60, 0.33, END), (61, 0.65, "19 of 20"), (91, 0.7, END)],
        "3:00",
    ),
    "found-slowly": ([(1, 0.01, "a"), (60, 0.33, END), (65, 0.65, "19 of 20"), (95, 0.7, END)], "3:00"),
    "found-twice": ([(2, 0.33, "a"), (2.1, 0.65, "19 of 20"), (32.1, 0.7, END)], "3:00"),
    "long-steps": ([(10, 0.2, "a"), (20, 0.4, "b"), (30, 0.6, "c"), (30, 0.6, END)], "0:20"),
    "one-of-many-jobs": ([(1, 0.01, "a"), (61, 0.31, "a"), (61, 0.36, "b"), (71, 0.41, END)], "1:43"),
    "jobs-that-end-at-once": ([(10, 0.3, END), (10, 0.6, END), (20, 0.9, END)], "0:02"),
}
"""Times, shares and words of reports, and the time that is left, as the last says."""


@pytest.mark.parametrize("case", LEAPS)
def test_a_share_that_leaps_sets_no_pace_and_long_steps_do(case: str, monkeypatch: pytest.MonkeyPatch):
    reports, left = LEAPS[case]
    err, shown = console()
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr("graycard.cli._log.time", SimpleNamespace(monotonic=lambda: clock.now))
    log = _Log(err, "suite demo", each_s=1e6, started=0.0, told=0.0, due=1e6)
    for clock.now, done, words in reports:
        log.report(done, words)
    assert shown.getvalue().splitlines()[-1].partition("about ")[2].startswith(f"{left} left")


def test_what_was_found_done_sets_no_pace():
    err, shown = console()
    with logged(err, "suite demo", first_s=1e6, each_s=1e6) as report:
        threading.Event().wait(0.7)
        report(0.5, "fitting 0 of 20: dark/a gray")
        report(0.53, Ended("1 of 20"))
    assert re.fullmatch(r"\[53%, 0:01, about 0:00 left\] 1 of 20\n", shown.getvalue())
