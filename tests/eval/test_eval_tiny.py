# SPDX-License-Identifier: Apache-2.0
"""Pictures that are smaller than a window: a score, or a reason why there is none, and never a traceback."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from changed_scene import enrich
from graycard import View, open_predictions, open_truth
from graycard.cli import main
from graycard.predictions import finish_predictions, write_composed, write_relit

Predict = Callable[..., Path]
REASONS = ("of at least", "inside its mask eroded by", "that sees a colour")


@pytest.fixture(params=["dark", "multilight", "tabletop"])
def track(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(params=[(1, 1), (3, 3), (8, 6), (2, 30)], ids=lambda size: f"{size[0]}x{size[1]}")
def size(request: pytest.FixtureRequest) -> tuple[int, int]:
    return request.param


def darker(view: View, layers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: 0.9 * values for name, values in layers.items()}


def predicted(scene: Path, predict: Predict) -> Path:
    """Write all layers, and pictures of every change."""
    truth, folder = open_truth(scene / "truth", check=False), predict(scene, darker)
    for view in (v for v in truth.views if v.split == "test"):
        for edit in truth.edits:
            write_relit(folder, edit.name, view.name, truth.relit(edit.name, view)["radiance"])
        if truth.composition() is not None:
            write_composed(folder, view.name, truth.composed(view)["radiance"])
    finish_predictions(folder, open_predictions(folder), truth.lights())
    return folder


def test_a_tiny_picture_has_scores_or_reasons(
    make_scene: Callable[..., Path], predict: Predict, track: str, size: tuple[int, int]
) -> None:
    scene = make_scene(track=track, size=size)
    scene = scene if track == "dark" else enrich(scene)
    sheet = ge.score_predictions(predicted(scene, predict), scene, "all")
    failed = [s for s in (*sheet.scores, *sheet.protocols) if s.status == "failed"]
    assert {s.metric.rpartition(".")[2] for s in failed if s in sheet.scores} == {"ssim", "lmse"}
    assert all(any(words in s.reason for words in REASONS) for s in failed)
    assert all(np.isfinite(s.value) for s in sheet.scores if s.value is not None and s.unit != "dB")
    for metric in ("novel_view.psnr", "albedo.psnr.channel", "normal.mean_angle", "depth.abs_rel"):
        assert sheet.score(metric).status == "scored"
    if track == "multilight":
        assert sheet.score("relighting.psnr").status == sheet.score("composition.psnr").status == "scored"
        assert "at least 11x11 pixels for SSIM" in sheet.score("relighting.ssim").reason


@pytest.mark.parametrize(
    "method", [*(pytest.param(name, marks=pytest.mark.slow) for name in ("gray", "input")), "retinex"]
)
def test_the_command_line_says_what_to_do(
    make_scene: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    size: tuple[int, int],
    method: str,
) -> None:
    scene, out = str(make_scene(size=size)), str(tmp_path / "p")
    assert main(["fit", method, scene, "--out", out]) == 0
    assert main(["score", out, scene]) == 1
    said = capsys.readouterr()
    assert "Render the scene larger" in said.err
    assert "Traceback" not in said.err
    assert "albedo.psnr.channel" in said.out
