# SPDX-License-Identifier: Apache-2.0
"""Pictures of a view relit and composed: in which gauge, of which changes, and what is said for none."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from changed_scene import EDITS, EXPOSURE, enrich
from graycard import LightEdit, Predictions, open_truth
from graycard.edits import composed_file
from graycard.io import write_layers
from graycard.predictions import finish_predictions, write_view
from graycard.records import Job, JobResult, Score, ScoreSheet
from graycard.reports._comparison import build_gallery
from graycard.reports._evidence import MethodEvidence, SceneEvidence, open_method, open_scene
from graycard.reports.pictures._changed_pictures import changed_rows
from graycard.reports.pictures._layer_rows import LayerRow

GAIN = np.array((2.0, 1.0, 0.5))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    return enrich(write_tiny(tmp_path_factory.mktemp("changed"), track="tabletop"))


@pytest.fixture
def scene(folder: Path) -> SceneEvidence:
    return open_scene(folder)


Handed = Callable[..., MethodEvidence]


@pytest.fixture
def handed(folder: Path, tmp_path: Path) -> Handed:
    """``handed(edits, composed, competes)``: a method whose light is too dim by a gain, as its score says."""

    def make(
        edits: tuple[LightEdit, ...] = (), composed: bool = False, competes: bool = True
    ) -> MethodEvidence:
        truth, run = open_truth(folder / "truth"), tmp_path / "run"
        shutil.rmtree(run, ignore_errors=True)
        predictions = run / "predictions"
        for view in (v for v in truth.views if v.split == "test"):
            write_view(predictions, view.name, {"radiance": truth.layers(view)["radiance"]})
            for edit in edits:
                dim = truth.relit(edit.name, view)["radiance"] / GAIN
                write_layers(predictions / edit.view_file(view.name), {"radiance": dim.astype("f4")})
            if composed:
                whole = {"radiance": truth.composed(view)["radiance"]}
                write_layers(predictions / composed_file(view.name), whole)
        finish_predictions(predictions, Predictions("m", truth.track, truth.scene), None)
        gauge = tuple(GAIN.tolist())
        score = Score("relighting.psnr", "p", "scored", 20.0, "dB", True, np.inf, gauge=gauge)
        sheet = ScoreSheet(truth.track, truth.scene, "m", "", "", (score,))
        result = JobResult(Job(truth.track, truth.scene, "m", 0, {}), "", ".", "done", sheet=sheet)
        return open_method(run, [result], [v for v in truth.views if v.split == "test"], competes)

    return make


def errors(row: LayerRow) -> list[float]:
    """Means of the error pictures, from their words; NaN where there is none."""
    found = [tile.picture.alt.rpartition("mean ")[2] if tile.picture else "nan" for tile in row.errors]
    return [float(text) for text in found]


def test_a_change_is_shown_if_a_competing_method_hands_it_in(scene: SceneEvidence, handed: Handed) -> None:
    assert changed_rows(scene, [handed()]) == ()
    moved, sky = EDITS[1], EDITS[3]
    (row,) = changed_rows(scene, [handed((moved,))])
    assert (row.title, row.unit) == (
        f"Relit: {moved.summary}",
        "as displayed",
    )
    rows = changed_rows(scene, [handed((moved, sky), composed=True)])
    titles = [f"Relit: {moved.summary}", f"Relit: {sky.summary}", "Composed: with pot of another scene"]
    assert [r.title for r in rows] == titles
    reference = handed((moved, sky), composed=True, competes=False)
    assert changed_rows(scene, [reference]) == (), "that the truth has them is no news"


def test_pictures_are_shown_in_the_gauge_of_their_scores(scene: SceneEvidence, handed: Handed) -> None:
    relit, composed = changed_rows(scene, [handed((EDITS[0],), composed=True)])
    assert errors(relit)[0] < 1e-6, "the gain of the albedo is undone"
    assert relit.predictions[0].note == "× 2 1 0.5"
    assert errors(composed)[0] == 0
    assert composed.predictions[0].note == "", "its lights are the method's own"
    assert EXPOSURE > 0
    assert relit.truth.picture is not None
    assert relit.truth.picture.code == "light", "it can be seen at any exposure"
    assert relit.noise_ratios == ()


def test_what_is_missing_is_said_in_its_place(scene: SceneEvidence, handed: Handed, tmp_path: Path) -> None:
    with_it = handed((EDITS[0],))
    names = [MethodEvidence("none"), MethodEvidence("broken", fault="boom")]
    (row,) = changed_rows(scene, [with_it, *names])
    assert [tile.missing for tile in row.predictions] == ["", "not provided", "failed"]
    lost = tmp_path / "run" / "predictions" / EDITS[0].view_file(scene.shown[0].name)
    lost.write_bytes(b"damaged")
    (row,) = changed_rows(scene, [with_it])
    assert [tile.missing for tile in row.predictions] == ["failed"]


def test_they_stand_in_the_first_view_alone(scene: SceneEvidence, handed: Handed) -> None:
    first, *others = build_gallery(scene, [handed((EDITS[0],))]).views
    assert first.rows[-1].title == f"Relit: {EDITS[0].summary}"
    assert all("Relit" not in row.title for view in others for row in view.rows)
    assert len(others) == 1
