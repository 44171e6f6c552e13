# SPDX-License-Identifier: Apache-2.0
"""An installed package is known by the hashes in its wheel, and says which files have changed since."""

import base64
import hashlib
import sys
from importlib.metadata import PathDistribution
from pathlib import Path

import pytest

from graycard.benchmarks import _installed
from graycard.benchmarks._installed import find_installed

FILES = {"graycard/__init__.py": b"", "graycard/eval/_psnr.py": b"x = 1\n", "graycard/suites/a.toml": b"[a]"}


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that a wheel was installed to, as pip leaves it."""
    return installed(tmp_path / "site", monkeypatch)


def installed(site: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write a small distribution of that name, with an installer's own lines in RECORD."""
    lines = ["../../bin/graycard,sha256=AAAA,10", "graycard-3.1.0.dist-info/RECORD,,"]
    for name, content in FILES.items():
        (site / name).parent.mkdir(parents=True, exist_ok=True)
        (site / name).write_bytes(content)
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        lines.append(f"{name},sha256={digest},{len(content)}")
    told = site / "graycard-3.1.0.dist-info"
    told.mkdir()
    (told / "METADATA").write_text("Metadata-Version: 2.4\nName: graycard\nVersion: 3.1.0\n")
    (told / "RECORD").write_text("\n".join(lines) + "\n")
    monkeypatch.setattr(_installed, "distribution", lambda name: PathDistribution(told))
    return site


def test_a_wheel_has_one_identity_wherever_it_lies(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    first = find_installed(site / "graycard")
    assert first is not None
    assert (first.version, first.changed, first.commit) == ("3.1.0", (), "")
    other = installed(tmp_path / "other" / "place", monkeypatch)
    assert find_installed(other / "graycard") == first


def test_changed_files_are_named(site: Path):
    before = find_installed(site / "graycard")
    (site / "graycard/eval/_psnr.py").write_text("x = 2\n")
    (site / "graycard/suites/a.toml").unlink()
    (site / "graycard/eval/_mine.py").write_text("")
    (site / "graycard/eval/_mine.pyc").write_text("compiled, of no account")
    after = find_installed(site / "graycard")
    assert before is not None
    assert after is not None
    assert after.changed == ("eval/_mine.py", "eval/_psnr.py", "suites/a.toml")
    assert after.sha256 == before.sha256, "the identity is that of the wheel"


@pytest.mark.parametrize(
    ("told", "commit"),
    [
        ('{"url": "https://x", "vcs_info": {"vcs": "git", "commit_id": "abc123"}}', "abc123"),
        ('{"url": "file:///x.whl", "archive_info": {}}', ""),
        ("{", ""),
        ("[]", ""),
    ],
)
def test_an_install_from_a_repository_names_its_commit(site: Path, told: str, commit: str):
    (site / "graycard-3.1.0.dist-info" / "direct_url.json").write_text(told)
    found = find_installed(site / "graycard")
    assert found is not None
    assert found.commit == commit


def test_a_checkout_is_no_installed_wheel(site: Path, tmp_path: Path):
    assert find_installed(tmp_path) is None, "the files that run are not those that are listed"


def test_an_index_that_this_python_has_is_read(monkeypatch: pytest.MonkeyPatch):
    """Files of a real distribution are as its RECORD says: pip's own, as the reader of RECORD is the same."""
    from importlib.metadata import distribution

    monkeypatch.setattr(_installed, "distribution", lambda name: distribution("pytest"))
    pytest_folder = Path(sys.modules["pytest"].__file__ or "").parent
    found = find_installed(pytest_folder)
    assert found is not None
    assert found.changed == ()
