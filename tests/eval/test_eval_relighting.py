# SPDX-License-Identifier: Apache-2.0
"""Pictures under changed lights and with an object put in: gauge, pooling, and what is missing."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from changed_scene import EDITS, enrich
from graycard import LightEdit, View, open_predictions, open_truth, srgb_encode
from graycard.io import write_layers
from graycard.predictions import finish_predictions, write_composed, write_relit
from graycard.records import ScoreSheet

Picture = Callable[[str, View, np.ndarray], np.ndarray | None]
Predict = Callable[..., Path]
PSNRS = ("relighting.psnr", *(f"relighting.psnr.{k}" for k in ("off", "moved", "recoloured", "environment")))
ALL = (*PSNRS, "relighting.ssim", "composition.psnr", "composition.ssim")


def exact(change: str, view: View, true: np.ndarray) -> np.ndarray:
    return true


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    return enrich(write_tiny(tmp_path_factory.mktemp("changed"), track="multilight"))


@pytest.fixture
def sheet_of(scene: Path, predict: Predict) -> Callable[..., ScoreSheet]:
    """``sheet_of(picture, change)``: predictions with pictures of every change that ``picture`` gives."""

    def make(picture: Picture, change: Callable[..., object] = lambda view, layers: layers) -> ScoreSheet:
        truth = open_truth(scene / "truth", check=False)
        folder = predict(scene, change)
        for view in (v for v in truth.views if v.split == "test"):
            for edit in EDITS:
                made = picture(edit.name, view, truth.relit(edit.name, view)["radiance"])
                if made is not None:
                    write_relit(folder, edit.name, view.name, made)
            made = picture("composition", view, truth.composed(view)["radiance"])
            if made is not None:
                write_composed(folder, view.name, made)
        finish_predictions(folder, open_predictions(folder), truth.lights())
        return ge.score_predictions(folder, scene)

    return make


def albedo_times(gains: np.ndarray | float) -> Callable[..., dict[str, np.ndarray]]:
    """A change of predicted layers that leaves all but the base colour alone."""

    def change(view: View, layers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return layers | {"base_color": layers["base_color"] * gains}

    return change


def value(sheet: ScoreSheet, metric: str) -> float:
    score = sheet.score(metric)
    assert score.status == "scored", score.reason
    assert score.value is not None
    return score.value


def test_the_truth_is_the_optimum(sheet_of: Callable[..., ScoreSheet]) -> None:
    sheet = sheet_of(exact)
    for metric in ALL:
        score = sheet.score(metric)
        assert score.value == score.optimum
        assert score.expected == score.scored == {"relighting.psnr": 8, "relighting.ssim": 8}.get(metric, 2)
    assert list(sheet.score("relighting.psnr").per_view)[:3] == [
        "without-lamp/test_001",
        "without-lamp/test_003",
        "moved-lamp/test_001",
    ]


def test_nothing_is_provided_where_nothing_is(sheet_of: Callable[..., ScoreSheet]) -> None:
    sheet = sheet_of(lambda change, view, true: None)
    assert {sheet.score(m).status for m in ALL} == {"not provided"}
    assert sheet.score("relighting.psnr.moved").reason == "no picture of moved-lamp"
    assert sheet.score("relighting.psnr").reason == f"no picture of {', '.join(e.name for e in EDITS)}"


def test_a_kind_of_change_may_be_left_out(sheet_of: Callable[..., ScoreSheet]) -> None:
    sheet = sheet_of(lambda change, view, true: None if change.startswith("environment") else true)
    assert value(sheet, "relighting.psnr.moved") == math.inf
    assert sheet.score("relighting.psnr.environment").status == "not provided"
    assert sheet.score("relighting.psnr").status == "not provided"
    assert sheet.score("relighting.psnr").reason == "no picture of environment-1"


def test_one_view_of_a_kind_may_not(sheet_of: Callable[..., ScoreSheet]) -> None:
    lost = ("moved-lamp", "test_003")
    sheet = sheet_of(lambda change, view, true: None if (change, view.name) == lost else true)
    for metric in ("relighting.psnr", "relighting.psnr.moved"):
        score = sheet.score(metric)
        assert score.status == "failed"
        assert score.value is None
        assert "got none of moved-lamp/test_003. Write all of a kind" in score.reason
    assert value(sheet, "relighting.psnr.off") == math.inf


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda x: x[:-1], "moved-lamp, test_001: expected radiance of shape"),
        (lambda x: x * np.nan, "moved-lamp, test_001: expected finite values in radiance"),
    ],
)
def test_a_faulty_picture_fails(
    sheet_of: Callable[..., ScoreSheet], spoil: Callable[[np.ndarray], np.ndarray], words: str
) -> None:
    sheet = sheet_of(lambda change, view, true: spoil(true) if change == "moved-lamp" else true)
    for metric in ("relighting.psnr", "relighting.ssim", "relighting.psnr.moved"):
        assert sheet.score(metric).status == "failed"
        assert words in sheet.score(metric).reason
        assert "(and 1 more)" in sheet.score(metric).reason
    assert value(sheet, "relighting.psnr.off") == value(sheet, "composition.psnr") == math.inf


def test_a_picture_without_radiance_fails(scene: Path, predict: Predict) -> None:
    folder = predict(scene)
    write_layers(folder / "composition/views/test_001.exr", {"depth": np.ones((24, 28), np.float32)})
    finish_predictions(folder, open_predictions(folder))
    score = ge.score_predictions(folder, scene).score("composition.psnr")
    assert score.status == "failed"
    assert "test_001: expected radiance, got depth. Write this layer" in score.reason


def test_a_picture_that_was_lost_after_it_was_listed(scene: Path, predict: Predict) -> None:
    folder = predict(scene)
    write_composed(folder, "test_001", np.zeros((24, 28, 3)))
    finish_predictions(folder, open_predictions(folder))
    (folder / "composition/views/test_001.exr").unlink()
    score = ge.score_predictions(folder, scene).score("composition.psnr")
    assert score.status == "failed"
    assert "got none: it changed after" in score.reason


def test_the_gauge_of_base_color_is_carried_over(sheet_of: Callable[..., ScoreSheet]) -> None:
    gains = np.array((2.0, 0.5, 4.0))
    darker = albedo_times(gains)
    carried = sheet_of(lambda change, view, true: true * gains, darker)
    for metric in PSNRS:
        assert value(carried, metric) == math.inf
    assert carried.score("relighting.psnr").gauge == pytest.approx(1 / gains)
    kept = sheet_of(exact, darker)
    assert value(kept, "relighting.psnr") < 20, "the picture must be in the gauge of the albedo"


def test_nothing_is_fitted_to_the_changed_pictures(sheet_of: Callable[..., ScoreSheet]) -> None:
    assert value(sheet_of(lambda change, view, true: true * 2), "relighting.psnr") < 20


def test_without_base_color_a_picture_is_taken_as_it_is(sheet_of: Callable[..., ScoreSheet]) -> None:
    def no_albedo(view: View, layers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {k: v for k, v in layers.items() if k != "base_color"}

    score = sheet_of(exact, no_albedo).score("relighting.psnr")
    assert (score.value, score.gauge) == (math.inf, (1, 1, 1))


def test_without_a_gauge_it_fails(sheet_of: Callable[..., ScoreSheet]) -> None:
    score = sheet_of(exact, albedo_times(0)).score("relighting.psnr")
    assert score.status == "failed"
    assert "black in channel R" in score.reason


def test_square_errors_are_averaged_over_changes_and_each_is_kept(
    scene: Path, sheet_of: Callable[..., ScoreSheet]
) -> None:
    offsets = {"without-lamp": 0.01, "moved-lamp": 0.02, "recoloured-lamp": 0.03, "environment-1": 0.04}
    truth = open_truth(scene / "truth", check=False)

    def off(change: str, view: View, true: np.ndarray) -> np.ndarray:
        return true + np.float32(offsets.get(change, 0) / truth.exposure)

    sheet = sheet_of(off)
    errors: dict[str, list[float]] = {}
    for edit in EDITS:
        for view in (v for v in truth.views if v.split == "test"):
            seen = truth.layers(view)["object_id"] > 0
            light = truth.relit(edit.name, view)["radiance"][seen].astype(float) * truth.exposure
            shown = srgb_encode(light + offsets[edit.name]) - srgb_encode(light)
            errors.setdefault(edit.name, []).append(float(np.mean(shown**2)))
    pooled = -10 * math.log10(np.mean(list(errors.values())))
    assert value(sheet, "relighting.psnr") == pytest.approx(pooled, abs=1e-4)
    kept = {name: -10 * math.log10(np.mean(found)) for name, found in errors.items()}
    assert sheet.score("relighting.psnr").breakdown == pytest.approx(kept, abs=1e-4)
    assert value(sheet, "relighting.psnr.moved") == pytest.approx(kept["moved-lamp"], abs=1e-4)


def test_the_ceiling_is_what_a_noise_free_picture_scores(sheet_of: Callable[..., ScoreSheet]) -> None:
    """Noise of the same size on the truth: two independent ones are 3 dB further apart than one."""
    rng = np.random.default_rng(5)
    sheet = sheet_of(lambda change, view, true: true + rng.normal(0, 1e-3, true.shape))
    for metric in (*PSNRS, "composition.psnr"):
        score = sheet.score(metric)
        assert score.noise_ceiling is not None
        assert value(sheet, metric) == pytest.approx(score.noise_ceiling, abs=0.6)
    assert sheet.score("relighting.ssim").noise_ceiling is None


def test_the_object_put_in_and_what_is_around_it(sheet_of: Callable[..., ScoreSheet]) -> None:
    def wrong_around(change: str, view: View, true: np.ndarray) -> np.ndarray:
        inside = np.zeros(true.shape, bool)
        inside[5:12, 8:15] = True
        return np.where(inside, true, true + np.float32(0.05))

    found = sheet_of(wrong_around).score("composition.psnr").breakdown
    assert found["object"] == math.inf
    assert found["around"] < 40
    assert "pot" not in found, "there is one change only"


@pytest.mark.parametrize(
    ("name", "kind"),
    [(e.name, k) for e, k in zip(EDITS, ("off", "moved", "recoloured", "environment"), strict=True)]
    + [("flash-moved", "moved"), ("flash-recoloured", "recoloured"), ("dimmed-lamp", None)],
)
def test_the_kind_of_a_change(name: str, kind: str | None) -> None:
    assert LightEdit(name, "").kind == kind


def test_a_dark_albedo_under_a_bright_light_composes_right(sheet_of: Callable[..., ScoreSheet]) -> None:
    """Light and albedo trade a gain, and the picture stays: a gauge would take it for half as bright."""
    sheet = sheet_of(exact, albedo_times(0.5))
    assert value(sheet, "composition.psnr") == math.inf
    assert sheet.score("composition.psnr").gauge is None
    assert value(sheet, "relighting.psnr") < 30
