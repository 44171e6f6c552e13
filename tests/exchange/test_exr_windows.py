# SPDX-License-Identifier: Apache-2.0
"""EXR files with any windows, parts, types, tiles and primaries, as photographs and as predictions."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graycard import DatasetError, PredictionError
from graycard.exchange.pictures import FoundPicture, read_header, read_photograph, read_pixels
from graycard.io import read_known_layers, read_layers, read_rgb, unknown_channels, write_layers, write_rgb
from made_pictures import write_exr

rng = np.random.default_rng(20)
Window = tuple[int, int, int, int]


def light_of(path: Path) -> np.ndarray:
    return read_photograph(FoundPicture(path, read_header(path))).light


@st.composite
def windows(draw: st.DrawFn) -> tuple[Window, Window]:
    """Two windows that have a pixel in common."""
    x, y = draw(st.integers(-20, 20)), draw(st.integers(-20, 20))
    sides = st.integers(0, 9)
    data, display = ((x - draw(sides), y - draw(sides), x + draw(sides), y + draw(sides)) for _ in range(2))
    return data, display


@given(windows(), st.booleans(), st.booleans())
@settings(max_examples=40, deadline=None)
def test_pixels_lie_where_both_windows_say(both: tuple[Window, Window], half: bool, tiled: bool):
    """Against a canvas that both windows are laid on."""
    data, display = both
    height, width = data[3] - data[1] + 1, data[2] - data[0] + 1
    pixels = rng.random((height, width, 3)).astype(np.float16 if half else np.float32)
    canvas = np.zeros((100, 100, 3), np.float32)
    canvas[data[1] + 50 : data[3] + 51, data[0] + 50 : data[2] + 51] = pixels
    expected = canvas[display[1] + 50 : display[3] + 51, display[0] + 50 : display[2] + 51]
    more = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()} if tiled else {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        write_exr(path, {"RGB": pixels}, both, **more)
        assert np.array_equal(light_of(path), expected)
        assert np.array_equal(read_rgb(path), expected)
        header = read_header(path)
        assert (header.height, header.width) == expected.shape[:2]
        named = {f"radiance.{c}": pixels[..., i] for i, c in enumerate("RGB")}
        write_exr(path, named, both)
        assert np.array_equal(read_layers(path)["radiance"], expected)
        said = [note.said for note in read_pixels_of(path, pixels, both) if note.what == "windows"]
        assert bool(said) == (data != display)


def read_pixels_of(path: Path, pixels: np.ndarray, both: tuple[Window, Window]):
    write_exr(path, {"RGB": pixels}, both)
    return read_pixels(path).notes


@pytest.mark.parametrize(
    ("display", "message"),
    [
        ((10, 0, 15, 5), "expected pixels inside of the display window"),
        ((0, 0, 20000, 20000), "expected a display window of at most"),
    ],
)
def test_windows_that_no_picture_has(display: Window, message: str, tmp_path: Path):
    pixels = np.ones((4, 5, 3), np.float32)
    write_exr(tmp_path / "a.exr", {"RGB": pixels}, ((0, 0, 4, 3), display))
    with pytest.raises(DatasetError, match=message):
        read_pixels(tmp_path / "a.exr")
    with pytest.raises(PredictionError, match=message):
        read_layers(tmp_path / "a.exr", PredictionError)


def part(name: str, channels: dict[str, np.ndarray], **header: object) -> OpenEXR.Part:
    return OpenEXR.Part({"type": OpenEXR.scanlineimage, **header}, channels, name)


def test_all_parts_are_layers(tmp_path: Path):
    """Channels with the name of their layer, and without: then the part has it."""
    layers = {name: rng.random((5, 7, 3)).astype(np.float32) for name in ("base_color", "normal", "radiance")}
    depth = rng.random((5, 7)).astype(np.float32)
    full = {
        f"{n}.{s}": v[..., i].copy()
        for n, v in layers.items()
        for i, s in enumerate("XYZ" if n == "normal" else "RGB")
    }
    by_name = [part(n, {k: v for k, v in full.items() if k.startswith(n)}) for n in layers]
    bare = [
        part("base_color", {"RGB": layers["base_color"]}),
        part("normal", {c: layers["normal"][..., i].copy() for i, c in enumerate("XYZ")}),
        part("radiance", {"RGB": layers["radiance"].astype(np.float16).astype(np.float32)}),
        part("depth", {"Z": depth}),
        part("steps", {"n": depth}),
    ]
    OpenEXR.File(by_name).write(str(tmp_path / "a.exr"))
    found = read_known_layers(tmp_path / "a.exr").layers
    assert found.keys() == layers.keys()
    assert all(np.array_equal(found[name], values) for name, values in layers.items())
    OpenEXR.File(bare).write(str(tmp_path / "b.exr"))
    found = read_known_layers(tmp_path / "b.exr").layers
    assert found.keys() == {*layers, "depth"}
    assert np.array_equal(found["depth"], depth)
    assert np.array_equal(found["normal"], layers["normal"])
    assert unknown_channels(tmp_path / "b.exr") == {"steps.n": ""}


def test_parts_that_cannot_be_one_file(tmp_path: Path):
    pixels = rng.random((5, 7, 3)).astype(np.float32)
    path = tmp_path / "a.exr"
    OpenEXR.File(
        [
            part("radiance", {"RGB": pixels}),
            part("again", {f"radiance.{c}": pixels[..., 0].copy() for c in "RGB"}),
        ]
    ).write(str(path))
    with pytest.raises(DatasetError, match=r"expected each channel once in .*, got radiance\.B in two parts"):
        read_layers(path)
    eyes = [part("l", {"RGB": pixels}, view="left"), part("r", {"RGB": pixels}, view="right")]
    OpenEXR.File(eyes).write(str(path))
    with pytest.raises(DatasetError, match=r"expected a picture of one eye in .*, got left, right"):
        read_pixels(path)


def test_the_picture_among_other_layers(tmp_path: Path):
    path, pixels, other = (
        tmp_path / "a.exr",
        rng.random((5, 7, 3)).astype(np.float32),
        np.zeros((5, 7, 3), np.float32),
    )
    OpenEXR.File([part("albedo", {"RGB": other}), part("beauty", {"RGB": pixels})]).write(str(path))
    assert np.array_equal(light_of(path), pixels)
    assert "beauty is the picture of albedo, beauty" in [n.said for n in read_pixels(path).notes]
    names = {
        f"View.{n}.{c}": v[..., i]
        for n, v in (("Combined", pixels), ("DiffCol", other))
        for i, c in enumerate("RGB")
    }
    write_exr(path, names)
    assert np.array_equal(light_of(path), pixels)
    write_exr(path, {c: pixels[..., i] for i, c in enumerate("rgb")})
    assert np.array_equal(light_of(path), pixels)
    write_exr(path, {"Y": pixels[..., 0]})
    assert np.array_equal(light_of(path), np.repeat(pixels[..., :1], 3, axis=-1))
    OpenEXR.File([part("left", {"RGB": other}), part("right", {"RGB": pixels})]).write(str(path))
    with pytest.raises(DatasetError, match="expected one picture in .*, got several: left, right"):
        read_pixels(path)
    write_exr(path, {"X": pixels[..., 0], "Z": pixels[..., 1]})
    with pytest.raises(DatasetError, match="expected channels R, G, B in .*, got X, Z"):
        read_pixels(path)


def test_luminance_with_half_its_chroma_is_refused(tmp_path: Path):
    import Imath

    plane = rng.random((6, 8)).astype(np.float32)
    kind = Imath.PixelType(Imath.PixelType.FLOAT)
    header = OpenEXR.Header(8, 6)
    header["channels"] = {
        "Y": Imath.Channel(kind),
        "RY": Imath.Channel(kind, 2, 2),
        "BY": Imath.Channel(kind, 2, 2),
    }
    file = OpenEXR.OutputFile(str(tmp_path / "a.exr"), header)
    small = plane[::2, ::2].copy().tobytes()
    file.writePixels({"Y": plane.tobytes(), "RY": small, "BY": small})
    file.close()
    with pytest.raises(DatasetError, match="got BY, RY with fewer"):
        read_pixels(tmp_path / "a.exr")


# From linear light of other primaries to linear Rec.709: CSS Color 4, ITU-R BT.2087, and ACES with Bradford
P3 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290)
BT2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
AP1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
MATRICES: dict[tuple[float, ...], list[list[float]]] = {
    P3: [[1.22494, -0.22494, 0], [-0.04206, 1.04206, 0], [-0.01964, -0.07864, 1.09827]],
    BT2020: [[1.66049, -0.58764, -0.07285], [-0.12455, 1.13290, -0.00835], [-0.01815, -0.10058, 1.11873]],
    AP1: [[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]],
}


@pytest.mark.parametrize("primaries", MATRICES)
def test_other_primaries_become_rec709(primaries: tuple[float, ...], tmp_path: Path):
    path, pixels = tmp_path / "a.exr", rng.random((9, 7, 3)).astype(np.float32)
    write_exr(path, {"RGB": pixels}, chromaticities=primaries)
    expected = pixels @ np.array(MATRICES[primaries]).T
    np.testing.assert_allclose(light_of(path), np.maximum(expected, 0), atol=3e-4)
    assert (expected < 0).any()  # there is no negative light: said, not silent
    picture = read_photograph(FoundPicture(path, read_header(path)))
    assert "values below 0 became 0" in [n.said for n in picture.notes]
    assert any("converted to linear Rec.709" in n.said for n in picture.notes)
    grey = np.full((2, 2, 3), 0.4, np.float32)
    write_exr(path, {"RGB": grey}, chromaticities=primaries)
    np.testing.assert_allclose(light_of(path), grey, atol=1e-4)


def test_predictions_of_other_primaries_are_refused_by_name(tmp_path: Path):
    pixels = {f"radiance.{c}": np.ones((4, 5), np.float32) for c in "RGB"}
    write_exr(tmp_path / "a.exr", pixels, chromaticities=AP1)
    with pytest.raises(PredictionError, match=r"got ACES AP1 \(ACEScg\)\. Convert"):
        read_known_layers(tmp_path / "a.exr", PredictionError)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ({"chromaticities": (0.3,) * 8}, "expected chromaticities that span a colour space"),
        ({"chromaticities": (float("nan"),) * 8}, "expected chromaticities of four colours"),
        (
            {"colorInteropID": "srgb_rec709_display"},
            "expected linear light in .*, got colours of srgb_rec709",
        ),
        ({"colorInteropID": "lin_ap1_scene"}, "expected chromaticities beside colours of lin_ap1_scene"),
    ],
)
def test_colours_that_nobody_can_convert(header: dict[str, Any], message: str, tmp_path: Path):
    write_exr(tmp_path / "a.exr", {"RGB": np.ones((4, 5, 3), np.float32)}, **header)
    with pytest.raises(DatasetError, match=message):
        light_of(tmp_path / "a.exr")


def test_a_quick_file_is_exact_too(tmp_path: Path):
    pixels = np.exp(rng.normal(0, 9, (30, 40, 3))).astype(np.float32)
    write_rgb(tmp_path / "a.exr", pixels, quick=True)
    assert np.array_equal(read_rgb(tmp_path / "a.exr"), pixels)
    write_layers(tmp_path / "b.exr", {"radiance": pixels})
    assert np.array_equal(light_of(tmp_path / "b.exr"), pixels)


def test_what_a_header_says_and_nobody_asks_is_told(tmp_path: Path):
    light = np.full((3, 4, 3), 0.5, np.float32)
    write_exr(tmp_path / "a.exr", {"RGB": light})
    assert [note.what for note in read_pixels(tmp_path / "a.exr").notes] == ["file"]
    write_exr(tmp_path / "a.exr", {"RGB": light}, expTime=0.01, isoSpeed=100.0, pixelAspectRatio=2.0)
    told = [(note.said, note.warns) for note in read_pixels(tmp_path / "a.exr").notes[1:]]
    assert told == [
        ("expTime, isoSpeed of EXR not asked: light is taken as it is stored", False),
        ("2 times as wide as high, as EXR says: taken as square", True),
    ]
