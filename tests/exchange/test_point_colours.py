# SPDX-License-Identifier: Apache-2.0
"""Colours of points in PLY files of other programs, in every flavour, and byte order marks in texts."""

import codecs
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graycard import DatasetError, open_capture
from graycard.exchange import ImportOptions, import_and_tell, plan_import
from graycard.points import read_points
from made_pictures import png_bytes, write_transforms

rng = np.random.default_rng(24)
COLOURS = rng.integers(0, 256, (20, 3))
COLOURS[:3] = [[145, 103, 255], [0, 0, 0], [255, 255, 255]]
RGB, SPLAT = ("red", "green", "blue"), ("f_dc_0", "f_dc_1", "f_dc_2")
_NAMES = {
    "u1": "uchar",
    "u2": "ushort",
    "i2": "short",
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}


def ply(
    colours: np.ndarray, names: tuple[str, ...] = RGB, order: str = "<", before: bytes = b"", head: str = ""
) -> bytes:
    """Return a PLY of points, in text if ``order`` is empty, with bytes of another element before them."""
    kind = colours.dtype.str[1:]
    rows = np.zeros(len(colours), [(n, f"{order}f4") for n in "xyz"] + [(n, order + kind) for n in names])
    for i, name in enumerate(names):
        rows[name] = colours[:, i]
    form = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    fields = [f"property float {n}" for n in "xyz"] + [f"property {_NAMES[kind]} {n}" for n in names]
    top = f"ply\nformat {form} 1.0\n{head}element vertex {len(rows)}\n" + "\n".join(fields) + "\nend_header\n"
    text = "\n".join(" ".join(repr(x) for x in row) for row in rows.tolist()) + "\n"
    return top.encode() + before + (rows.tobytes() if order else text.encode())


FLAVOURS: dict[str, Callable[[], bytes]] = {
    "bytes": lambda: ply(COLOURS.astype("u1")),
    "bytes, big endian": lambda: ply(COLOURS.astype("u1"), order=">"),
    "int": lambda: ply(COLOURS.astype("i4"), order=">"),
    "16 bits": lambda: ply((COLOURS * 257).astype("u2")),
    "16 bits, big endian": lambda: ply((COLOURS * 257).astype("u2"), order=">"),
    "16 bits that are 8": lambda: ply(COLOURS.astype("u2")),
    "floats to 1": lambda: ply((COLOURS / 255).astype("f4")),
    "floats to 255": lambda: ply(COLOURS.astype("f4")),
    "doubles to 65535": lambda: ply((COLOURS * 257).astype("f8"), order=">"),
    "text": lambda: ply(COLOURS.astype("u1"), order=""),
    "text of floats": lambda: ply(COLOURS.astype("f4"), order=""),
    "diffuse": lambda: ply(COLOURS.astype("u1"), ("diffuse_red", "diffuse_green", "diffuse_blue")),
    "r g b": lambda: ply((COLOURS / 255).astype("f8"), ("r", "g", "b"), order=">"),
    "capitals": lambda: ply(COLOURS.astype("u1"), ("Red", "GREEN", "blue")),
    "splat": lambda: ply(((COLOURS / 255 - 0.5) * 2 * np.sqrt(np.pi)).astype("f4"), SPLAT),
    "splat, text": lambda: ply(((COLOURS / 255 - 0.5) / 0.28209479177387814).astype("f8"), SPLAT, ""),
    "with a mark": lambda: codecs.BOM_UTF8 + ply(COLOURS.astype("u1"), order=""),
    "faces first": lambda: ply(
        COLOURS.astype("u1"), order=">", before=b"\3\0\0\0\1\0\0\0\2\0\0\0\3" + b"\0",
        head="element face 2\nproperty list uchar int vertex_indices\n",
    ),
}  # fmt: skip


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_colours_are_the_same_in_every_flavour(flavour: str, tmp_path: Path):
    (tmp_path / "p.ply").write_bytes(FLAVOURS[flavour]())
    found = read_points(tmp_path / "p.ply")
    assert np.array_equal(found.colors, COLOURS)
    assert found.said.startswith("colours from ")


@given(st.lists(st.tuples(*[st.integers(0, 65535)] * 3), min_size=1, max_size=9), st.sampled_from("<>"))
def test_16_bits_are_rounded_and_not_cut(colours: list[tuple[int, int, int]], order: str):
    import tempfile

    values = np.array([*colours, (65535, 0, 0)], "u2")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "p.ply").write_bytes(ply(values, order=order))
        found = read_points(Path(folder) / "p.ply").colors
    assert np.abs(found / 255 - values / 65535).max() <= 0.5 / 255 + 1e-9


def test_light_of_a_splat_beyond_white_is_cut(tmp_path: Path):
    (tmp_path / "p.ply").write_bytes(ply(np.array([[-9, 0, 9.0]]), ("f_dc_0", "f_dc_1", "f_dc_2")))
    assert read_points(tmp_path / "p.ply").colors.tolist() == [[0, 128, 255]]


def test_no_colours_are_grey_and_said(tmp_path: Path):
    (tmp_path / "p.ply").write_bytes(ply(COLOURS.astype("u1"), ("a", "b", "c")))
    found = read_points(tmp_path / "p.ply")
    assert (found.colors == 128).all()
    assert found.said == "no colours: grey"


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("intensity", "b", "c"), "intensity"),
        (("red", "green", "c"), "red, green"),
        (("Gray", "b", "c"), "Gray"),
    ],
)
def test_parts_of_colours_are_named(names: tuple[str, ...], told: str, tmp_path: Path):
    (tmp_path / "p.ply").write_bytes(ply(COLOURS.astype("u1"), names))
    assert read_points(tmp_path / "p.ply").said == f"no colours: grey, as {told} alone is none"
    picture = rng.integers(0, 255, (6, 8, 3), dtype=np.uint8)
    for i in range(3):
        (tmp_path / f"{i}.png").write_bytes(png_bytes(picture, 2))
    write_transforms(tmp_path, [f"{i}.png" for i in range(3)], (8, 6), ply_file_path="p.ply")
    assert [row.warns for row in plan_import(tmp_path, "dark").rows if row.what == "points"] == [True]


@pytest.mark.parametrize(("bright", "top"), [(1.5, 1), (15.5, 1), (200.5, 255)])
def test_some_light_above_1_makes_no_bytes_of_the_others(bright: float, top: int, tmp_path: Path):
    """Read as 0 to 255, all other points would be black."""
    values = np.array([[bright, 0.5, 0.25], [0.5, 1.0, 0.0]])
    (tmp_path / "p.ply").write_bytes(ply(values))
    found = read_points(tmp_path / "p.ply")
    assert found.colors.tolist() == np.rint(255 * np.minimum(values / top, 1)).tolist()
    assert ("1 cut there" in found.said) == (top == 1)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (
            lambda: ply(np.array([[-1.0, 0, 0]])),
            "expected colours from 0 to 1, 255 or 65535 in .*, got -1 to 0",
        ),
        (lambda: ply(np.array([[70000, 0, 0]], "i4")), "expected colours from 0 to 255 or 65535 in .* 70000"),
        (lambda: ply(np.array([[np.nan, 0, 0]])), "expected colours from 0 to 1"),
        (lambda: ply(np.array([[np.inf, 0, 0]]), ("f_dc_0", "f_dc_1", "f_dc_2")), "expected finite f_dc_0"),
        (lambda: FLAVOURS["faces first"]()[:-30], "cut off or damaged"),
        (lambda: FLAVOURS["bytes, big endian"]()[:-1], "cut off or damaged"),
    ],
)
def test_colours_out_of_any_range_are_refused(data: Callable[[], bytes], message: str, tmp_path: Path):
    (tmp_path / "p.ply").write_bytes(data())
    with pytest.raises(DatasetError, match=message):
        read_points(tmp_path / "p.ply")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_folder_with_points_and_a_byte_order_mark(encoding: str, tmp_path: Path):
    source = tmp_path / "in"
    source.mkdir()
    for i in range(3):
        (source / f"{i}.png").write_bytes(png_bytes(rng.integers(0, 255, (6, 8, 3), dtype=np.uint8), 2))
    (source / "p.ply").write_bytes(FLAVOURS["splat"]())
    write_transforms(source, [f"{i}.png" for i in range(3)], (8, 6), ply_file_path="p.ply")
    index = source / "transforms.json"
    index.write_text(json.dumps(json.loads(index.read_text())), encoding=encoding)
    made, rows = import_and_tell(source, tmp_path / "out", "dark", "s", ImportOptions("0"))
    assert np.array_equal(open_capture(made / "capture").points().colors, COLOURS)
    assert {("file", 3), ("points", 20)} <= {(r.what, r.count) for r in rows}
