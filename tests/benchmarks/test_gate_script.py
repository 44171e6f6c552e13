# SPDX-License-Identifier: Apache-2.0
"""The gate's script for any service: where it takes the baseline from, and what it leaves as it was."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gate_action import ACTION, CONTEXTS, Runner, commit, git, make_repository

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the script is for bash")
TOKEN = "the-token-of-the-job"
HISTORY = """
[ "$1" = gate ] || exit 0
while [ $# -gt 1 ]; do
  case $1 in --history) place=$2 ;; --commit) commit=$2 ;; esac
  shift
done
[ "$1" != --write ] || exit 0
echo "worse: a score"
[ -n "${place:-}" ] || exit 1
! grep -qs damaged "$place/gate-history.json" || { echo "error: it is damaged" >&2; exit 2; }
echo "$commit" >>"$place/gate-history.json"
echo page >"$place/README.md"
echo "history: $place/README.md"
exit 1
"""
"""A program in the place of graycard: it finds a run worse, and adds a line to a history that is whole."""
GRAYCARD = f'#!/bin/sh\nexec "{sys.executable}" -m graycard "$@"\n'


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A clone with three commits, and a run that has no record."""
    checkout = make_repository(tmp_path)
    for word in ("second", "third"):
        (checkout / "mine.py").write_text(word)
        commit(checkout, word)
    program = tmp_path / "cache" / "env" / "bin" / "graycard"
    program.parent.mkdir(parents=True)
    program.write_text(GRAYCARD)
    program.chmod(0o755)
    (checkout / "graycard-gate").mkdir()
    (checkout / "graycard-gate" / "bench.code").write_text("0\n")
    return checkout


def gate(checkout: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GITHUB_")}
    environment |= {"GATE_CACHE": str(checkout.parent / "cache"), **variables}
    shell = ["bash", str(ACTION / "gate.sh"), "gate"]
    return subprocess.run(shell, cwd=checkout, env=environment, capture_output=True, text=True, check=False)


def test_a_branch_that_cannot_be_fetched_passes_nothing(checkout: Path):
    done = gate(checkout, GATE_BRANCH="mian")
    assert done.returncode == 2
    assert "expected a branch mian on the remote origin that can be fetched" in done.stderr
    git(checkout, "remote", "remove", "origin")
    assert gate(checkout).returncode == 2


def test_a_branch_without_a_baseline_passes_and_the_clone_stays_whole(checkout: Path):
    done = gate(checkout)
    assert done.returncode == 0, done.stderr
    assert "gate: passed: no graycard-baseline.json on main yet" in done.stdout
    assert len(git(checkout, "log", "--format=%h").splitlines()) == 3
    assert git(checkout, "rev-parse", "--is-shallow-repository").strip() == "false"


@pytest.fixture
def with_history(checkout: Path) -> Path:
    """The clone with a baseline on its branch, a program that writes histories, and a log of calls of git."""
    (checkout / "graycard-baseline.json").write_text("{}")
    (checkout / ".git" / "info" / "exclude").write_text("graycard-gate\n")
    commit(checkout, "Add the baseline")
    program = checkout.parent / "cache" / "env" / "bin" / "graycard"
    program.write_text(f"#!/bin/bash\n{HISTORY}")
    spy = checkout.parent / "spy" / "git"
    spy.parent.mkdir()
    spy.write_text(f'#!/bin/sh\necho "$@" >>"{spy.parent}/log"\nexec "{shutil.which("git")}" "$@"\n')
    spy.chmod(0o755)
    return checkout


def gate_with_history(checkout: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Return what a gate says that finds a run worse: so it says, whatever becomes of the history."""
    temporary = checkout.parent / "tmp"
    temporary.mkdir(exist_ok=True)
    path = os.pathsep.join([str(checkout.parent / "spy"), os.environ["PATH"]])
    done = gate(checkout, GATE_HISTORY="accuracy", PATH=path, TMPDIR=str(temporary), **variables)
    assert (done.returncode, done.stdout) == (1, "worse: a score\n"), done.stderr
    assert not [*temporary.iterdir()]
    return done


def history_of(checkout: Path) -> list[str]:
    return git(checkout.parent / "origin.git", "show", "accuracy:gate-history.json").splitlines()


def test_a_history_grows_on_its_branch_without_telling_the_token(with_history: Path):
    # As actions/checkout keeps it.
    git(with_history, "config", "http.https://github.com/.extraheader", f"AUTHORIZATION: basic {TOKEN}")
    head = git(with_history, "rev-parse", "HEAD").strip()
    before = git(with_history, "status", "--porcelain", "--ignored=no")
    for runs in (1, 2):
        assert gate_with_history(with_history).stderr == ""
        assert history_of(with_history) == [head] * runs
    commits = git(with_history, "rev-list", "FETCH_HEAD").splitlines()
    assert len(commits) == 1, "the branch is on its own"
    assert git(with_history, "status", "--porcelain", "--ignored=no") == before
    assert TOKEN not in (with_history.parent / "spy" / "log").read_text()
    kept = [path for path in (with_history / "graycard-gate").rglob("*") if path.is_file()]
    assert not [path for path in kept if TOKEN.encode() in path.read_bytes()]


def test_a_history_that_another_run_pushed_meanwhile_keeps_both(with_history: Path):
    gate_with_history(with_history)
    other, spy = with_history.parent / "other", with_history.parent / "spy" / "git"
    git(with_history.parent, "clone", "--quiet", "--branch", "accuracy", "origin.git", str(other))
    _record(other, "other\n")
    push = f'git -C "{other}" push --quiet origin HEAD:accuracy'
    spy.write_text(f'#!/bin/sh\nPATH={os.environ["PATH"]}\n[ "$1" != push ] || {push}\nexec git "$@"\n')
    assert gate_with_history(with_history).stderr == ""
    assert history_of(with_history) == ["other", git(with_history, "rev-parse", "HEAD").strip()]


def _record(other: Path, text: str) -> None:
    """Commit a history in another clone."""
    (other / "gate-history.json").write_text(text)
    git(other, "-c", "user.name=x", "-c", "user.email=x@localhost", "commit", "--quiet", "-am", "Other")


FAILURES = {
    "ls-remote": ("echo 'the network is gone' >&2; exit 128", "the network is gone"),
    "fetch": ("case $* in *accuracy*) echo 'it went away' >&2; exit 1 ;; esac", "it went away"),
    "hash-object": ("echo 'no room is left' >&2; exit 128", "no room is left"),
    "write-tree": ("echo 'no room is left' >&2; exit 128", "no room is left"),
    "push": ("echo 'the requested URL returned error: 403' >&2; exit 1", "permissions: contents: write"),
}
"""Faults of a call of git, and words of the reason."""


@pytest.mark.parametrize("call", FAILURES)
def test_a_history_that_fails_leaves_the_verdict_and_says_why(call: str, with_history: Path):
    gate_with_history(with_history)
    text, words = FAILURES[call]
    spy = with_history.parent / "spy" / "git"
    spy.write_text(
        f'#!/bin/bash\nif [ "$1" = {call} ]; then\n{text}\nfi\nexec "{shutil.which("git")}" "$@"\n'
    )
    said = gate_with_history(with_history).stderr
    assert said.startswith("gate: the history was not pushed, and the verdict stands. ")
    assert words in said
    assert ("contents: write" in said) == (call == "push")
    assert "GATE_BRANCH" not in said
    assert len(history_of(with_history)) == 1


def test_a_history_that_the_remote_refuses_is_said_in_its_words(with_history: Path):
    hook = with_history.parent / "origin.git" / "hooks" / "pre-receive"
    hook.write_text("#!/bin/sh\necho 'no more room' >&2\nexit 1\n")
    hook.chmod(0o755)
    said = gate_with_history(with_history).stderr
    assert "no more room" in said
    assert "contents: write" not in said


def test_a_damaged_history_is_left_as_it_is(with_history: Path):
    gate_with_history(with_history)
    other = with_history.parent / "other"
    git(with_history.parent, "clone", "--quiet", "--branch", "accuracy", "origin.git", str(other))
    _record(other, "damaged\n")
    git(other, "push", "--quiet", "origin", "HEAD:accuracy")
    head = git(other, "rev-parse", "HEAD")
    assert "error: it is damaged" in gate_with_history(with_history).stderr
    assert git(with_history.parent / "origin.git", "rev-parse", "accuracy") == head, "nothing was pushed"


def test_an_annotated_verdict_is_given_once(with_history: Path):
    calls = with_history.parent / "calls"
    program = with_history.parent / "cache" / "env" / "bin" / "graycard"
    program.write_text(f'#!/bin/bash\necho "$@" >>"{calls}"\n{HISTORY}')
    gate_with_history(with_history, GITHUB_ACTIONS="true")
    judged, kept = [
        line for line in calls.read_text().splitlines() if "--tolerance" in line and "gate " in line
    ][-2:]
    assert ("--annotate" in judged, "--json" in judged, "--history" in judged) == (True, True, False)
    assert ("--annotate" in kept, "--json" in kept, "--history" in kept) == (False, False, True)


def test_filters_of_the_checkout_leave_the_history_alone(with_history: Path):
    git(with_history, "config", "filter.lfs.clean", "tr a-z0-9 X")
    (with_history / ".git" / "info" / "attributes").write_text("* filter=lfs\n")
    assert gate_with_history(with_history).stderr == ""
    assert history_of(with_history) == [git(with_history, "rev-parse", "HEAD").strip()]


def test_a_tag_with_the_name_of_a_branch_is_not_taken_for_it(with_history: Path):
    gate_with_history(with_history)
    for name in ("main", "accuracy"):
        git(with_history, "push", "--quiet", "origin", f"HEAD~1:refs/tags/{name}")  # without a baseline
    assert gate_with_history(with_history).stderr == ""
    head = git(with_history, "rev-parse", "HEAD").strip()
    shown = git(with_history.parent / "origin.git", "show", "refs/heads/accuracy:gate-history.json")
    assert shown.splitlines() == [head, head]


def test_jobs_of_a_matrix_keep_their_runs_under_names_of_their_own(tmp_path: Path):
    def name(**contexts: str) -> str:
        values = {key.replace("_", ".", 1).replace("_", "-"): value for key, value in contexts.items()}
        return Runner(tmp_path, tmp_path, {}, contexts=CONTEXTS | values).artifact

    assert name() == "graycard-gate-gate-0"
    assert len({name(), name(strategy_job_index="1"), name(github_job="other")}) == 3
    assert Runner(tmp_path, tmp_path, {"artifact": "mine"}).artifact == "mine"


def test_pip_takes_the_address_of_its_index_from_a_variable(tmp_path: Path):
    fake = tmp_path / "python"
    fake.write_text(
        f'#!/bin/sh\necho "$0" "$@" "[$PIP_INDEX_URL]" >>"{tmp_path}/log"\n'
        '[ "$2" != venv ] || { mkdir -p "$3/bin"; cp "$0" "$3/bin/pip"; cp "$0" "$3/bin/graycard"; }\n'
    )
    fake.chmod(0o755)
    variables = {"PYTHON": str(fake), "GATE_CACHE": str(tmp_path / "cache"), "HOME": str(tmp_path)}
    index = f"https://x:{TOKEN}@example.org/simple"
    shell = ["bash", str(ACTION / "gate.sh"), "install"]
    environment = {"PATH": os.environ["PATH"], **variables, "GATE_TORCH_INDEX": index}
    subprocess.run(shell, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    calls = [line for line in (tmp_path / "log").read_text().splitlines() if " install " in line]
    torch, ours = calls
    assert torch.endswith(f" torch [{index}]")
    assert ours.endswith("[]"), "other packages come from where pip finds them"
    assert TOKEN not in torch.partition("[")[0] + ours
