# SPDX-License-Identifier: Apache-2.0
"""EXIF orientation and exposure times; names in other case; links."""

from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageOps

from graycard import Capture, DatasetError, open_capture, srgb_decode
from graycard.exchange import ImportOptions, PictureOptions, import_and_tell
from graycard.exchange.pictures import (
    Exposure,
    FoundPicture,
    find_photographs,
    read_header,
    read_photograph,
    read_pixels,
    relative_exposures,
)
from made_pictures import write_transforms

rng = np.random.default_rng(22)
BLOCKS = np.kron(rng.integers(0, 256, (3, 4, 3)), np.ones((8, 8, 1))).astype(np.uint8)
"""Six by four blocks, which JPEG keeps."""


def save(path: Path, orientation: int, *, seconds: float = 0, iso: int = 0, aperture: float = 0) -> None:
    image = Image.fromarray(BLOCKS)
    exif = Image.Exif()
    exif[0x0112] = orientation
    tags = {0x829A: seconds, 0x8827: iso, 0x829D: aperture}
    exif.get_ifd(0x8769).update({tag: value for tag, value in tags.items() if value})
    if path.suffix == ".jpg":
        image.save(path, exif=exif.tobytes(), quality=100, subsampling=0)
    else:
        image.save(path, exif=exif.tobytes())


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_upright_is_as_pillow_turns_it(orientation: int, suffix: str, tmp_path: Path):
    path = tmp_path / f"a{suffix}"
    save(path, orientation)
    header = read_header(path)
    assert (header.width, header.height, header.orientation) == (32, 24, orientation)
    with Image.open(path) as image:
        expected = srgb_decode(np.asarray(ImageOps.exif_transpose(image)) / 255)
        stored = srgb_decode((np.asarray(image) if suffix == ".jpg" else BLOCKS) / 255)
    np.testing.assert_allclose(
        read_photograph(FoundPicture(path, header, turned=True)).light, expected, rtol=1e-5
    )
    np.testing.assert_allclose(read_photograph(FoundPicture(path, header)).light, stored, rtol=1e-5)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_16_bits_are_turned_alike(orientation: int, tmp_path: Path):
    """By tifffile where nothing is compressed; in LZW by OpenCV, which turns pictures on its own."""
    deep = rng.integers(0, 65536, (4, 6), dtype=np.uint16)
    image, tags = Image.fromarray(deep), {0x0112: orientation}
    for way in (None, "tiff_lzw", "tiff_adobe_deflate"):
        image.save(tmp_path / "a.tif", compression=way, tiffinfo=tags)
        assert np.array_equal(read_pixels(tmp_path / "a.tif").values, deep)
        header = read_header(tmp_path / "a.tif")
        assert (header.width, header.height, header.orientation) == (6, 4, orientation)


def turned(folder: Path, orientations: list[int], size: tuple[int, int], how: str = "auto") -> list[bool]:
    paths = []
    for i, orientation in enumerate(orientations):
        paths.append(folder / f"{i}.jpg")
        save(paths[-1], orientation)
    return [f.turned for f in find_photographs([(p, size) for p in paths], how)]  # pyright: ignore[reportArgumentType]


def test_sizes_of_cameras_tell_the_way_and_the_others_follow(tmp_path: Path):
    assert turned(tmp_path, [6, 8], (24, 32)) == [True, True]
    assert turned(tmp_path, [6, 1, 3], (32, 24)) == [False, False, False]
    assert turned(tmp_path, [3, 2], (32, 24)) == [False, False]
    assert turned(tmp_path, [3, 2, 1], (32, 24), "upright") == [True, True, False]
    wanted = [(tmp_path / "0.jpg", (32, 24)), (tmp_path / "1.jpg", (24, 32))]
    save(tmp_path / "1.jpg", 6)  # fits only upright: so the one that fits both ways is upright too
    assert [f.turned for f in find_photographs(wanted)] == [True, True]


def test_a_way_that_does_not_fit_is_named(tmp_path: Path):
    save(tmp_path / "a.jpg", 6)
    with pytest.raises(DatasetError, match=r"EXIF says turned by 90° clockwise: give --orientation upright"):
        find_photographs([(tmp_path / "a.jpg", (24, 32))], "stored")
    with pytest.raises(DatasetError, match="Scale the photograph"):
        find_photographs([(tmp_path / "a.jpg", (23, 32))])


def test_a_name_in_other_case_and_a_link_are_found(tmp_path: Path):
    save(tmp_path / "a.jpg", 1)
    (tmp_path / "a.jpg").rename(tmp_path / "DSC_1.JPG")
    (tmp_path / "link.png").symlink_to("DSC_1.JPG")
    (tmp_path / "dead.png").symlink_to("nowhere")
    found = find_photographs([(tmp_path / "dsc_1.jpg", (32, 24)), (tmp_path / "link.png", (32, 24))])
    assert [f.path.name for f in found] == ["DSC_1.JPG", "link.png"]
    assert [n.what for n in found[0].notes] == ["names"]
    assert read_photograph(found[1]).light.shape == (24, 32, 3)
    with pytest.raises(DatasetError, match="got a link to nothing"):
        find_photographs([(tmp_path / "dead.png", (32, 24))])


def bracket(folder: Path, settings: list[dict[str, float]], **options: object) -> tuple[Capture, list[str]]:
    (folder / "in").mkdir(exist_ok=True)
    names = [f"{i}.jpg" for i in range(len(settings))]
    for name, setting in zip(names, settings, strict=True):
        save(folder / "in" / name, 1, **setting)  # pyright: ignore[reportArgumentType]
    write_transforms(folder / "in", names, (32, 24))
    made, rows = import_and_tell(
        folder / "in", folder / "out", "dark", f"s{len(list(folder.glob('out/dark/*')))}",
        ImportOptions("0", pictures=PictureOptions(**options)),  # pyright: ignore[reportArgumentType]
    )  # fmt: skip
    return open_capture(made / "capture"), [row.said for row in rows if row.what == "exposure"]


def test_exposure_times_are_divided_out_and_kept(tmp_path: Path):
    """White of a photograph is at radiance × exposure × factor = 1, as the sensor of a capture says."""
    capture, said = bracket(tmp_path, [{"seconds": 0.01}, {"seconds": 0.04}, {"seconds": 0.02}])
    assert said == ["EXIF exposures (time) differ up to 4 times: light is divided by them"]
    assert capture.sensor is not None
    assert capture.sensor.bits == 8
    light = [capture.photograph(view) for view in capture.views]
    stored = srgb_decode(np.asarray(Image.open(tmp_path / "in" / "0.jpg")) / 255)
    np.testing.assert_allclose(light[0], stored * 2, rtol=1e-5)  # the geometric mean is 0.02 s
    np.testing.assert_allclose(light[1], stored / 2, rtol=2e-5)
    for view, picture in zip(capture.views, light, strict=True):
        white = picture * capture.exposure * capture.sensor.exposure(view.name)
        np.testing.assert_allclose(white, stored, rtol=1e-4)
    alike, told = bracket(tmp_path, [{"seconds": 0.01}, {"seconds": 0.04}], exposures="alike")
    assert alike.sensor is None
    assert told == ["EXIF is not asked, all are taken as exposed alike"]


def test_iso_and_aperture_count_where_all_tell_them():
    four = [Exposure(0.01, 2.0, 100), Exposure(0.01, 4.0, 400)]
    assert relative_exposures(four)[0] is None  # four times the ISO, a quarter of the light
    factors, note = relative_exposures([Exposure(0.01, 2.0, 100), Exposure(0.01, None, 400)])
    assert factors == pytest.approx([0.5, 2])
    assert note is not None
    assert "time, ISO" in note.said
    assert relative_exposures([None, None]) == (None, None)
    factors, note = relative_exposures([Exposure(0.01), None, Exposure(1)])
    assert factors is None
    assert note is not None
    assert note.warns
    assert "no exposure time in 1 of 3" in note.said


def test_exposures_of_a_tiff(tmp_path: Path):
    save(tmp_path / "a.tif", 6, seconds=0.125, iso=200, aperture=2.8)
    header = read_header(tmp_path / "a.tif")
    assert header.exposure is not None
    assert header.exposure.f_number == pytest.approx(2.8)
    assert (header.exposure.seconds, header.exposure.iso) == (0.125, 200)
    assert header.orientation == 6
    tifffile.imwrite(tmp_path / "b.tif", np.zeros((4, 5, 3), np.uint16), photometric="rgb")
    assert read_header(tmp_path / "b.tif").exposure is None


@pytest.mark.parametrize("orientation", [1, 3, 6])
def test_colmap_takes_pixels_as_stored(orientation: int, tmp_path: Path):
    """Our words for ``auto`` say so; COLMAP's own features lie where the stored pixels have detail."""
    pycolmap = pytest.importorskip("pycolmap")
    picture = np.full((240, 320, 3), 128, np.uint8)
    spots = np.random.default_rng(0).integers(0, 256, (10, 10))
    picture[10:90, 10:90] = np.kron(spots, np.ones((8, 8)))[..., None]
    exif = Image.Exif()
    exif[0x0112] = orientation
    (tmp_path / "in").mkdir()
    Image.fromarray(picture).save(tmp_path / "in" / "a.jpg", exif=exif, quality=98)
    pycolmap.logging.minloglevel = 2
    pycolmap.extract_features(tmp_path / "a.db", tmp_path / "in", ["a.jpg"], pycolmap.CameraMode.AUTO)
    with pycolmap.Database.open(tmp_path / "a.db") as database:
        camera, keypoints = database.read_all_cameras()[0], np.asarray(database.read_keypoints(1))
    assert (camera.width, camera.height) == (320, 240)
    assert np.abs(keypoints[:, :2].mean(axis=0) - 50).max() < 15
    found = find_photographs([(tmp_path / "in" / "a.jpg", (camera.width, camera.height))])
    assert not found[0].turned
    if orientation == 3:
        assert "taken as stored, as COLMAP does; viewers turn it" in found[0].notes[0].said
