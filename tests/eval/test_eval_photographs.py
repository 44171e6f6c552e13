# SPDX-License-Identifier: Apache-2.0
"""Imported captures are judged by their held-out photographs, apart from all that is judged by truth."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from skimage.metrics import peak_signal_noise_ratio

from graycard import (
    DatasetError,
    GraycardError,
    Predictions,
    RecordError,
    Truth,
    View,
    capture_folders,
    open_capture,
    open_truth,
    srgb_decode,
)
from graycard.cli import main
from graycard.dataset import HELD_OUT, is_imported, open_held_out
from graycard.eval import all_metrics, find_hints, score_photographs, score_predictions
from graycard.io import write_json
from graycard.predictions import finish_predictions, write_view
from graycard.records import KIND, read_photograph_sheet, read_score_sheet
from real_captures import codes_of, encode_by_hand, import_bracketed, import_tiny, predict_photographs

Tiny = Callable[..., Path]


@pytest.fixture(scope="module")
def cellar(tmp_path_factory: pytest.TempPathFactory, write_tiny: Tiny) -> Path:
    return import_tiny(tmp_path_factory.mktemp("cellar"), write_tiny)


def noisy(view: View, light: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(len(view.name) + int(view.name[-1]))
    return (light * rng.uniform(0.8, 1.2, light.shape)).astype(np.float32)


def test_held_out_photographs_are_kept_beside_the_capture(cellar: Path) -> None:
    held, capture = open_held_out(cellar), open_capture(cellar / "capture")
    assert [v.name for v in held.views] == [v.name for v in capture.test]
    assert held.lacking == ()
    assert is_imported(cellar)
    assert capture_folders(cellar.parents[1]) == [cellar]
    for view in held.views:
        np.testing.assert_allclose(held.photograph(view), codes_of(cellar, view.name), atol=1e-6)
        assert not (cellar / "capture" / "photographs" / f"{view.name}.exr").exists()
    with pytest.raises(DatasetError, match="expected a held-out view with a photograph"):
        held.photograph(capture.train[0])


def test_psnr_is_that_of_scikit_image(cellar: Path, tmp_path: Path) -> None:
    """Displayed values, with the mean square error of all views; and values as taken, by the files' own
    codes."""
    sheet = score_photographs(predict_photographs(tmp_path / "mine", cellar, noisy), cellar)
    held = open_held_out(cellar)
    found = {score.metric: score for score in sheet.scores}
    for exposure, value in (
        (held.capture.exposure, found["photographs.psnr"].value),
        (1.0, found["photographs.psnr"].breakdown["as_taken"]),
    ):
        pictures = [
            [np.clip(encode_by_hand(x.astype(np.float64) * exposure), 0, 1) for x in (p, noisy(view, p))]
            for view in held.views
            for p in [held.photograph(view)]
        ]
        true, predicted = (np.stack(x) for x in zip(*pictures, strict=True))
        assert value == pytest.approx(peak_signal_noise_ratio(true, predicted, data_range=1), abs=1e-4)
    assert found["photographs.psnr"].expected == found["photographs.psnr"].scored == 3


FACTORS = 0.25, 1.0, 4.0, 2.0


def test_each_photograph_is_compared_at_its_own_exposure(tmp_path: Path, write_tiny: Tiny) -> None:
    """Light that is right is right where a long exposure was full; PSNR is that of the files' own codes."""
    scene = import_bracketed(tmp_path, write_tiny, FACTORS)
    held, mine = open_held_out(scene), tmp_path / "right"
    truth = open_truth(tmp_path / "rendered" / "dark" / "tiny-0000" / "truth")
    assert len({held.exposure(view) for view in held.views}) == 3
    unit = float(np.median(held.photograph(held.views[0])) / np.median(true_light(truth, held.views[0])))
    for view in (*held.capture.train, *held.views):
        write_view(mine, view.name, {"radiance": unit * true_light(truth, view)})
    finish_predictions(mine, Predictions("mine", "dark", "cellar"))
    found = {score.metric: score for score in score_photographs(mine, scene).scores}
    assert (found["photographs.psnr"].value or 0) > 45
    assert "as_taken" not in found["photographs.psnr"].breakdown
    off = predict_photographs(tmp_path / "off", scene, noisy)
    levels = [held.capture.exposure * held.exposure(view) for view in held.views]
    predicted = [
        np.clip(encode_by_hand(np.float64(level) * noisy(view, held.photograph(view))), 0, 1)
        for level, view in zip(levels, held.views, strict=True)
    ]
    codes = [np.asarray(Image.open(tmp_path / "away" / "images" / f"{v.name}.png")) / 255 for v in held.views]
    value = peak_signal_noise_ratio(np.stack(codes), np.stack(predicted), data_range=1)
    scored = next(s for s in score_photographs(off, scene).scores if s.metric == "photographs.psnr")
    assert scored.value == pytest.approx(value, abs=0.01)


def true_light(truth: Truth, view: View) -> np.ndarray:
    return truth.layers(truth.view(view.name))["radiance"]


def test_exposures_of_held_out_photographs_lie_beside_them(tmp_path: Path, write_tiny: Tiny) -> None:
    """Those of training views are the capture's; a held-out one ends at its own white."""
    scene = import_bracketed(tmp_path, write_tiny, FACTORS)
    held = open_held_out(scene)
    assert held.sensor is not None
    assert {*held.sensor.exposures} == {view.name for view in held.views}
    assert held.capture.sensor is not None
    assert {*held.capture.sensor.exposures} == {view.name for view in held.capture.train}
    for view in held.views:
        white = held.photograph(view).max() * held.capture.exposure * held.exposure(view)
        codes = np.asarray(Image.open(tmp_path / "away" / "images" / f"{view.name}.png"))
        assert white == pytest.approx(srgb_decode(np.array(codes.max() / 255)), rel=1e-4)
    (scene / HELD_OUT / "sensor.json").write_text('{"exposures": {"test_000": -1}}')
    with pytest.raises(DatasetError, match=r"sensor\.json"):
        open_held_out(scene)


def test_a_perfect_picture_is_perfect(cellar: Path, tmp_path: Path) -> None:
    sheet = score_photographs(predict_photographs(tmp_path / "mine", cellar), cellar)
    for score in sheet.scores:
        assert score.value == pytest.approx(score.optimum, abs=1e-9)
        assert score.noise_ceiling is None
        assert score.warnings == ()


def test_no_score_can_be_taken_for_one_with_truth(cellar: Path, tmp_path: Path) -> None:
    """They have ids, a protocol and a record of their own, which no reader of the other kind takes."""
    mine = predict_photographs(tmp_path / "mine", cellar)
    sheet = score_photographs(mine, cellar)
    assert {s.metric.partition(".")[0] for s in sheet.scores} == {"photographs"}
    assert {s.protocol for s in sheet.scores} == {"photographs-2"}
    assert not {s.metric for s in sheet.scores} & {metric.id for metric in all_metrics()}
    assert [m.id for m in sheet.metrics] == [s.metric for s in sheet.scores]
    assert sheet.kind == KIND == "photographs, no truth"
    write_json(tmp_path / "sheet.json", sheet)
    assert read_photograph_sheet(tmp_path / "sheet.json") == sheet
    with pytest.raises(RecordError):
        read_score_sheet(tmp_path / "sheet.json")
    with pytest.raises(DatasetError, match="which has no truth: methods that need none can be fitted"):
        score_predictions(mine, cellar)


def test_layers_beside_light_are_not_judged(cellar: Path, tmp_path: Path) -> None:
    mine = predict_photographs(tmp_path / "mine", cellar)
    other = predict_photographs(tmp_path / "other", cellar, noisy)
    assert {s.metric for s in score_photographs(mine, cellar).scores} == {
        "photographs.psnr", "photographs.ssim", "photographs.flip",
    }  # fmt: skip
    worse, better = ({s.metric: s.value for s in score_photographs(x, cellar).scores} for x in (other, mine))
    assert (worse["photographs.psnr"] or 0) < (better["photographs.psnr"] or 0)
    assert (worse["photographs.flip"] or 0) > (better["photographs.flip"] or 0)


def test_lpips_comes_with_its_weights(cellar: Path, tmp_path: Path, random_lpips: Path) -> None:
    sheet = score_photographs(predict_photographs(tmp_path / "mine", cellar), cellar)
    assert [s.metric for s in sheet.scores][-1] == "photographs.lpips.vgg"
    assert sheet.scores[-1].status == "scored"
    names = {s.metric for s in sheet.scores}
    assert "photographs.lpips" not in names, "AlexNet needs 31 pixels, VGG-16 needs 16"
    assert {metric.id for metric in sheet.metrics} == names


def test_a_wrong_picture_is_hinted_at(cellar: Path, tmp_path: Path) -> None:
    def encoded(view: View, light: np.ndarray) -> np.ndarray:
        return encode_by_hand(light).astype(np.float32)

    mine = predict_photographs(tmp_path / "mine", cellar, encoded)
    sheet = score_photographs(mine, cellar)
    assert any("radiance looks" in says and "sRGB" in says for says in sheet.scores[0].warnings)
    assert "sRGB" in find_hints(mine, cellar)[0].says


def test_a_missing_view_fails_and_is_named(cellar: Path, tmp_path: Path) -> None:
    mine = predict_photographs(tmp_path / "mine", cellar)
    name = open_held_out(cellar).views[1].name
    (mine / "views" / f"{name}.exr").unlink()
    for score in score_photographs(mine, cellar).scores:
        assert score.status == "failed"
        assert name in score.reason


def test_views_without_a_photograph_are_named(tmp_path: Path, write_tiny: Tiny) -> None:
    scene = import_tiny(tmp_path, write_tiny, leave_out=("test_003",))
    sheet = score_photographs(predict_photographs(tmp_path / "p", scene), scene)
    assert (sheet.views, sheet.lacking) == (2, ("test_003",))
    shutil.rmtree(scene / HELD_OUT)
    with pytest.raises(DatasetError, match="got 3 held-out views without one. Import the capture again"):
        open_held_out(scene)


def test_damaged_photographs_are_refused(tmp_path: Path, write_tiny: Tiny) -> None:
    scene = import_tiny(tmp_path, write_tiny)
    mine = predict_photographs(tmp_path / "p", scene)
    path = next((scene / HELD_OUT / "photographs").iterdir())
    path.write_bytes(path.read_bytes() + b" ")
    with pytest.raises(DatasetError, match=f"the first photographs/{path.name}"):
        score_photographs(mine, scene)


def test_the_verbs_say_what_is_judged_and_what_to_run(
    cellar: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = predict_photographs(tmp_path / "mine", cellar, noisy)
    assert main(["score", str(mine), str(cellar), "--json", str(tmp_path / "s.json")]) == 0
    said = capsys.readouterr().out
    assert "photographs, no truth: light alone is judged, by 3 held-out photographs" in said
    assert "3 scored by photographs, no truth, 0 failed; see them: graycard report" in said
    assert read_photograph_sheet(tmp_path / "s.json").method == "mine"
    assert main(["score", str(mine), str(cellar), "--protocol", "albedo"]) == 2
    assert "expected a protocol without truth that exists, got 'albedo'" in capsys.readouterr().err
    assert main(["report", str(cellar)]) == 2
    assert "Make some: `graycard fit 2dgs" in capsys.readouterr().err
    assert main(["report", str(tmp_path), "--predictions", f"a={mine}"]) == 2
    assert "expected --predictions with an imported capture" in capsys.readouterr().err


def test_a_scene_with_truth_has_its_report_in_a_bench(
    tiny_scenes: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", str(tiny_scenes["dark"]), "--predictions", "a=b"]) == 2
    assert "got a scene with truth" in capsys.readouterr().err


def test_a_bench_of_scenes_says_what_to_run(cellar: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", str(cellar.parents[1])]) == 2
    said = capsys.readouterr().err
    assert f"graycard fit 2dgs {cellar} --out mine" in said
    assert f"graycard report {cellar} --predictions 2dgs=mine" in said


def test_predictions_of_another_scene_are_refused(
    cellar: Path, tiny_scenes: dict[str, Path], predict: Callable[..., Path]
) -> None:
    with pytest.raises(GraycardError, match="for dark/cellar, got some for dark/tiny-0000"):
        score_photographs(predict(tiny_scenes["dark"]), cellar)
