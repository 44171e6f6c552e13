# SPDX-License-Identifier: Apache-2.0
"""Photographs as a person has them: a bent lens, folders with blanks, ``.JPG``, EXIF, COLMAP's binary model.

And the import doctor's table, its warnings, and what the command writes.
"""

import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from graycard import DatasetError, open_capture, srgb_encode
from graycard.cli import main
from graycard.exchange import (
    ImportOptions,
    ImportRow,
    PictureOptions,
    export_capture,
    import_capture,
    plan_import,
)
from graycard.exchange._doctor import merge_rows, some
from posed_photographs import LENSES, light, photograph, poses, reconstruct, write_folder

pycolmap = pytest.importorskip("pycolmap")
ORIENTATION = 0x0112


@pytest.fixture
def bent(tmp_path: Path) -> Path:
    return write_folder(tmp_path / "walk", reconstruct([("OPENCV", LENSES["OPENCV"])] * 10), "photographs")


@pytest.mark.parametrize("width", [None, 40])
def test_a_bent_photograph_becomes_that_of_a_pinhole(width: int | None, bent: Path, tmp_path: Path):
    """Its camera is rendered anew, without any lens, and compared with what import made of the JPEG."""
    made = import_capture(bent, tmp_path / "data", "multilight", "walk", ImportOptions(width=width))
    capture = open_capture(made / "capture")
    assert [v.name for v in capture.test] == ["walk one_IMG 01", "walk one_IMG 09"]
    for view in capture.train:
        camera, fine = view.camera, 4
        assert width is None or camera.width == width
        x, y = np.meshgrid(
            (np.arange(fine * camera.width) + 0.5) / fine, (np.arange(fine * camera.height) + 0.5) / fine
        )
        local = np.dstack([(x - camera.K[0, 2]) / camera.K[0, 0], (y - camera.K[1, 2]) / camera.K[1, 1]])
        exact = light(local, camera.camera_to_world)
        exact = exact.reshape(camera.height, fine, camera.width, fine, 3).mean((1, 3))
        error = np.abs(srgb_encode(capture.photograph(view)) - srgb_encode(exact))
        assert error.mean() < 0.01  # JPEG costs 0.004 here; half a pixel would cost 0.02
    points = capture.points()
    for number, view in enumerate(capture.views):
        here = points.view == number
        expected = view.camera.project(points.positions[points.point[here]])[0]
        assert np.abs(points.pixel[here] - expected).max(initial=0) < 1e-3


@pytest.mark.parametrize(
    ("lens", "width", "kind"),
    [("OPENCV", None, "ZIP"), ("PINHOLE", None, "PIZ"), ("PINHOLE", 40, "ZIP"), ("PINHOLE", 400, "PIZ")],
)
def test_pictures_are_packed_as_their_pixels_ask_for(
    lens: str, width: int | None, kind: str, tmp_path: Path
) -> None:
    """PIZ takes a third of ZIP's time for the few values of 8 bits, and twice as long for averages."""
    folder = write_folder(tmp_path / "walk", reconstruct([(lens, LENSES[lens])] * 3))
    options = ImportOptions(width=width, hold_out="2")
    made = import_capture(folder, tmp_path / "data", "multilight", "walk", options)
    packed = [
        OpenEXR.File(str(path), header_only=True).header()["compression"]
        for path in made.glob("*/photographs/**/*.exr")
    ]
    assert packed == [getattr(OpenEXR, f"{kind}_COMPRESSION")] * 3


@pytest.mark.parametrize("orientation", [3, 6])
def test_a_photograph_that_was_turned(orientation: int, tmp_path: Path):
    """The model is of the picture as viewers show it; the file holds it turned, and EXIF says so."""
    found = reconstruct([("OPENCV", LENSES["OPENCV"])] * 3)
    folder = write_folder(tmp_path / "walk", found)
    exif = Image.Exif()
    exif[ORIENTATION] = orientation
    for image, pose in zip(found.images.values(), poses(3), strict=True):
        shown = Image.fromarray(photograph(image.camera, pose))
        turned = shown.rotate({3: 180, 6: 90}[orientation], expand=True)
        turned.save(folder / "images" / image.name, quality=98, exif=exif)
    options = ImportOptions(pictures=PictureOptions(orientation="upright"))
    made = open_capture(import_capture(folder, tmp_path / "data", "dark", "x", options) / "capture")
    camera = made.train[0].camera
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    local = np.dstack([(x - camera.K[0, 2]) / camera.K[0, 0], (y - camera.K[1, 2]) / camera.K[1, 1]])
    exact = srgb_encode(light(local, camera.camera_to_world))
    assert np.abs(srgb_encode(made.photograph(made.train[0])) - exact).mean() < 0.01


def run(*args: str | Path) -> int:
    return main(["import", *map(str, args)])


def test_the_command_shows_what_it_did_and_keeps_it(
    bent: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "data"
    common = ["--track", "multilight", "--scene", "walk", "--out", out, "--width", "60"]
    assert run(bent, *common, "--dry-run", "--json", tmp_path / "dry.json") == 0
    dry = capsys.readouterr()
    assert "import: dry run, nothing written, 8 photographs, 2 views held out, 2 of them with" in dry.out
    assert not out.exists()
    assert run(bent, *common, "--json", tmp_path / "done.json") == 0
    done = capsys.readouterr()
    assert "OPENCV lens undone: 120x80 becomes" in done.out
    assert "becomes 60x" in done.out
    rows = json.loads((tmp_path / "done.json").read_text())["result"]["rows"]
    assert rows == json.loads((tmp_path / "dry.json").read_text())["result"]["rows"]
    counts = {row["what"]: row["count"] for row in rows}
    assert counts == {
        "cameras": 10, "photographs": 10, "distortion": 10, "width": 10, "held out": 2, "points": 12,
        "world": 1, "file": 10,
    }  # fmt: skip
    with Image.open(out / "multilight" / "walk" / "contact-sheet.png") as sheet:
        assert sheet.size[0] > 1000
    assert len(open_capture(out / "multilight" / "walk" / "capture").train) == 8


def test_warnings_stand_on_the_other_stream(bent: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for path in (bent / "photographs" / "walk one").iterdir():
        dark = (np.asarray(Image.open(path)) // 60).astype(np.uint8)
        Image.fromarray(dark).save(path.with_suffix(".png"))
    for place in (bent / "photographs" / "walk one").glob("*.JPG"):
        place.with_suffix(".png").rename(bent / f"{place.stem}.png")
        Image.open(bent / f"{place.stem}.png").save(place, format="PNG")
    assert run(bent, "--track", "dark", "--scene", "x", "--out", tmp_path / "data", "--dry-run") == 0
    shown = capsys.readouterr()
    assert "warning: darkness (10): dark for 8 bits" in shown.err
    assert "!" in shown.out


def test_a_light_photograph_draws_no_warning(bent: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert run(bent, "--track", "dark", "--scene", "x", "--out", tmp_path / "data", "--dry-run") == 0
    assert capsys.readouterr().err == ""


def test_inverted_masks_are_refused(tiny_scenes: dict[str, Path], tmp_path: Path):
    export_capture(tiny_scenes["tabletop"], "colmap", tmp_path / "out")
    found = plan_import(tmp_path / "out", "tabletop").pictures
    right = [row for row in found.rows if row.what == "masks"]
    assert [(row.count, row.warns) for row in right] == [(3, False)]
    for path in (tmp_path / "out" / "masks").iterdir():
        Image.fromarray(255 - np.asarray(Image.open(path))).save(path)
    with pytest.raises(DatasetError, match="invert"):
        plan_import(tmp_path / "out", "tabletop")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (("--scene", "../x"), "Give the scene another --scene"),
        (("--scene", "there"), "expected a new or an empty folder at"),
        (("--track", "bright"), "expected a track that exists, got 'bright'"),
        (("--width", "0"), "expected a width of 1 or more pixels, got 0"),
        (("--hold-out", "1"), "expected to hold out every 2nd photograph or fewer"),
        (("--hold-out", ""), "expected names of photographs to hold out, got none in ''"),
        (("--hold-out", " , "), "expected names of photographs to hold out, got none"),
    ],
)
@pytest.mark.parametrize("more", [(), ("--find-cameras",), ("--dry-run",)])
def test_what_is_none_is_refused_before_anything_is_read(
    more: tuple[str, ...],
    wrong: tuple[str, str],
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
):
    """There is not even a folder to read: that would be the next error."""
    (tmp_path / "data" / "dark" / "there" / "capture").mkdir(parents=True)
    chosen = {"--track": "dark", "--scene": "x", "--out": str(tmp_path / "data"), **dict([wrong])}
    assert run(tmp_path / "nowhere", *(part for pair in chosen.items() for part in pair), *more) == 2
    told = capsys.readouterr().err
    if "--dry-run" in more and "there" in wrong:
        assert "nowhere" in told  # a dry run writes nothing, so nothing is in its way
    else:
        assert message in told
        assert "nowhere" not in told


def test_an_empty_list_of_names_is_refused(bent: Path, tmp_path: Path):
    (tmp_path / "list.txt").write_text("# none yet\n\n")
    with pytest.raises(DatasetError, match=r"got none in '.*list\.txt'\. Give 0 to hold out none"):
        plan_import(bent, "dark", ImportOptions(hold_out=str(tmp_path / "list.txt")))


@pytest.mark.parametrize(("count", "words"), [(2, "2nd"), (3, "3rd"), (4, "4th"), (11, "11th"), (21, "21st")])
def test_counts_are_said_as_people_say_them(count: int, words: str, bent: Path):
    rows = plan_import(bent, "dark", ImportOptions(hold_out=str(count))).rows
    assert [row.said.split(",")[0] for row in rows if row.what == "held out"] == [f"each {words} by name"]


def test_a_width_that_is_more_than_there_is_told(bent: Path):
    rows = plan_import(bent, "dark", ImportOptions(width=640)).rows
    told = [(row.count, row.said) for row in rows if row.what == "width"]
    assert told == [(10, "less than 640 pixels: nothing is made larger")]


def test_bare_photographs_are_told_the_way(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert run(tmp_path, "--track", "dark", "--scene", "x", "--out", tmp_path / "data") == 2
    assert "let --find-cameras find the cameras of bare photographs" in capsys.readouterr().err
    assert run(tmp_path, "--track", "dark", "--scene", "x", "--out", tmp_path / "data", "--find-cameras") == 2
    assert "expected two or more photographs as PNG or JPEG" in capsys.readouterr().err


def speckled(pose: np.ndarray, size: int = 240) -> np.ndarray:
    """A photograph of two walls full of spots that COLMAP can find again, ``(size, size, 3)``, uint8."""
    x, y = np.meshgrid(np.arange(size) + 0.5 - size / 2, np.arange(size) + 0.5 - size / 2)
    rays = np.dstack([x / 220, y / 220, np.ones_like(x)]) @ pose[:3, :3].T
    noise = np.random.default_rng(0).random((2, 64, 64))
    found, nearest = np.zeros((size, size)), np.full((size, size), np.inf)
    for wall, normal in enumerate(np.array([[0.35, 1.0, 0.0], [-0.5, 1.0, 0.1]])):
        t = -(pose[:3, 3] @ normal) / (rays @ normal)
        places = pose[:3, 3] + t[..., None] * rays
        column, row = (np.floor(12 * places[..., axis]).astype(int) % 64 for axis in (0, 2))
        closer = (t > 0) & (t < nearest)
        found, nearest = np.where(closer, noise[wall][row, column], found), np.where(closer, t, nearest)
    return np.repeat(np.rint(40 + 200 * found).astype(np.uint8)[..., None], 3, axis=-1)


def test_cameras_of_bare_photographs_are_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = tmp_path / "bare" / "walk one"
    folder.mkdir(parents=True)
    for number, pose in enumerate(poses(6)):
        Image.fromarray(speckled(pose)).save(folder / f"IMG {number}.JPG", quality=97)
    out = tmp_path / "data"
    args = ["--track", "multilight", "--scene", "found", "--out", out, "--find-cameras", "--hold-out", "0"]
    assert run(tmp_path / "bare", *args) == 0
    home = out / "multilight" / "found"
    assert f"import: {home}, " in capsys.readouterr().out
    capture = open_capture(home / "capture")
    assert len(capture.train) >= 4
    assert len(capture.points()) > 50
    assert pycolmap.Reconstruction(home / "colmap" / "sparse" / "0").num_images() == len(capture.views)
    places = np.array([view.camera.position for view in capture.train])
    true = {f"walk one_IMG {i}": pose[:3, 3] for i, pose in enumerate(poses(6))}
    exact = np.array([true[view.name] for view in capture.train])
    ratios = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.linalg.norm(np.diff(exact, axis=0), axis=1)
    assert ratios.max() / ratios.min() < 1.1  # the world is known up to a scale


def test_rows_that_say_the_same_are_added_up():
    rows = [
        ImportRow("a", 1, "x"),
        ImportRow("b", 1, "x"),
        ImportRow("a", 2, "x"),
        ImportRow("a", 1, "x", True),
    ]
    assert merge_rows(rows) == (ImportRow("a", 3, "x"), ImportRow("b", 1, "x"), ImportRow("a", 1, "x", True))
    assert some(["a", "b"]) == "a, b"
    assert some("abcde") == "a, b, c and 2 more"
