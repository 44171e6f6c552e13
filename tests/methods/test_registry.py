# SPDX-License-Identifier: Apache-2.0
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from graycard import MethodError, UnknownNameError, methods

GOOD = """
from graycard.methods import NoSettings
class Mine:
    summary = "Mine"
    needs = ()
    settings_type = NoSettings
    def fit(self, capture, priors, settings, seed, progress): ...
    def load(self, folder): ...
instance = Mine()
"""


@pytest.fixture
def plug_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """``plug_in("dist", "module", code, method="module:attribute")`` installs a distribution."""
    monkeypatch.syspath_prepend(tmp_path)

    def install(dist: str, module: str, code: str, **offered: str) -> None:
        (tmp_path / f"{module}.py").write_text(code)
        info = tmp_path / f"{dist}-0.3.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {dist}\nVersion: 0.3\n")
        lines = [f"{name} = {target}" for name, target in offered.items()]
        (info / "entry_points.txt").write_text("\n".join(["[graycard.methods]", *lines, ""]))
        monkeypatch.delitem(sys.modules, module, raising=False)

    return install


def test_our_own_are_there():
    assert {"truth", "gray", "input", "retinex"} <= methods.offers().keys()
    assert all(row.summary and not row.reason for row in methods.listings())


def test_an_entry_point_is_found_and_named(plug_in: Callable[..., None]):
    plug_in("graycard-mine", "mine_ep", GOOD, mine="mine_ep:Mine")
    assert methods.load_method("mine").summary == "Mine"
    row = next(row for row in methods.listings() if row.name == "mine")
    assert row.origin == "graycard-mine 0.3"
    assert methods.fingerprint("mine").startswith("graycard-mine 0.3 ")


def test_a_module_attribute_needs_no_packaging(plug_in: Callable[..., None], tmp_path: Path):
    plug_in("graycard-mine", "mine_ma", GOOD)
    assert methods.load_method("mine_ma:Mine").summary == "Mine"
    assert methods.load_method("mine_ma:instance").summary == "Mine"
    before = methods.fingerprint("mine_ma:Mine")
    (tmp_path / "mine_ma.py").write_text(GOOD + "# changed\n")
    assert methods.fingerprint("mine_ma:Mine") == before
    (tmp_path / "mine_ma.py").write_text(GOOD + "changed = 1\n")
    assert methods.fingerprint("mine_ma:Mine") != before


def test_a_module_beside_it_counts_once_it_is_imported(plug_in: Callable[..., None], tmp_path: Path):
    (tmp_path / "beside_it.py").write_text("x = 1\n")
    (tmp_path / "unused.py").write_text("x = 1\n")
    plug_in("graycard-mine", "mine_besides", f"from beside_it import x\n{GOOD}")
    before = methods.fingerprint("mine_besides:Mine")
    (tmp_path / "unused.py").write_text("x = 22\n")
    assert methods.fingerprint("mine_besides:Mine") == before
    (tmp_path / "beside_it.py").write_text("x = 22\n")
    assert methods.fingerprint("mine_besides:Mine") != before


def test_a_package_of_others_counts_as_far_as_it_is_reached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "theirs_pk").mkdir()
    for name, text in (
        ("__init__", ""),
        ("fit", f"from .inner import x\n{GOOD}"),
        ("inner", "x = 1"),
        ("far", ""),
    ):
        (tmp_path / "theirs_pk" / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    before = methods.fingerprint("theirs_pk.fit:Mine")
    (tmp_path / "theirs_pk" / "far.py").write_text("x = 22")
    assert methods.fingerprint("theirs_pk.fit:Mine") == before
    (tmp_path / "theirs_pk" / "inner.py").write_text("x = 22")
    assert methods.fingerprint("theirs_pk.fit:Mine") != before


def test_a_module_that_is_not_python_has_only_its_version():
    assert methods.fingerprint("sys:Method") == "named outright"


def test_a_plug_in_that_raises_on_import_hurts_only_itself(plug_in: Callable[..., None]):
    plug_in("graycard-broken", "broken_ep", "raise RuntimeError('no CUDA here')", broken="broken_ep:X")
    rows = {row.name: row for row in methods.listings()}
    assert rows["broken"].summary is None
    assert "RuntimeError: no CUDA here" in rows["broken"].reason
    assert "graycard-broken 0.3" in rows["broken"].reason
    assert rows["gray"].summary
    with pytest.raises(MethodError, match="Mend it; other methods are not affected"):
        methods.load_method("broken")


def test_a_plug_in_may_even_exit(plug_in: Callable[..., None]):
    plug_in("graycard-exit", "exit_ep", "import sys; sys.exit(3)", exits="exit_ep:X")
    rows = {row.name: row for row in methods.listings()}
    assert "SystemExit: 3" in rows["exits"].reason


def test_two_offers_of_one_name(plug_in: Callable[..., None]):
    plug_in("graycard-gray", "gray_ep", GOOD, gray="gray_ep:Mine")
    with pytest.raises(MethodError, match=r"got 2: graycard.methods._gray:GrayMethod .*graycard-gray 0.3"):
        methods.load_method("gray")
    assert methods.load_method("truth").summary


def test_the_nearest_name_is_offered():
    with pytest.raises(
        UnknownNameError, match=r"got 'retinx' \(did you mean 'retinex'\?\).*module:attribute"
    ):
        methods.load_method("retinx")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no_such_module:X", "No module named 'no_such_module'"),
        ("graycard:no_such_attribute", "has no attribute 'no_such_attribute'"),
        (
            "graycard.io:FORMAT_VERSION",
            "expected 'graycard.io:FORMAT_VERSION' to be a method, got 1 without summary",
        ),
    ],
)
def test_what_is_no_method(name: str, message: str):
    with pytest.raises(MethodError, match=message):
        methods.load_method(name)
