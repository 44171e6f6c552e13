# SPDX-License-Identifier: Apache-2.0
"""One registry of metrics: a metric is one file, and everything else finds it."""

import re
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
import graycard.eval.metrics
from changed_scene import enrich
from docs_of_scores import ceiling_table, metric_table, reference_table
from graycard import UnknownNameError, View, open_predictions, open_truth
from graycard.dataset import manifest_of
from graycard.edits import composed_file
from graycard.eval.metrics import _registry
from graycard.eval.scoring._comparison import REGIONS
from graycard.io import sha256, write_json, write_layers, write_manifest
from graycard.predictions import finish_predictions
from graycard.records import Job, JobResult, MethodRecord, RunRecord, SceneRecord, ScoreSheet
from graycard.reports import write_report
from opened import opened

Predict = Callable[..., Path]
Layers = dict[str, np.ndarray]
FILE = '''# SPDX-License-Identifier: Apache-2.0
"""Mean difference of base colour."""

import numpy as np

from graycard.eval.kinds._images import ImageMetric, ImageRule
from graycard.eval.kinds._records import error
from graycard.eval.kinds._references import Reference
from graycard.eval.measures._pixelwise import Pixelwise, absolute_errors
from graycard.eval.measures._spaces import linear
from graycard.eval.scoring._ceiling import NO_LIGHT_PATH
from graycard.eval.scoring._comparison import REGIONS

METRICS = (
    ImageMetric(
        record=error("albedo", "mae", "Albedo error, mean", "mean of |p - t| of base_color", tolerance=0.02),
        rule=ImageRule(linear, Pixelwise(absolute_errors, np.mean)),
        layers=("base_color",),
        ceiling=NO_LIGHT_PATH,
        references=(Reference("mean difference", "scipy.spatial.distance, city block", 1e-9),),
        breakdown=REGIONS,
        after="albedo.psnr.channel",
    ),
)
'''


@pytest.fixture
def one_file_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A metric in a file of the folder of metrics; the id of the metric."""
    folder = tmp_path / "metrics"
    folder.mkdir()
    (folder / "_mae.py").write_text(FILE, encoding="utf-8")
    monkeypatch.setattr(graycard.eval.metrics, "__path__", [*graycard.eval.metrics.__path__, str(folder)])
    monkeypatch.delitem(sys.modules, "graycard.eval.metrics._mae", raising=False)
    return "albedo.mae"


def lighter(view: View, layers: Layers) -> Layers:
    return layers | {"base_color": layers["base_color"] + np.float32(0.125)}


def test_a_metric_in_a_file_of_its_own_is_scored_in_its_place(
    one_file_more: str, tiny_scenes: dict[str, Path], predict: Predict
) -> None:
    scene = tiny_scenes["dark"]
    sheet = ge.score_predictions(predict(scene, lighter), scene)
    assert sheet.score(one_file_more).value == pytest.approx(0.125, abs=1e-6)
    ids = [score.metric for score in sheet.scores]
    assert ids[ids.index("albedo.psnr.channel") + 1] == one_file_more
    assert ids == [m.id for m in ge.all_metrics() if m.id in ids]


def test_a_metric_in_a_file_of_its_own_stands_in_the_tables_of_the_docs(one_file_more: str) -> None:
    rows = re.findall(r"^\| `([^`]*)`", metric_table(), re.MULTILINE)
    assert rows[rows.index("albedo.psnr.channel") + 1] == one_file_more
    assert f"`{one_file_more}`" in ceiling_table()
    assert "| mean difference | scipy.spatial.distance, city block | 1e-09 |" in reference_table()


def test_a_metric_in_a_file_of_its_own_stands_in_the_report(
    one_file_more: str, tiny_scenes: dict[str, Path], predict: Predict, tmp_path: Path
) -> None:
    scene = tiny_scenes["dark"]
    sheet = ge.score_predictions(predict(scene, lighter), scene)
    page = opened(write_report(run_of(sheet, scene, tmp_path / "run")).read_text(encoding="utf-8"))
    assert "Albedo error, mean" in page
    assert "mean of |p - t| of base_color" in page


def run_of(sheet: ScoreSheet, scene: Path, folder: Path) -> Path:
    """A run of one job."""
    shutil.copytree(scene, folder / "dataset" / sheet.track / sheet.scene)
    digest = sha256(scene / "truth" / "manifest.json")
    place = sheet.track, sheet.scene
    record = SceneRecord(*place, "tiny", 0, f"dataset/{sheet.track}/{sheet.scene}", digest, "A ball")
    result = JobResult(Job(*place, "truth", 0, {}), "0123", "jobs/truth", "done", sheet=sheet)
    methods = (MethodRecord("truth", "The truth.", ()),)
    run = RunRecord(
        "hand", 1, (record,), methods, ge.all_metrics(), (result,), {}, "2026-11-21T09:47:14+00:00", 1.0
    )
    write_json(folder / "run.json", run)
    return folder


def test_the_file_is_gone_with_its_folder() -> None:
    assert "albedo.mae" not in {m.id for m in ge.all_metrics()}
    with pytest.raises(UnknownNameError, match=r"a metric that exists, got 'albedo.mae'.*did you mean"):
        ge.find_metric("albedo.mae")


def test_a_metric_may_be_added_for_a_while(tiny_scenes: dict[str, Path], predict: Predict) -> None:
    lmse = ge.find_metric("albedo.lmse")
    mine = replace(lmse, record=replace(lmse.record, id="albedo.mine"))
    with ge.registered(mine):
        assert ge.registry()[-1] is ge.find_metric("albedo.mine") is mine
        sheet = ge.score_predictions(predict(tiny_scenes["dark"], lighter), tiny_scenes["dark"])
    assert sheet.scores[-1].metric == "albedo.mine"
    assert sheet.scores[-1].value == sheet.score("albedo.lmse").value
    assert mine not in ge.registry()


def test_an_id_is_given_once() -> None:
    lmse = ge.find_metric("albedo.lmse")
    with (
        ge.registered(lmse),
        pytest.raises(ValueError, match="one metric for each id, got two of albedo.lmse"),
    ):
        ge.registry()


def test_a_place_behind_nothing_is_refused() -> None:
    lmse = ge.find_metric("albedo.lmse")
    lost = replace(lmse, record=replace(lmse.record, id="albedo.mine"), after="albedo.mea")
    with ge.registered(lost), pytest.raises(ValueError, match="got after='albedo.mea'. Name the id"):
        ge.registry()


def test_the_order_names_modules_that_exist_each_once() -> None:
    """A module that it does not name comes after those that it names."""
    folder = Path(_registry.__file__).parent
    modules = {path.stem for path in folder.glob("_*.py")} - {"__init__", "_registry"}
    assert set(_registry._ORDER) <= modules
    assert len(set(_registry._ORDER)) == len(_registry._ORDER)


def test_a_breakdown_has_the_names_that_its_metric_declares(
    make_scene: Callable[..., Path], predict: Predict
) -> None:
    """Names of single changes of the scene come on top; regions need pixels that are called pure."""
    scene = enrich(make_scene(track="tabletop"))
    truth = open_truth(scene / "truth", check=False)
    folder = predict(scene, lambda view, layers: truth.layers(view))
    for view in (v for v in truth.views if v.split == "test"):
        for edit in truth.edits:
            write_layers(folder / edit.view_file(view.name), truth.relit(edit.name, view))
        write_layers(folder / composed_file(view.name), truth.composed(view))
    finish_predictions(folder, open_predictions(folder))
    changes = {edit.name for edit in truth.edits}
    scored = [score for score in ge.score_predictions(folder, scene).scores if score.status == "scored"]
    seen = {score.metric for score in scored}
    assert {"relighting.psnr", "composition.psnr", "counterfactual.residual.shadow"} <= seen
    for score in scored:
        declared = set(ge.find_metric(score.metric).breakdown) - {*REGIONS}
        declared -= {"debiased"} if score.noise_ceiling is None else set()
        assert set(score.breakdown) - changes == declared, score.metric


@pytest.mark.parametrize("layer", ["diffuse_reflectance", "albedo"])
def test_what_has_no_gauge_needs_no_training_view(
    layer: str, make_scene: Callable[..., Path], predict: Predict
) -> None:
    scene = make_scene()
    truth = open_truth(scene / "truth", check=False)
    manifest = manifest_of(truth)
    for view in truth.views:
        layers = truth.layers(view)
        path = scene / "truth" / "views" / f"{view.name}.exr"
        write_layers(path, layers | {layer: layers["base_color"] * np.float32(0.5)})
    write_manifest(scene / "truth", manifest)

    def test_only(view: View, layers: Layers) -> Layers:
        return layers | ({layer: layers["base_color"]} if view.split == "test" else {})

    sheet = ge.score_predictions(predict(scene, test_only), scene)
    group = {"albedo": "hemispherical_albedo"}.get(layer, layer)
    assert sheet.score(f"{group}.psnr.raw").status == "scored"
    assert sheet.score(f"{group}.psnr.scalar").status == "failed"
