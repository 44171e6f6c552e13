# SPDX-License-Identifier: Apache-2.0
"""Sealed scenes are for tagged code alone, and a run on them says which tag that was."""

import base64
import hashlib
import subprocess
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from graycard.benchmarks import Terms, check_result, find_edition, load_suite, opened, run_bench
from graycard.benchmarks import _edition as edition
from graycard.benchmarks._run_record import RunError
from graycard.benchmarks.claims import claims_names
from graycard.benchmarks.validity import _edition as validity
from graycard.cli import main
from graycard.io import silent
from graycard.records import Edition, read_run
from tiny_benches import made_without_renderer, write_reserve_suite
from valid_runs import breaches, change

COMMIT = "0123456789abcdef0123456789abcdef01234567"


def git(root: Path, *words: str) -> str:
    who = ["-c", "user.name=tests", "-c", "user.email=tests@example.org"]
    command = ["git", *who, "-C", str(root), *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    root = tmp_path / "repository"
    root.mkdir()
    git(root, "init", "--quiet")
    (root / "suite.toml").write_text("one")
    git(root, "add", ".")
    git(root, "commit", "--quiet", "--message", "Begin")
    return root


def test_a_tag_of_unchanged_code_vouches(repository: Path) -> None:
    git(repository, "tag", "edition-1")
    found = edition.edition_of_checkout({"suite": repository / "suite.toml"}, repository)
    assert found == ("edition-1", git(repository, "rev-parse", "HEAD"))


def test_without_a_tag_nothing_is_opened(repository: Path) -> None:
    with pytest.raises(
        RunError, match="expected a tag at the commit before sealed scenes are rendered, got none"
    ):
        edition.edition_of_checkout({}, repository)


def test_a_changed_checkout_is_not_the_tag(repository: Path) -> None:
    git(repository, "tag", "edition-1")
    (repository / "suite.toml").write_text("two")
    with pytest.raises(RunError, match="expected a checkout without changes"):
        edition.edition_of_checkout({}, repository)


def test_claims_that_the_tag_does_not_have(repository: Path, tmp_path: Path) -> None:
    """Files that git does not know leave a checkout unchanged."""
    git(repository, "tag", "edition-1")
    for stray in (repository / "late.toml", tmp_path / "elsewhere.toml"):
        stray.write_text("late")
        with pytest.raises(
            RunError, match="expected claims as at edition-1 before sealed scenes are rendered"
        ):
            edition.edition_of_checkout({"claims": stray}, repository)


@pytest.mark.parametrize("ignored", [False, True])
def test_code_that_git_does_not_know_is_refused(repository: Path, ignored: bool) -> None:
    """Python that lies in the package can be imported, whether git ignores it or not."""
    package = repository / "src" / "graycard"
    (repository / "eval").mkdir()
    (repository / "eval" / "__init__.py").write_text("")
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "eval").symlink_to("../../eval")
    (repository / ".gitignore").write_text("_planted.py\n" if ignored else "")
    git(repository, "add", ".")
    git(repository, "commit", "--quiet", "--message", "Add a package")
    git(repository, "tag", "edition-1")
    (repository / "eval" / "notes.txt").write_text("no code")
    (repository / "scratch.py").write_text("not in the package")
    assert edition.edition_of_checkout({}, repository)[0] == "edition-1"
    for folder in (repository / "eval", package):
        planted = folder / "_planted.py"
        planted.write_text("")
        where = planted.relative_to(repository).as_posix()
        with pytest.raises(
            RunError, match=rf"expected no code in the package that git does not know .*{where}"
        ):
            edition.edition_of_checkout({}, repository)
        planted.unlink()


class Release:
    """An installed distribution with one file."""

    version = "3.1.0"

    def __init__(self, path: Path, url: str | None = None) -> None:
        digest = base64.urlsafe_b64encode(hashlib.sha256(path.read_bytes()).digest()).rstrip(b"=").decode()
        listed = SimpleNamespace(mode="sha256", value=digest)
        self.files: list[Any] = [SimpleNamespace(locate=lambda: path, hash=listed)]
        self._url = url

    def read_text(self, name: str) -> str | None:
        assert name == "direct_url.json"
        return self._url


def test_a_release_vouches_for_its_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "suite.toml"
    path.write_text("released")
    release = Release(path)
    monkeypatch.setattr(edition, "distribution", lambda name: release)
    assert edition.edition_of_release({"suite": path}) == ("v3.1.0", "")
    path.write_text("changed")
    with pytest.raises(RunError, match="expected suite of the release"):
        edition.edition_of_release({"suite": path})
    monkeypatch.setattr(edition, "distribution", lambda name: Release(path, "{}"))
    with pytest.raises(RunError, match="got an install from elsewhere"):
        edition.edition_of_release({"suite": path})


def test_what_is_not_installed_vouches_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(edition, "distribution", missing)
    with pytest.raises(RunError, match="expected a tagged checkout or a release"):
        edition.edition_of_release({})


def test_a_suite_of_ones_own_is_never_that_of_the_tag(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(write_reserve_suite(tmp_path))
    with pytest.raises(RunError, match="before sealed scenes are rendered"):
        find_edition(path)
    assert main(["bench", path, "--sealed", "--out", str(tmp_path / "run")]) == 2
    assert "what judges must be fixed before anybody sees them" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@pytest.fixture
def sealed_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write_tiny: Callable[..., Path]) -> Path:
    """A run on the sealed scenes of a suite, as if its code had been tagged."""
    suite = load_suite(str(write_reserve_suite(tmp_path)))
    made_without_renderer(monkeypatch, write_tiny)
    terms = Terms(edition=Edition("edition-1", COMMIT))
    run_bench(opened(suite), tmp_path / "run", 1, silent, whole=suite, terms=terms)
    change(tmp_path / "run", lambda data: data["environment"].update(git_commit=COMMIT[:12]))
    return tmp_path / "run"


def test_a_run_on_sealed_scenes_says_so_and_is_checked(
    sealed_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = read_run(sealed_run)
    assert [scene.scene for scene in record.scenes] == ["corridor-0601", "corridor-0602"]
    assert record.edition == Edition("edition-1", COMMIT)
    monkeypatch.setattr(validity, "git", lambda root, *words: "")
    (line,) = [b for b in check_result(sealed_run).breaches if b.rule in ("origin", "suite")]
    assert line.unknown
    assert "expected a checkout that knows the tag edition-1 or has its commit" in line.what
    without_tags = {"merge-base": COMMIT}
    monkeypatch.setattr(validity, "git", lambda root, verb, *words: without_tags.get(verb, ""))
    assert {"origin", "suite"}.isdisjoint(breaches(sealed_run))
    elsewhere = {"merge-base": "e" * 40}  # the last commit that both histories share is an older one
    monkeypatch.setattr(validity, "git", lambda root, verb, *words: elsewhere.get(verb, ""))
    (line,) = [b for b in check_result(sealed_run).breaches if b.rule in ("origin", "suite")]
    assert line.unknown
    monkeypatch.setattr(validity, "git", lambda root, *words: COMMIT)
    assert {"origin", "suite"}.isdisjoint(breaches(sealed_run))
    monkeypatch.setattr(validity, "git", lambda root, *words: "f" * 40)
    assert "expected edition-1 at 0123456789ab" in breaches(sealed_run)["origin"][0]
    suite = load_suite(str(tmp_path / "tiny-reserve.toml"))
    with pytest.raises(
        RunError, match="got one of 'tiny-reserve' version 1 on the sealed scenes of edition-1"
    ):
        run_bench(suite, sealed_run, 1, silent)


def test_sealed_scenes_without_their_tag(sealed_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(validity, "git", lambda root, *words: COMMIT)
    change(sealed_run, lambda data: data["environment"].update(git_commit="f" * 12))
    assert "expected a run of commit 0123456789ab, which edition-1 is" in breaches(sealed_run)["origin"][0]
    change(sealed_run, lambda data: data["environment"].update(git_commit=COMMIT[:12]))
    change(sealed_run, lambda data: data.update(edition=None))
    found = breaches(sealed_run)["suite"]
    assert any(
        "expected no scene that tiny-reserve keeps sealed, got one without --sealed" in x for x in found
    )


@pytest.mark.parametrize(
    ("suite", "names"), [("claims-dark", ["sunfaded"]), ("claims-dark-hd", claims_names())]
)
def test_a_tag_vouches_for_the_claims_that_may_judge_a_suite(
    suite: str, names: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(edition, "edition_of_checkout", lambda files, root: ("edition-9", "0" * 40))
    monkeypatch.setattr(edition, "edition_of_release", lambda files: ("edition-9", ""))
    assert sorted(find_edition(suite).claims) == sorted(names)
