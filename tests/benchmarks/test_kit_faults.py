# SPDX-License-Identifier: Apache-2.0
"""The check names every planted fault and no other, and finds none in methods that have none."""

from importlib import import_module
from pathlib import Path

import pytest

import faulty_methods
from graycard import UnknownNameError
from graycard.benchmarks.kit import KINDS, Findings, _decompositions, check_method
from graycard.benchmarks.kit import _check as check
from graycard.methods import BUILT_IN
from kit_here import checked_here

CONSEQUENCES = {"half-size": {"size"}, "unseeded": {"round-trip"}}
"""Names that a fault brings along besides its own."""
QUICK = (
    "no-method", "settings-open", "fit-raises", "percent", "swallows", "unseeded",
    "missing-layer", "stateful", "channels-first", "one-size", "tensor", "codes", "nan",
    "srgb-albedo", "exposed", "bgr", "opengl", "distance", "scaled-world", "light-frame",
    "relight-ignores", "remove-raises", "load-other", "pickle", "writes", "truth",
)  # fmt: skip
"""Faults that are planted in every run of the tests; the rest take as long again."""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenes")


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, dataset: Path) -> None:
    checked_here(monkeypatch, tmp_path, dataset)


def name_of(planted: str) -> str:
    return f"faulty_methods:has_{planted.replace('-', '_')}"


def named(found: Findings) -> list[str]:
    return [fault.name for fault in found.faults]


def test_a_method_without_a_fault_has_none(in_process: None):
    found = check_method("faulty_methods:Right")
    assert found.faults == ()
    assert found.provides == faulty_methods.LAYERS
    assert found.track == "dark"


def test_caches_of_pytorch_are_no_fault_of_a_method(in_process: None, tmp_path: Path):
    cache = import_module("torch._inductor.runtime.cache_dir_utils").cache_dir()
    assert Path(cache).is_relative_to(tmp_path)


@pytest.mark.parametrize(
    "planted",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in faulty_methods.FAULTS],
)
def test_each_planted_fault_is_named_and_no_other(
    planted: str, in_process: None, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(_decompositions, "_SLOW_S", 1.0)  # ten seconds would be long in a test
    wanted = faulty_methods.FAULTS[planted][1]
    found = check_method(name_of(planted))
    assert wanted in named(found), found.faults
    assert not {*named(found)} - {wanted} - CONSEQUENCES.get(planted, set()), found.faults


def test_faults_are_of_all_kinds_but_those_of_commands():
    planted = {wanted for _, wanted in [*faulty_methods.FAULTS.values(), *faulty_methods.ENDS.values()]}
    assert {*KINDS} - planted == {"import", "roughness", "command", "outputs"}
    assert len(QUICK) >= 25


def test_the_tutorial_names_every_fault_with_its_mend():
    page = (Path(__file__).parents[2] / "docs" / "tutorials" / "your-method.md").read_text()
    table = page.partition("## Faults that the check names")[2]
    rows = [line for line in table.splitlines() if line.startswith("| `")]
    assert rows == [f"| `{name}` | {kind.title} | {kind.mend} |" for name, kind in KINDS.items()]


def test_lines_of_the_method_alone_are_shown(in_process: None):
    (fault,) = check_method(name_of("fit-raises")).faults
    assert "ZeroDivisionError: by nothing" in fault.found
    assert fault.trace.count('File "') == fault.trace.count('faulty_methods.py"') > 0
    assert 'raise ZeroDivisionError("by nothing")' in fault.trace
    assert "confined" not in fault.trace


def test_a_method_that_cannot_be_imported_shows_its_line(
    in_process: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "broken_method.py").write_text("import math\n\nvalue = math.no_such_name\n")
    monkeypatch.syspath_prepend(tmp_path)
    (fault,) = check_method("broken_method:Method").faults
    assert fault.name == "import"
    assert "value = math.no_such_name" in fault.trace
    assert fault.trace.count('File "') == 1
    (tmp_path / "odd_method.py").write_text("def f(:\n")
    (fault,) = check_method("odd_method:Method").faults
    assert (fault.name, "def f(:" in fault.trace) == ("import", True)


@pytest.mark.parametrize("name", ["no-such-method", "2dsg"])
def test_an_unknown_method_is_no_fault(name: str):
    with pytest.raises(UnknownNameError):
        check_method(name)


@pytest.mark.parametrize(
    "planted",
    ["exits", *(pytest.param(name, marks=pytest.mark.slow) for name in ("hangs", "starts-programs"))],
)
def test_what_ends_its_process_or_does_not_end_is_named(planted: str, tmp_path: Path):
    wanted = faulty_methods.ENDS[planted][1]
    found = check_method(name_of(planted), timeout_s=5.0 if wanted == "hangs" else check.STAGE_S)
    assert named(found) == ([wanted] if wanted else [])


@pytest.mark.slow
def test_a_method_in_a_process_of_its_own_is_checked_as_well():
    found = check_method("gray")
    assert (found.faults, found.track) == ((), "dark")
    assert named(check_method(name_of("writes"))) == ["writes"]


@pytest.mark.slow
@pytest.mark.parametrize("name", BUILT_IN)
def test_methods_of_graycard_have_no_fault(name: str):
    assert check_method(name, timeout_s=600.0).faults == ()
