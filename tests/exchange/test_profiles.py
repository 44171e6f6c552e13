# SPDX-License-Identifier: Apache-2.0
"""ICC profiles, chunks of PNG and EXIF that say what colours mean: converted, or refused by name."""

import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from graycard import DatasetError, srgb_decode
from graycard.exchange.pictures import FoundPicture, read_header, read_photograph
from made_pictures import ADOBE_D50, P3_D50, SRGB_D50, gamma_curve, icc_profile, png_bytes

rng = np.random.default_rng(23)
PIXELS = rng.integers(0, 256, (12, 16, 3), dtype=np.uint8)
TO_709 = np.array([[1.22494, -0.22494, 0], [-0.04206, 1.04206, 0], [-0.01964, -0.07864, 1.09827]])
"""From linear Display P3 to linear sRGB (CSS Color 4)."""


def read(path: Path) -> tuple[np.ndarray, str]:
    picture = read_photograph(FoundPicture(path, read_header(path)))
    return picture.light, next((n.said for n in picture.notes if n.what == "profile"), "")


@pytest.mark.parametrize("kind", ["PNG", "TIFF", "JPEG"])
@pytest.mark.parametrize("name", ["sRGB IEC61966-2.1", "anything else"])
def test_an_srgb_profile_of_any_name_changes_nothing(name: str, kind: str, tmp_path: Path):
    Image.fromarray(PIXELS).save(tmp_path / "a", kind, icc_profile=icc_profile(name))
    Image.fromarray(PIXELS).save(tmp_path / "b", kind)
    light, said = read(tmp_path / "a")
    assert said == "ICC profile of sRGB"
    assert np.array_equal(light, read(tmp_path / "b")[0])


@pytest.mark.parametrize("kind", ["PNG", "TIFF"])
def test_display_p3_is_converted(kind: str, tmp_path: Path):
    profile = icc_profile("a screen", P3_D50)
    Image.fromarray(PIXELS).save(tmp_path / "a", kind, icc_profile=profile)
    light, said = read(tmp_path / "a")
    np.testing.assert_allclose(light, np.maximum(srgb_decode(PIXELS / 255) @ TO_709.T, 0), atol=2e-4)
    assert said == "ICC profile of Display P3: Display P3 converted to linear Rec.709"


def test_display_p3_of_16_bits_keeps_them(tmp_path: Path):
    deep = rng.integers(0, 800, (12, 16, 3), dtype=np.uint16)
    icc = b"p\0\0" + __import__("zlib").compress(icc_profile("a screen", P3_D50))
    (tmp_path / "a.png").write_bytes(png_bytes(deep, 2, [(b"iCCP", icc)]))
    expected = np.maximum(srgb_decode(deep / 65535) @ TO_709.T, 0)
    np.testing.assert_allclose(read(tmp_path / "a.png")[0], expected, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "profile"),
    [
        ("Adobe RGB (1998)", icc_profile("Adobe RGB (1998)", ADOBE_D50, gamma_curve(2.2))),
        ("plain 2.2", icc_profile("plain 2.2", SRGB_D50, gamma_curve(2.2))),
        ("linear", icc_profile("linear", SRGB_D50, gamma_curve(1.0))),
        ("sRGB IEC61966-2.1", icc_profile("sRGB IEC61966-2.1", ADOBE_D50)),  # its name lies
    ],
)
def test_other_profiles_are_refused_by_name(name: str, profile: bytes, tmp_path: Path):
    Image.fromarray(PIXELS).save(tmp_path / "a.png", icc_profile=profile)
    with pytest.raises(DatasetError) as found:
        read(tmp_path / "a.png")
    assert f"got the colour profile {name!r}" in str(found.value)


def test_a_damaged_profile_is_named(tmp_path: Path):
    Image.fromarray(PIXELS).save(tmp_path / "a.png", icc_profile=b"no profile at all")
    with pytest.raises(DatasetError, match="expected an ICC profile, got one that is damaged"):
        read(tmp_path / "a.png")


def chunk_of_primaries(*points: float) -> tuple[bytes, bytes]:
    return b"cHRM", struct.pack(">8I", *(round(100000 * x) for x in points))


P3_CHUNK = chunk_of_primaries(0.3127, 0.329, 0.68, 0.32, 0.265, 0.69, 0.15, 0.06)


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
def test_chunks_of_a_png(depth: type, tmp_path: Path):
    top = np.iinfo(depth).max
    values = rng.integers(0, top, (6, 8, 3), dtype=depth)
    x = values / top
    srgb, p3 = srgb_decode(x), np.maximum(srgb_decode(x) @ TO_709.T, 0)
    cases: list[tuple[list[tuple[bytes, bytes]], np.ndarray]] = [
        ([(b"sRGB", b"\0"), (b"gAMA", struct.pack(">I", 45455))], srgb),
        ([(b"gAMA", struct.pack(">I", 45455))], srgb),
        ([(b"gAMA", struct.pack(">I", 100000))], x),
        ([(b"gAMA", struct.pack(">I", 55556))], x**1.8),
        ([P3_CHUNK], p3),
        ([(b"cICP", bytes([12, 13, 0, 1])), (b"sRGB", b"\0")], p3),
        ([(b"cICP", bytes([1, 8, 0, 1]))], x),
        ([(b"sRGB", b"\0"), P3_CHUNK], srgb),
    ]
    for chunks, expected in cases:
        (tmp_path / "a.png").write_bytes(png_bytes(values, 2, chunks))
        np.testing.assert_allclose(read(tmp_path / "a.png")[0], expected, atol=3e-4, err_msg=str(chunks))
    (tmp_path / "a.png").write_bytes(png_bytes(values, 2, [(b"cICP", bytes([9, 16, 0, 1]))]))
    with pytest.raises(DatasetError, match="got the cICP code points 9 and 16"):
        read(tmp_path / "a.png")


@pytest.mark.parametrize("tags", [{0xA001: 2}, {0xA005: {1: "R03"}}])
def test_adobe_rgb_that_only_exif_tells(tags: dict[int, object], tmp_path: Path):
    exif = Image.Exif()
    folder = exif.get_ifd(0x8769)
    folder.update(tags)
    Image.fromarray(PIXELS).save(tmp_path / "a.jpg", exif=exif)
    with pytest.raises(DatasetError, match="got Adobe RGB, as its EXIF says"):
        read(tmp_path / "a.jpg")
