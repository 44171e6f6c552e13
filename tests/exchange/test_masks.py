# SPDX-License-Identifier: Apache-2.0
"""Masks of any kind: their sense, their share of the picture, and files that are no masks."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from graycard import DatasetError, open_capture
from graycard.exchange import ImportOptions, PictureOptions, import_and_tell, import_capture
from graycard.exchange.pictures import FoundPicture, judge_masks, read_header, read_mask, shape_of_mask
from made_pictures import png_bytes, write_exr, write_transforms

WHITE = np.ones((12, 16), bool)
WHITE[3:8, 5:11] = False
"""White but for an object in the middle."""


def palette(path: Path, white: np.ndarray) -> None:
    image = Image.fromarray(white.astype(np.uint8), "P")
    image.putpalette([0, 0, 0, 200, 0, 180])
    image.save(path, "PNG")


def with_alpha(path: Path, white: np.ndarray) -> None:
    Image.fromarray(np.dstack([np.full((12, 16, 3), 90), 255 * white]).astype(np.uint8)).save(path, "PNG")


def cut_out(path: Path, white: np.ndarray) -> None:
    """Black under what is transparent, as many programs leave it."""
    Image.fromarray((np.dstack([white * 9] * 3 + [255 * white])).astype(np.uint8)).save(path, "PNG")


MASKS: dict[str, Callable[[Path, np.ndarray], object]] = {
    "0 and 255": lambda p, w: Image.fromarray((255 * w).astype(np.uint8)).save(p, "PNG"),
    "0 and 1": lambda p, w: Image.fromarray(w.astype(np.uint8)).save(p, "PNG"),
    "bool": lambda p, w: Image.fromarray(w).save(p, "PNG"),
    "16 bits": lambda p, w: p.write_bytes(png_bytes((65535 * w).astype(np.uint16), 0)),
    "16 bits, 0 and 255": lambda p, w: p.write_bytes(png_bytes((255 * w).astype(np.uint16), 0)),
    "16 bits, 0 and 1": lambda p, w: p.write_bytes(png_bytes(w.astype(np.uint16), 0)),
    "colours": lambda p, w: Image.fromarray((w[..., None] * [255, 0, 0]).astype(np.uint8)).save(p, "PNG"),
    "opaque alpha": lambda p, w: Image.fromarray((255 * w).astype(np.uint8)).convert("RGBA").save(p, "PNG"),
    "palette": palette,
    "alpha": with_alpha,
    "cut-out": cut_out,
    "JPEG": lambda p, w: Image.fromarray((255 * w).astype(np.uint8)).save(p, "JPEG"),
    "TIFF": lambda p, w: tifffile.imwrite(p, (65535 * w).astype(np.uint16)),
    "EXR": lambda p, w: write_exr(p, {"Y": w.astype(np.float32)}),
    "EXR, three channels": lambda p, w: write_exr(p, {"RGB": np.dstack([w] * 3).astype(np.float32)}),
    "smooth": lambda p, w: Image.fromarray(np.where(w, 250, 7).astype(np.uint8)).save(p, "PNG"),
}  # fmt: skip


@pytest.mark.parametrize("way", MASKS)
def test_black_is_found(way: str, tmp_path: Path):
    MASKS[way](tmp_path / "m", WHITE)
    black, _ = read_mask(FoundPicture(tmp_path / "m", read_header(tmp_path / "m", "mask")))
    assert np.array_equal(black, ~WHITE)


def labels(path: Path) -> None:
    Image.fromarray((np.arange(192).reshape(12, 16) % 5).astype(np.uint8)).save(path, "PNG")


def photograph_with_alpha(path: Path) -> None:
    colours = np.random.default_rng(0).integers(0, 255, (12, 16, 3))
    Image.fromarray(np.dstack([colours, np.where(WHITE, 255, 9)]).astype(np.uint8)).save(path, "PNG")


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (labels, "expected a mask of black and white in .*, got values from 0 to 4 of 255, as of labels"),
        (photograph_with_alpha, "expected a mask in the colours or in the alpha of .*, got both"),
        (
            lambda p: write_exr(p, {"Y": np.full((12, 16), np.nan, np.float32)}),
            "expected a mask of finite values",
        ),
    ],
)
def test_what_is_no_mask_is_refused(write: Callable[[Path], None], message: str, tmp_path: Path):
    write(tmp_path / "m")
    with pytest.raises(DatasetError, match=message):
        read_mask(FoundPicture(tmp_path / "m", read_header(tmp_path / "m", "mask")))


@given(st.integers(1, 8), st.integers(1, 8), st.integers(1, 5), st.integers(1, 5))
def test_an_object_that_is_not_around_all_else_is_taken_either_way(left: int, top: int, w: int, h: int):
    """A compact object is right in one sense and refused in the other."""
    black = np.zeros((14, 14), bool)
    black[top : top + h, left : left + w] = True
    path = [Path("m.png")]
    white, note = judge_masks([shape_of_mask(black)], path)
    assert not white
    assert f"black is the object: {black.mean():.0%}" in note.said
    with pytest.raises(DatasetError, match="they look inverted"):
        judge_masks([shape_of_mask(~black)], path)
    white, turned = judge_masks([shape_of_mask(~black)], path, "white")
    assert white
    assert turned.said == note.said.replace("black", "white")
    assert judge_masks([shape_of_mask(~black)], path, "black")[1].warns


def grey_alpha(path: Path, white: np.ndarray) -> None:
    """Colours are the same everywhere, and so is alpha where there is no object."""
    Image.fromarray(np.dstack([np.full(white.shape, 9), 255 * white]).astype(np.uint8), "LA").save(
        path, "PNG"
    )


SETS = {**MASKS, "grey alpha": grey_alpha}


@pytest.mark.parametrize("way", SETS)
@pytest.mark.parametrize("first", [True, False])
def test_a_mask_without_an_object_is_read_as_the_others_are(way: str, first: bool, tmp_path: Path):
    """Alone, a mask that is 1 everywhere could be one of labels, or nearly black."""
    empty = np.ones_like(WHITE)
    planes = [empty, WHITE, WHITE] if first else [WHITE, WHITE, empty]
    source = folder_of(tmp_path, WHITE)
    for i, plane in enumerate(planes):
        SETS[way](source / f"m{i}.png", plane)
    made = import_capture(source, tmp_path / "out", "tabletop", "s", ImportOptions("0"))
    capture = open_capture(made / "capture")
    found = [capture.target_mask(view) for view in capture.train]
    assert all(np.array_equal(target, ~plane) for target, plane in zip(found, planes, strict=True))


def folder_of(tmp_path: Path, white: np.ndarray) -> Path:
    source = tmp_path / "in"
    source.mkdir()
    rng = np.random.default_rng(1)
    for i in range(3):
        Image.fromarray(rng.integers(0, 255, (12, 16, 3), dtype=np.uint8)).save(source / f"{i}.png")
        Image.fromarray(white.astype(np.uint8)).save(source / f"m{i}.png")
    return write_transforms(source, [f"{i}.png" for i in range(3)], (16, 12), [f"m{i}.png" for i in range(3)])


def test_the_sense_of_masks_may_be_said(tmp_path: Path):
    source = folder_of(tmp_path, ~WHITE)
    with pytest.raises(
        DatasetError, match=r"got black in 84% of the pictures and along 100% of their borders"
    ):
        import_and_tell(source, tmp_path / "out", "tabletop", "s")
    options = ImportOptions("0", pictures=PictureOptions(mask_object="white"))
    made, rows = import_and_tell(source, tmp_path / "out", "tabletop", "s", options)
    capture = open_capture(made / "capture")
    assert all(np.array_equal(capture.target_mask(view), ~WHITE) for view in capture.train)
    said = {row.said: row.count for row in rows if row.what == "masks"}
    assert said == {
        "values 0 and 1: what is not 0 is white": 3,
        "white is the object: 16% of the pictures (16% to 16%)": 3,
    }
