# SPDX-License-Identifier: Apache-2.0
"""PNG, TIFF and JPEG of 8 and 16 bits and floats: no bit is lost, alpha and damage are not passed over."""

import io
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image

from graycard import DatasetError, srgb_decode, srgb_encode
from graycard.exchange.pictures import FoundPicture, Picture, read_header, read_photograph, read_pixels
from made_pictures import png_bytes, write_exr

rng = np.random.default_rng(21)
EVERY = np.arange(65536, dtype=np.uint16).reshape(256, 256)
"""Each value of 16 bits once."""
COLOURS = np.stack([EVERY, EVERY[::-1], EVERY.T], axis=-1)
Write = Callable[[Path, np.ndarray], object]


def photograph(path: Path, background: str = "none") -> Picture:
    return read_photograph(FoundPicture(path, read_header(path)), background)  # pyright: ignore[reportArgumentType]


def by_hand(path: Path, values: np.ndarray) -> None:
    path.write_bytes(png_bytes(values, 2 if values.ndim == 3 else 0))


def by_opencv(path: Path, values: np.ndarray) -> None:
    cv2.imwrite(str(path), values[..., ::-1] if values.ndim == 3 else values)


def as_tiff(**options: object) -> Write:
    def write(path: Path, values: np.ndarray) -> None:
        kind = "rgb" if values.ndim == 3 else "minisblack"
        tifffile.imwrite(path, values, photometric=kind, **options)  # pyright: ignore[reportArgumentType]

    return write


def in_planes(path: Path, values: np.ndarray) -> None:
    if values.ndim == 3:
        planes = np.ascontiguousarray(np.moveaxis(values, -1, 0))
        tifffile.imwrite(path, planes, photometric="rgb", planarconfig="separate")
    else:
        tifffile.imwrite(path, 65535 - values, photometric="miniswhite")


WRITERS: dict[str, tuple[str, Write]] = {
    "PNG by hand": ("a.png", by_hand),
    "PNG by OpenCV": ("a.PNG", by_opencv),
    "TIFF": ("a.tif", as_tiff()),
    "TIFF, big endian, deflate": ("a.TIFF", as_tiff(byteorder=">", compression="zlib")),
    "TIFF of more than 4 GiB, tiled": ("a.tiff", as_tiff(bigtiff=True, tile=(64, 64))),
    "TIFF, LZW": ("a.Tif", by_opencv),
    "TIFF, planes or white is 0": ("a.tif", in_planes),
    "TIFF under a wrong suffix": ("a.png", as_tiff()),
}


@pytest.mark.parametrize("values", [EVERY, COLOURS], ids=["grey", "colours"])
@pytest.mark.parametrize("way", WRITERS)
def test_every_value_of_16_bits_comes_back(way: str, values: np.ndarray, tmp_path: Path):
    name, write = WRITERS[way]
    write(tmp_path / name, values)
    stored = read_pixels(tmp_path / name)
    assert stored.values.dtype == np.uint16
    assert np.array_equal(stored.values, values)
    light = photograph(tmp_path / name).light
    wanted = values if values.ndim == 3 else np.repeat(values[..., None], 3, axis=-1)
    assert np.array_equal(np.rint(65535 * srgb_encode(light)), wanted)
    np.testing.assert_allclose(light, srgb_decode(wanted / 65535), rtol=1e-6)


@pytest.mark.parametrize("kind", ["PNG", "TIFF"])
@pytest.mark.parametrize("mode", ["L", "RGB", "P", "1"])
def test_eight_bits_and_fewer_are_shown_as_pillow_shows_them(mode: str, kind: str, tmp_path: Path):
    image = Image.fromarray(rng.integers(0, 256, (9, 7, 3), dtype=np.uint8))
    image = image.quantize(11) if mode == "P" else image.convert(mode)
    image.save(tmp_path / "a", kind)
    shown = np.asarray(image.convert("RGB"))
    np.testing.assert_allclose(photograph(tmp_path / "a").light, srgb_decode(shown / 255), rtol=1e-6)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_a_tiff_of_floats_is_linear_light(kind: type, tmp_path: Path):
    light = np.exp(rng.normal(0, 3, (6, 5, 3))).astype(kind)
    tifffile.imwrite(tmp_path / "a.tif", light, photometric="rgb")
    assert np.array_equal(photograph(tmp_path / "a.tif").light, light.astype(np.float32))


def layers_of_alpha(kind: type) -> tuple[np.ndarray, np.ndarray]:
    top = np.iinfo(kind).max
    colours = rng.integers(0, top, (6, 8, 3), dtype=kind)
    alpha = np.full((6, 8), top, kind)
    return colours, alpha


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_alpha_is_left_out_where_it_is_opaque_and_refused_elsewhere(kind: type, tmp_path: Path):
    path, (colours, alpha) = tmp_path / "a.png", layers_of_alpha(kind)
    path.write_bytes(png_bytes(np.dstack([colours, alpha]), 6))
    picture = photograph(path)
    top = np.iinfo(kind).max
    np.testing.assert_allclose(picture.light, srgb_decode(colours / top), rtol=1e-6)
    assert "opaque everywhere, left out" in [note.said for note in picture.notes]
    alpha[2, 3], alpha[4, 5] = 0, top // 4
    path.write_bytes(png_bytes(np.dstack([colours, alpha]), 6))
    with pytest.raises(
        DatasetError, match=r"expected an opaque photograph, .* transparency in 4\.2% .*--background"
    ):
        photograph(path)
    on_white = photograph(path, "white").light
    assert (on_white[2, 3] == 1).all()
    share = alpha[4, 5] / top
    np.testing.assert_allclose(
        on_white[4, 5], srgb_decode(colours[4, 5] / top) * share + 1 - share, rtol=1e-5
    )
    assert (photograph(path, "black").light[2, 3] == 0).all()


def test_one_colour_of_a_png_may_be_transparent(tmp_path: Path):
    for kind, values in ((2, COLOURS[:3, :4]), (0, EVERY[:3, :4])):
        key = np.atleast_1d(values[1, 2]).astype(">u2").tobytes()
        (tmp_path / "a.png").write_bytes(png_bytes(values, kind, [(b"tRNS", key)]))
        assert np.argwhere(read_pixels(tmp_path / "a.png").alpha == 0).tolist() == [[1, 2]]
    image = Image.fromarray(rng.integers(0, 256, (9, 7, 3), dtype=np.uint8)).quantize(4)
    image.save(tmp_path / "b.png", transparency=1)
    with pytest.raises(DatasetError, match="expected an opaque photograph"):
        photograph(tmp_path / "b.png")


def test_grey_with_alpha_of_16_bits(tmp_path: Path):
    values = rng.integers(0, 65536, (5, 6, 2), dtype=np.uint16)
    (tmp_path / "a.png").write_bytes(png_bytes(values, 4))
    found = read_pixels(tmp_path / "a.png")
    assert np.array_equal(found.values, values[..., 0])
    assert found.alpha is not None
    assert np.array_equal(found.alpha, values[..., 1])


def test_alpha_of_exr_and_of_tiff_is_in_the_colours_already(tmp_path: Path):
    """Files store light × alpha; on white, 1 - alpha comes on top."""
    light, alpha = rng.random((5, 6, 3)).astype(np.float32), np.float32(0.25)
    stored = np.dstack([light * alpha, np.full((5, 6), alpha)]).astype(np.float32)
    write_exr(tmp_path / "a.exr", {"RGBA": stored})
    with pytest.raises(DatasetError, match="transparency in 100.0%"):
        photograph(tmp_path / "a.exr")
    np.testing.assert_allclose(photograph(tmp_path / "a.exr", "white").light, light * 0.25 + 0.75, rtol=1e-5)
    np.testing.assert_allclose(photograph(tmp_path / "a.exr", "black").light, light * 0.25, rtol=1e-5)
    coded = np.rint(65535 * np.dstack([light * 0.25, np.full((5, 6), 0.25)])).astype(np.uint16)
    tifffile.imwrite(tmp_path / "a.tif", coded, photometric="rgb", extrasamples=["assocalpha"])
    expected = srgb_decode(light) * 0.25 + 0.75
    np.testing.assert_allclose(photograph(tmp_path / "a.tif", "white").light, expected, atol=1e-4)


def jpeg(mode: str) -> bytes:
    file = io.BytesIO()
    Image.fromarray(rng.integers(0, 256, (9, 7, 3), dtype=np.uint8)).convert(mode).save(file, "JPEG")
    return file.getvalue()


def pages(count: int) -> bytes:
    file = io.BytesIO()
    tifffile.imwrite(file, np.zeros((count, 9, 7), np.uint16), photometric="minisblack")
    return file.getvalue()


def moving() -> bytes:
    file, image = io.BytesIO(), Image.new("RGB", (7, 9))
    image.save(file, "PNG", save_all=True, append_images=[Image.new("RGB", (7, 9), "red")])
    return file.getvalue()


def whole_numbers() -> bytes:
    file = io.BytesIO()
    tifffile.imwrite(file, np.zeros((9, 7, 3), np.uint32), photometric="rgb")
    return file.getvalue()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (lambda: jpeg("CMYK"), "expected grey or red, green and blue in .*, got CMYK"),
        (lambda: pages(3), "expected one picture in .*, got several pages"),
        (moving, "expected one picture in .*, got a moving one"),
        (whole_numbers, "expected 8 or 16 bits or floats of 16 or 32 in .*, got 32 bits"),
        (lambda: b"GIF89a" + bytes(30), "it begins as GIF"),
        (lambda: b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS"),
        (lambda: b"", "an empty file"),
    ],
)
def test_what_is_not_read_is_refused_by_name(data: Callable[[], bytes], message: str, tmp_path: Path):
    (tmp_path / "a.png").write_bytes(data())
    with pytest.raises(DatasetError, match=message):
        photograph(tmp_path / "a.png")


@pytest.mark.parametrize("share", [0.3, 0.7, 0.97])
@pytest.mark.parametrize("way", [*WRITERS, "JPEG"])
def test_a_file_that_breaks_off_is_never_taken_for_whole(way: str, share: float, tmp_path: Path):
    name, write = WRITERS.get(way, ("a.jpg", lambda path, values: path.write_bytes(jpeg("RGB"))))
    noise = rng.integers(0, 65536, (40, 50, 3), dtype=np.uint16)
    write(tmp_path / name, noise)
    data = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(data[: int(share * len(data))])
    with pytest.raises(DatasetError, match=r"expected a whole image at .*, got one that breaks off"):
        photograph(tmp_path / name)


@pytest.mark.parametrize("kind", [2, 5, 12])
def test_a_tiff_whose_size_is_no_number(kind: int, tmp_path: Path):
    """Its width as text, as a fraction and as a float: tags of damaged files may be of any type."""
    tifffile.imwrite(tmp_path / "a.tif", COLOURS[:4, :5], photometric="rgb", byteorder="<")
    data = bytearray((tmp_path / "a.tif").read_bytes())
    at = next(i for i in range(len(data)) if data[i : i + 2] == b"\0\1" and data[i + 2] in (3, 4))
    data[at + 2] = kind
    (tmp_path / "a.tif").write_bytes(data)
    with pytest.raises(DatasetError, match="expected a whole image at"):
        photograph(tmp_path / "a.tif")


@pytest.mark.parametrize("channels", [1, 3])
def test_light_that_alpha_does_not_cover_is_kept(channels: int, tmp_path: Path):
    """A glow has light and no alpha; beyond, alpha may be 0 in some channel of light or other."""
    light = np.zeros((2, 3, channels), np.float32)
    light[0, 0], light[1, 1] = 5.0, 0.25
    alpha = np.array([[0, 0, 1], [0, 0.5, 1]], np.float32)
    names = (
        {"Y": light[..., 0]} if channels == 1 else dict(zip("RGB", np.moveaxis(light, -1, 0), strict=True))
    )
    write_exr(tmp_path / "a.exr", {**names, "A": alpha})
    for background, behind in (("black", 0.0), ("white", 1.0)):
        expected = np.broadcast_to(light + behind * (1 - alpha[..., None]), (2, 3, 3))
        assert np.array_equal(photograph(tmp_path / "a.exr", background).light, expected)


def test_coded_light_that_alpha_does_not_cover_is_told(tmp_path: Path):
    """It cannot be decoded: a curve belongs to colours before they were multiplied."""
    coded = np.full((3, 4, 4), 30000, np.uint16)
    coded[0, 0] = 0
    tifffile.imwrite(tmp_path / "a.tif", coded, photometric="rgb", extrasamples=["assocalpha"])
    assert all("alpha is 0" not in n.said for n in photograph(tmp_path / "a.tif", "black").notes)
    coded[0, 0, 1] = 500
    tifffile.imwrite(tmp_path / "a.tif", coded, photometric="rgb", extrasamples=["assocalpha"])
    told = [n for n in photograph(tmp_path / "a.tif", "black").notes if "alpha is 0" in n.said]
    assert [n.warns for n in told] == [True]


EXTRAS = {
    "one, not said": (["unspecified"], None, ["a channel that is not said to be alpha was left out"]),
    "alpha": (["unassalpha"], 0, []),
    "not said, then alpha": (
        ["unspecified", "unassalpha"], 1, ["a channel that is not said to be alpha was left out"],
    ),
    "alpha, then not said": (
        ["unassalpha", "unspecified"], 0, ["a channel that is not said to be alpha was left out"],
    ),
    "two, not said": (
        ["unspecified"] * 2, None, ["2 channels that are not said to be alpha were left out"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("colours", [1, 3])
@pytest.mark.parametrize("extras", EXTRAS)
def test_channels_of_a_tiff_beyond_colours_follow_one_rule(
    extras: str, colours: int, kind: type, tmp_path: Path
):
    names, alpha, told = EXTRAS[extras]
    values = rng.integers(1, 250, (6, 8, colours + len(names))).astype(kind)
    photometric = "rgb" if colours == 3 else "minisblack"
    tifffile.imwrite(
        tmp_path / "a.tif", values, photometric=photometric, extrasamples=names, planarconfig="contig"
    )
    found = read_pixels(tmp_path / "a.tif")
    shown = found.values if found.values.ndim == 3 else found.values[..., None]
    assert np.array_equal(shown, np.broadcast_to(values[..., :colours], shown.shape))
    assert (found.alpha is None) == (alpha is None)
    if found.alpha is not None and alpha is not None:
        assert np.array_equal(found.alpha, values[..., colours + alpha])
    assert [n.said for n in found.notes if n.what == "alpha"] == told
    assert all(n.warns for n in found.notes if n.what == "alpha")


def test_a_picture_of_too_many_pixels_is_called_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    Image.fromarray(np.zeros((30, 40, 3), np.uint8)).save(tmp_path / "a.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 500)
    with pytest.raises(DatasetError, match=r"expected an image of fewer pixels at .*a\.png: .*1200 pixels"):
        read_header(tmp_path / "a.png")
