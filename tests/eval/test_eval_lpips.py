# SPDX-License-Identifier: Apache-2.0
"""LPIPS where there are weights, with small random ones; never a download."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from graycard import DatasetError, WeightsError, open_predictions, open_truth
from graycard.eval.kinds._images import ImageRule
from graycard.eval.measures._lpips import lpips
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._training import Training
from graycard.networks import load_lpips as load_weights
from layer_references import write_random_weights

RNG = np.random.default_rng(6)
TRUE, PREDICTED = RNG.random((2, 48, 40, 3))
EVERYWHERE = np.ones((48, 40), bool)


@pytest.mark.usefixtures("random_lpips")
def test_identity_symmetry_and_the_mask() -> None:
    assert lpips(TRUE, TRUE, EVERYWHERE) == 0
    assert lpips(PREDICTED, TRUE, EVERYWHERE) == pytest.approx(lpips(TRUE, PREDICTED, EVERYWHERE), rel=1e-5)
    mask = EVERYWHERE.copy()
    mask[:, 20:] = False
    outside = np.where(mask[..., None], PREDICTED, 0.5)
    assert lpips(outside, TRUE, mask) == lpips(PREDICTED, TRUE, mask) > 0
    assert lpips(PREDICTED, TRUE, mask) != lpips(PREDICTED, TRUE, EVERYWHERE)


@pytest.mark.usefixtures("random_lpips")
def test_images_that_are_too_small() -> None:
    with pytest.raises(DatasetError, match="expected images of at least 31x31 pixels for LPIPS, got 40x30"):
        lpips(PREDICTED[:30], TRUE[:30], EVERYWHERE[:30])
    assert lpips(PREDICTED[:31, :31], TRUE[:31, :31], EVERYWHERE[:31, :31]) > 0


def test_a_folder_that_lacks_weights(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match=r"got none named features.0.weight, .* Put torchvision's alexnet"):
        load_weights(tmp_path)
    write_random_weights(tmp_path / "some")
    (tmp_path / "some" / "alex.safetensors").unlink()
    with pytest.raises(WeightsError, match=r"got none named lin0.model.1.weight"):
        load_weights(tmp_path / "some")


@pytest.mark.parametrize("name", ["a.pth", "a.safetensors"])
def test_a_damaged_file(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"no tensors")
    with pytest.raises(WeightsError, match=f"expected a file of tensors at .*{name}, got: .* Fetch it again"):
        load_weights(tmp_path)


def test_without_weights_it_cannot_be_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GRAYCARD_LPIPS", raising=False)
    with pytest.raises(
        WeightsError, match="expected GRAYCARD_LPIPS to name a folder of LPIPS weights, got none"
    ):
        lpips(PREDICTED, TRUE, EVERYWHERE)


def test_a_sheet_has_it_only_where_weights_are_named(
    write_tiny: Callable[..., Path],
    predict: Callable[..., Path],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    scene = write_tiny(tmp_path / "larger", size=(36, 31))
    folder = predict(scene)
    monkeypatch.delenv("GRAYCARD_LPIPS", raising=False)
    assert "novel_view.lpips" not in {s.metric for s in ge.score_predictions(folder, scene).scores}
    monkeypatch.setenv("GRAYCARD_LPIPS", str(tmp_path / "nowhere"))
    found = ge.score_predictions(folder, scene).score("novel_view.lpips")
    assert found.status == "failed"
    assert "nowhere" in found.reason


@pytest.mark.usefixtures("random_lpips")
def test_a_scene_of_small_views_goes_without(
    tiny_scenes: dict[str, Path], predict: Callable[..., Path]
) -> None:
    """Its 28 x 24 pixels are enough for VGG-16, and too few for AlexNet."""
    scores = ge.score_predictions(predict(tiny_scenes["dark"]), tiny_scenes["dark"]).scores
    assert [s.metric for s in scores if "lpips" in s.metric] == ["novel_view.lpips.vgg"]
    assert all(s.status != "failed" for s in scores)


def test_one_small_view_among_larger_ones_is_enough(
    tiny_scenes: dict[str, Path], predict: Callable[..., Path]
) -> None:
    truth, given = open_truth(tiny_scenes["dark"] / "truth"), open_predictions(predict(tiny_scenes["dark"]))
    views = [view for view in truth.views if view.split == "test"]
    metric, facts = ge.find_metric("novel_view.lpips"), SceneFacts(1.0, Training(frozenset(), (), {}))

    def is_judged(*sides: int) -> bool:
        sized = tuple(
            replace(view, camera=replace(view.camera, width=side, height=side))
            for view, side in zip(views, sides, strict=True)
        )
        return bool(ImageRule.scorer([metric], given, replace(truth, views=sized), facts).metrics)

    assert is_judged(31, 64)
    assert not is_judged(64, 30)
    assert not is_judged(30, 64)
