# SPDX-License-Identifier: Apache-2.0
"""Published layouts bring predictions to the scores that they have in graycard's own format."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from graycard import PredictionError, UnknownNameError, open_capture, open_predictions
from graycard.adoption import LAYOUTS, adopt, find_layout, parse_map, request_of
from graycard.dataset import open_held_out
from graycard.eval import find_hints, score_predictions
from graycard.exchange import export_capture, import_capture
from graycard.records import ScoreSheet
from other_outputs import (
    Writer,
    codes,
    decode,
    encode,
    rewritten,
    save,
    write_2dgs,
    write_gs_ir,
    write_nerfstudio,
    write_r3dg,
    write_tensoir,
)
from real_captures import import_tiny

Change = Callable[[str, np.ndarray], np.ndarray]


def rounded(curves: dict[str, str], exposure: float) -> Change:
    """Round layers to the codes of 8-bit files; those that a layout does not have go."""

    def change(name: str, values: np.ndarray) -> np.ndarray:
        if name == "normal":
            return codes(values * 0.5 + 0.5) / 255.0 * 2 - 1
        scale = exposure if name == "radiance" else 1.0
        if curves.get(name) == "srgb":
            return decode(codes(encode(values * scale)) / 255.0) / scale
        return codes(values) / 255.0 if name in curves else values

    return change


def values_of(sheet: ScoreSheet) -> dict[str, float]:
    return {score.metric: score.value for score in sheet.scores if score.value is not None}


@pytest.mark.parametrize(
    ("name", "write", "layers", "curves"),
    [
        ("nerfstudio-render", write_nerfstudio, ("radiance", "depth"), None),
        ("2dgs-render", write_2dgs, ("radiance", "normal", "depth"), {"radiance": "srgb"}),
        (
            "gs-ir",
            write_gs_ir,
            ("radiance", "base_color", "roughness", "metallic", "normal"),
            {"radiance": "srgb", "base_color": "", "roughness": "", "metallic": ""},
        ),
        (
            "r3dg",
            write_r3dg,
            ("radiance", "base_color", "roughness", "normal"),
            {"radiance": "srgb", "base_color": "srgb", "roughness": ""},
        ),
    ],
)
def test_scores_are_those_of_our_own_folder(
    name: str,
    write: Writer,
    layers: tuple[str, ...],
    curves: dict[str, str] | None,
    adopted_scene: Path,
    own: Path,
    tmp_path: Path,
) -> None:
    """Files of 8 bits are held against our own folder with values that are rounded to the same codes."""
    exposure = open_capture(adopted_scene / "capture").exposure
    write(tmp_path / "theirs", own, adopted_scene)
    made = adopt(request_of(tmp_path / "theirs", adopted_scene, (), find_layout(name)), tmp_path / "ours")
    assert {layer.layer for layer in made.layers} == {*layers}
    change = rounded(curves, exposure) if curves else lambda _, values: values
    held = rewritten(tmp_path / "held", own, change)
    wanted = values_of(score_predictions(held, adopted_scene))
    found = values_of(score_predictions(tmp_path / "ours", adopted_scene))
    assert len(found) > 3
    assert {m: v for m, v in wanted.items() if m in found} == pytest.approx(found, abs=1e-4)
    hints = [hint.says for hint in find_hints(tmp_path / "ours", adopted_scene)]
    assert [says for says in hints if "rounded to 8 bits" not in says] == []


def test_a_layout_of_test_views_alone_says_what_it_lacks(
    adopted_scene: Path, own: Path, tmp_path: Path
) -> None:
    write_tensoir(tmp_path / "theirs", own, adopted_scene)
    made = adopt(request_of(tmp_path / "theirs", adopted_scene, (), find_layout("tensoir")), tmp_path / "o")
    assert made.views == 3
    assert [note for note in made.left_out if note.startswith("4 training views have no prediction")]
    sheet = score_predictions(tmp_path / "o", adopted_scene)
    assert sheet.score("normal.mean_angle").status == "scored"
    assert sheet.score("albedo.psnr.channel").status == "failed"
    mine = score_predictions(own, adopted_scene)
    assert sheet.score("normal.mean_angle").value == pytest.approx(
        mine.score("normal.mean_angle").value, abs=0.3
    )


def test_an_imported_truth_does_not_bring_an_exposure(
    tmp_path: Path, write_tiny: Callable[..., Path]
) -> None:
    """Photographs of TensoIR's layout are as they were, like those that come without albedo and normals."""
    rendered = write_tiny(tmp_path / "rendered", train=4, test=3)
    export_capture(rendered, "tensoir", tmp_path / "away")
    scene = import_capture(tmp_path / "away", tmp_path / "mine", "dark", "lego")
    assert (scene / "truth").is_dir()
    for of, exposed in ((rendered, True), (scene, False)):
        request = request_of(tmp_path, of, (), find_layout("tensoir"))
        light = next(declared for declared in request.maps if declared.layer == "radiance")
        assert (light.exposed, "exposed" in light.words, request.notes == ()) == (exposed,) * 3


@pytest.mark.parametrize("name", LAYOUTS)
def test_of_programs_that_open_photographs_it_is_said_where_none_are(
    name: str, adopted_scene: Path, tmp_path: Path, write_tiny: Callable[..., Path]
) -> None:
    """They render held-out views of an imported scene; of an exported one they see training views alone."""
    says = "opens a photograph for each view"
    exported = request_of(tmp_path, adopted_scene, (), find_layout(name)).notes
    imported = request_of(tmp_path, import_tiny(tmp_path, write_tiny), (), find_layout(name)).notes
    assert any(says in note for note in exported) == (name != "tensoir")
    assert not any(says in note for note in imported)


def test_each_eighth_photograph_of_gsplat_is_a_held_out_view(
    tmp_path: Path, write_tiny: Callable[..., Path]
) -> None:
    """Runner.eval numbers indices 0, 8, … of all photographs by name, which `graycard import` holds out."""
    rendered = write_tiny(tmp_path / "rendered", train=17, test=0)
    export_capture(rendered, "nerfstudio", tmp_path / "away")
    scene = import_capture(tmp_path / "away", tmp_path / "mine", "dark", "room")
    photographs = sorted((tmp_path / "away" / "images").iterdir())
    for number, path in enumerate(photographs[::8]):
        picture = np.asarray(Image.open(path))
        save(
            tmp_path / "r" / "renders" / f"val_step29999_{number:04d}.png",
            np.concatenate([picture, picture], 1),
        )
    adopt(request_of(tmp_path / "r", scene, (), find_layout("gsplat")), tmp_path / "o")
    held, found = open_held_out(scene), open_predictions(tmp_path / "o")
    assert [view.name for view in held.views] == [path.stem for path in photographs[::8]]
    for view in held.views:
        np.testing.assert_allclose(found.layers(view.name)["radiance"], held.photograph(view), atol=1e-6)
    save(tmp_path / "r" / "renders" / "val_step29999_0003.png", np.zeros((24, 56, 3), np.uint8))
    with pytest.raises(PredictionError, match=r"got more: val_step29999_0003.png"):
        adopt(request_of(tmp_path / "r", scene, (), find_layout("gsplat")), tmp_path / "o")


def test_layers_without_files_are_left_out_by_name(adopted_scene: Path, own: Path, tmp_path: Path) -> None:
    """GS-IR without --pbr writes normals alone."""
    theirs = tmp_path / "theirs"
    write_gs_ir(theirs, own, adopted_scene)
    for path in theirs.rglob("pbr/*"):
        path.unlink()
    made = adopt(request_of(theirs, adopted_scene, (), find_layout("gs-ir")), tmp_path / "o")
    assert [layer.layer for layer in made.layers] == ["normal"]
    assert [note.partition(" ")[0] for note in made.left_out if "was left out" in note] == [
        "radiance", "base_color", "roughness", "metallic",
    ]  # fmt: skip


def test_a_map_goes_before_the_layout_and_may_take_its_files(
    adopted_scene: Path, own: Path, tmp_path: Path
) -> None:
    write_gs_ir(tmp_path / "theirs", own, adopted_scene)
    maps = ["base_color=:srgb"]
    made = adopt(
        request_of(tmp_path / "theirs", adopted_scene, maps, find_layout("gs-ir")), tmp_path / "ours"
    )
    mine, found = open_predictions(own), open_predictions(tmp_path / "ours")
    assert len(made.layers) == 5
    view = mine.view_names()[0]
    wanted = decode(codes(mine.layers(view)["base_color"]) / 255.0)
    np.testing.assert_allclose(found.layers(view)["base_color"], wanted, atol=1e-6)


def test_each_layout_parses_and_names_its_source() -> None:
    for layout in LAYOUTS.values():
        assert all(parse_map(text).words for text in layout.maps)
        repository, _, rest = layout.source.partition(", ")
        assert repository.count("/") == 1
        assert rest.rpartition(", ")[2].isalnum()


def test_an_unknown_layout_names_the_known_ones() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'gs-ir'"):
        find_layout("gsir")
