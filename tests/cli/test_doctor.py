# SPDX-License-Identifier: Apache-2.0
"""Findings, mending and advice of `graycard doctor`."""

import json
from pathlib import Path
from typing import Any

import pytest

from graycard import WeightsError
from graycard.cli import main
from graycard.synth import use_renderer
from graycard.synth.renderer._variant import LLVM

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module", autouse=True)
def loaded() -> None:
    """Dr.Jit looks for LLVM once a process: let it, before a test hides the library."""
    use_renderer()


def test_doctor_finds_things_and_advises(tmp_path: Path, capsys: Capture):
    assert main(["doctor", "--json", str(tmp_path / "d.json")]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("doctor: ")
    names = [item["name"] for item in json.loads((tmp_path / "d.json").read_text())["result"]]
    assert names == [
        "graycard", "renderer", "processor", "GPU", "torch", "weights", "sandbox", "trust", "disk", "locks"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("source", "words"),
    [("pip", "from pip"), ("system", "of the system"), ("environment", "named by DRJIT_LIBLLVM_PATH")],
)
def test_doctor_says_which_llvm_is_used(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, source: Any, words: str
):
    found = LLVM(Path("/lib/libLLVM.so.19.1"), 19, source=source)
    monkeypatch.setattr("graycard.benchmarks._doctor.find_llvm", lambda: found)
    assert main(["doctor", "--json", str(tmp_path / "d.json")]) == 0
    renderer = json.loads((tmp_path / "d.json").read_text())["result"][1]
    assert renderer["found"].endswith(f"llvm_ad_rgb (LLVM 19 {words}, /lib/libLLVM.so.19.1)")


def test_doctor_without_llvm_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/nonexistent/libLLVM.so")
    assert main(["doctor", "--json", str(tmp_path / "d.json")]) == 0
    renderer = json.loads((tmp_path / "d.json").read_text())["result"][1]
    assert "scalar_rgb" in renderer["found"]
    assert "/nonexistent/libLLVM.so" in renderer["advice"]


@pytest.fixture
def mendable(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A working directory with a run whose bench was killed; nothing is compiled or downloaded."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("graycard.methods.splat.warm_kernels", lambda **_: ["trace"])
    monkeypatch.setattr("graycard.networks.state_of", lambda one: "fetched" if one.name == "lpips" else "no")
    (tmp_path / "runs/smoke/jobs").mkdir(parents=True)
    (tmp_path / "runs/smoke/jobs/.lock").write_text("")
    return tmp_path


def test_doctor_mends_what_it_can(mendable: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture):
    fetched = mendable / "inception.safetensors"
    fetched.write_bytes(bytes(2_000_000))
    monkeypatch.setattr("graycard.networks.fetch_weights", lambda *_: (fetched,))
    assert main(["doctor", "--mend"]) == 0
    assert capsys.readouterr().out.splitlines()[:4] == [
        "mend kernels: 1 jobs compiled",
        "mend weights lpips: are here",
        "mend weights inception: fetched, 2 MB",
        "mend leftovers: 1 removed in 1 folder",
    ]
    assert not (mendable / "runs/smoke/jobs/.lock").exists()


def test_doctor_goes_on_after_what_it_cannot_mend(
    mendable: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
):
    def offline(*_: object) -> None:
        raise WeightsError("expected a network, got none")

    def absent(**_: object) -> None:
        raise ModuleNotFoundError("No module named 'numba'", name="numba")

    monkeypatch.setattr("graycard.networks.fetch_weights", offline)
    monkeypatch.setattr("graycard.methods.splat.warm_kernels", absent)
    assert main(["doctor", "--mend", "--folders", str(mendable / "runs/smoke")]) == 1
    said = capsys.readouterr()
    assert "failed: kernels: expected the package numba" in said.err
    assert "failed: weights inception: expected a network, got none" in said.err
    assert "mend leftovers: 1 removed in 1 folder" in said.out
    assert main(["doctor", "--mend", "--folders", "gone"]) == 1
    assert main(["doctor", "--folders", "runs"]) == 2, "it would do nothing"
    assert "expected a folder of a run or dataset, got nothing at gone" in capsys.readouterr().err


def test_doctor_names_what_a_light_installation_lacks(monkeypatch: pytest.MonkeyPatch, capsys: Capture):
    monkeypatch.setattr("graycard._missing._is_installed", lambda name: name != "numba")
    assert main(["doctor"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("graycard "))
    assert ", without numba" in row
    assert "for all verbs run `" in row


def test_doctor_compiles_kernels_on_request(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Capture):
    for compiled, said in ((["trace"], "kernels: 1 jobs compiled"), ([], "kernels: nothing to compile")):
        monkeypatch.setattr("graycard.methods.splat.warm_kernels", lambda found=compiled, **_: found)
        assert main(["doctor", "--warm", "--json", str(tmp_path / "d.json")]) == 0
        assert said in capsys.readouterr().out


def test_doctor_tells_of_a_misspelt_kind_of_locks(monkeypatch: pytest.MonkeyPatch, capsys: Capture):
    monkeypatch.setenv("GRAYCARD_LOCKS", "file")
    assert main(["doctor"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "expected GRAYCARD_LOCKS to be files or kernel, got 'file'" in shown
