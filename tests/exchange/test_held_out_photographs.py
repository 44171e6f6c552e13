# SPDX-License-Identifier: Apache-2.0
"""Held-out photographs are read and told of as the others are; a scene comes whole or not at all."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from graycard import DatasetError, open_capture, open_truth, srgb_decode
from graycard.dataset import open_held_out
from graycard.exchange import (
    ImportOptions,
    ImportRow,
    PictureOptions,
    export_capture,
    import_and_tell,
    import_capture,
    plan_import,
    survey_import,
)
from made_pictures import icc_profile, write_exr, write_transforms

W, H = 16, 12
LIGHT = np.random.default_rng(3).integers(40, 250, (H, W, 3), dtype=np.uint8)


def exif(orientation: int = 1, seconds: float = 0.0, iso: int = 0) -> bytes:
    found = Image.Exif()
    found[0x0112] = orientation
    tags = {0x829A: seconds, 0x8827: iso}
    found.get_ifd(0x8769).update({tag: value for tag, value in tags.items() if value})
    return found.tobytes()


def write(folder: Path, write_one: Callable[[Path, int], object]) -> Path:
    """Nine photographs, of which 0 and 8 are held out."""
    folder.mkdir(exist_ok=True)
    for i in range(9):
        write_one(folder / f"{i}.png", i)
    return write_transforms(folder, [f"{i}.png" for i in range(9)], (W, H))


def plain(path: Path, **more: object) -> None:
    Image.fromarray(LIGHT).save(path, **more)  # pyright: ignore[reportArgumentType]


def clear(path: Path) -> None:
    Image.fromarray(np.dstack([LIGHT, np.full((H, W), 255, np.uint8)])).save(path)


def negative(path: Path) -> None:
    write_exr(path, {"RGB": (LIGHT / 255 - 0.3).astype(np.float32)})


ODD: dict[str, tuple[Callable[[Path], object], tuple[str, str, bool]]] = {
    "orientation": (
        lambda p: plain(p, exif=exif(3)),
        ("orientation", "EXIF says turned by 180°: taken as stored", True),
    ),
    "profile": (lambda p: plain(p, icc_profile=icc_profile("mine")), ("profile", "", False)),
    "alpha": (clear, ("alpha", "opaque everywhere", False)),
    "light below 0": (negative, ("light", "values below 0 became 0", True)),
    "bits": (negative, ("file", "EXR", False)),
    "darkness": (
        lambda p: Image.fromarray(LIGHT // 60).save(p),
        ("darkness", "dark for 8 bits", True),
    ),
}


@pytest.mark.parametrize("odd", ODD)
def test_what_is_odd_in_held_out_photographs_alone_is_told(odd: str, tmp_path: Path):
    write_odd, (what, said, warns) = ODD[odd]
    folder = write(tmp_path / "in", lambda path, i: write_odd(path) if i in (0, 8) else plain(path))
    rows = import_and_tell(folder, tmp_path / "out", "dark", "s")[1]
    found = [row for row in rows if row.what.startswith(what[:4]) and said in row.said]
    assert 2 in [row.count for row in found if row.warns == warns]
    assert survey_import(plan_import(folder, "dark")) == rows


def exposures(tmp_path: Path, seconds: list[float], **options: object) -> tuple[Path, list[ImportRow]]:
    folder = write(tmp_path / "in", lambda path, i: plain(path, exif=exif(seconds=seconds[i])))
    chosen = ImportOptions(pictures=PictureOptions(**options))  # pyright: ignore[reportArgumentType]
    scene, rows = import_and_tell(folder, tmp_path / "out", "dark", "s", chosen)
    return scene, [row for row in rows if row.what == "exposure"]


def ratios(scene: Path) -> list[float]:
    """Light of held-out photographs by that of their files."""
    held = open_held_out(scene)
    stored = srgb_decode(LIGHT / 255)
    return [float(np.median(held.photograph(view) / stored)) for view in held.views]


def check_white(scene: Path) -> None:
    """A held-out photograph ends where radiance × exposure × its factor is 1, as its file does."""
    held = open_held_out(scene)
    for view in held.views:
        shown = held.photograph(view) * held.capture.exposure * held.exposure(view)
        np.testing.assert_allclose(shown, srgb_decode(LIGHT / 255), rtol=1e-4)


BRACKET = [0.01, 0.04, 0.01, 0.04, 0.02, 0.02, 0.02]
"""Seconds of the training photographs, 0.02 in the geometric mean."""


def test_a_held_out_photograph_without_exposure_leaves_the_others_theirs(tmp_path: Path):
    scene, rows = exposures(tmp_path, [0.0, *BRACKET, 0.04])
    sensor = open_capture(scene / "capture").sensor
    assert sensor is not None
    assert sensor.exposure("1") / sensor.exposure("2") == pytest.approx(0.25)
    assert ratios(scene) == pytest.approx([1, 0.5], rel=1e-4)
    check_white(scene)
    assert [(row.count, row.warns) for row in rows] == [(7, False), (1, True), (1, False)]
    assert "EXIF tells less of it than of others" in rows[1].said


def test_held_out_exposures_are_divided_out_where_others_are_alike(tmp_path: Path):
    scene, rows = exposures(tmp_path, [0.04, *[0.02] * 7, 0.02])
    assert open_capture(scene / "capture").sensor is None
    assert ratios(scene) == pytest.approx([0.5, 1], rel=1e-4)
    check_white(scene)
    assert [row.count for row in rows] == [7, 1]


@pytest.mark.parametrize(("seconds", "exposure"), [(0.0, "exif"), (0.02, "alike")])
def test_held_out_exposures_follow_the_others(seconds: float, exposure: str, tmp_path: Path):
    """All are taken as exposed alike if a training photograph tells none, or none are asked for."""
    scene, _ = exposures(tmp_path, [0.04, seconds, *[0.02] * 6, 0.01], exposures=exposure)
    assert open_capture(scene / "capture").sensor is None
    assert ratios(scene) == pytest.approx([1, 1], rel=1e-4)


def test_a_broken_held_out_photograph_is_met_in_a_dry_run(tmp_path: Path):
    folder = write(tmp_path / "in", lambda path, i: plain(path))
    (folder / "8.png").write_bytes((folder / "8.png").read_bytes()[:300])
    with pytest.raises(DatasetError, match=r"expected a whole image at .*8\.png"):
        survey_import(plan_import(folder, "dark"))
    with pytest.raises(DatasetError, match=r"expected a whole image at .*8\.png"):
        import_capture(folder, tmp_path / "out", "dark", "s")
    assert not (tmp_path / "out").exists()


@pytest.fixture
def tensoir(tiny_scenes: dict[str, Path], tmp_path: Path) -> Path:
    export_capture(tiny_scenes["multilight"], "tensoir", tmp_path / "in")
    return tmp_path / "in"


def test_a_broken_true_layer_leaves_nothing_behind(tensoir: Path, tmp_path: Path):
    path = tensoir / "test_001" / "albedo.png"
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(DatasetError, match=r"expected a whole image at .*albedo\.png"):
        survey_import(plan_import(tensoir, "multilight"))
    with pytest.raises(DatasetError, match=r"expected a whole image at .*albedo\.png"):
        import_capture(tensoir, tmp_path / "out", "multilight", "s")
    assert not (tmp_path / "out").exists()


def layers_rows(rows: tuple[ImportRow, ...]) -> list[tuple[int, str, bool]]:
    return [(row.count, row.said, row.warns) for row in rows if row.what == "true layers"]


def test_truth_of_held_out_views_alone_is_kept(tensoir: Path, tmp_path: Path):
    """The usual folder: training views have a photograph and no more."""
    for place in tensoir.glob("train_*"):
        (place / "albedo.png").unlink()
        (place / "normal.png").unlink()
    plan = plan_import(tensoir, "multilight")
    scene, rows = import_and_tell(tensoir, tmp_path / "out", "multilight", "s")
    assert survey_import(plan) == rows
    (kept, _, _), (lacking, said, warns) = layers_rows(rows)
    assert (kept, lacking, warns) == (2, 3, True)
    assert "in train_000, train_001, train_002: nothing in these views is judged" in said
    truth = open_truth(scene / "truth")
    for view in truth.views:
        layers = truth.layers(view)
        assert (set(layers) == {"radiance", "object_id"}) == (view.split == "train")
        assert bool(layers["object_id"].any()) == (view.split == "test")


@pytest.mark.parametrize("layer", ["albedo.png", "normal.png"])
def test_truth_that_scores_cannot_use_is_left_out_with_a_warning(layer: str, tensoir: Path, tmp_path: Path):
    for place in tensoir.glob("test_*"):
        (place / layer).unlink()
    scene, rows = import_and_tell(tensoir, tmp_path / "out", "multilight", "s")
    said = "left out: no held-out view has both albedo.png and normal.png, which scores need"
    assert layers_rows(rows) == [(5, said, True)]
    assert not (scene / "truth").exists()
    assert len(open_held_out(scene).views) == 2


def test_truth_of_one_held_out_view_is_kept(tensoir: Path, tmp_path: Path):
    (tensoir / "test_000" / "normal.png").unlink()
    scene, rows = import_and_tell(tensoir, tmp_path / "out", "multilight", "s")
    assert [(count, warns) for count, _, warns in layers_rows(rows)] == [(4, False), (1, True)]
    truth = open_truth(scene / "truth")
    assert [bool(truth.layers(view)["object_id"].any()) for view in truth.views] == [False, *[True] * 4]
