# SPDX-License-Identifier: Apache-2.0
"""Patterns, kinds of file and faults of outputs: what fits is adopted, all else is refused by name."""

import gzip
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from graycard import GraycardError, open_capture, open_predictions
from graycard.adoption import Adopted, adopt, parse_map, request_of
from graycard.cli import main
from graycard.io import read_json
from other_outputs import decode, encode, numbered, save

Adopt = Callable[..., Adopted]


@pytest.fixture
def theirs(tmp_path: Path) -> Path:
    folder = tmp_path / "theirs"
    folder.mkdir()
    return folder


@pytest.fixture
def take(theirs: Path, adopted_scene: Path, tmp_path: Path) -> Adopt:
    def run(*maps: str, **options: Any) -> Adopted:
        return adopt(request_of(theirs, adopted_scene, maps, **options), tmp_path / "ours")

    return run


def write_albedo(theirs: Path, own: Path, scene: Path, name: Callable[[str, int, str], str]) -> None:
    """Write linear albedo as NPY by names of view, number in its split, and split."""
    for view, number, layers, _ in numbered(own, scene):
        path = theirs / name(view.name, number, view.split)
        path.parent.mkdir(parents=True, exist_ok=True)
        np.save(path, layers["base_color"])


def check_albedo(own: Path, tmp_path: Path, atol: float = 0.0) -> None:
    mine, found = open_predictions(own), open_predictions(tmp_path / "ours")
    assert found.view_names() == mine.view_names()
    assert found.is_whole()
    for view in mine.view_names():
        wanted = mine.layers(view)["base_color"]
        np.testing.assert_allclose(found.layers(view)["base_color"], wanted, atol=atol)


@pytest.mark.parametrize(
    ("pattern", "name"),
    [
        ("{view}.npy", lambda v, n, s: f"{v}.npy"),
        ("a/{view}_albedo.npy", lambda v, n, s: f"a/{v}_albedo.npy"),
        ("{split}/{index}.npy", lambda v, n, s: f"{s}/{n}.npy"),
        ("{split}/r_{index:03d}.npy", lambda v, n, s: f"{s}/r_{n:03d}.npy"),
        ("{split}/{index+1:04d}.npy", lambda v, n, s: f"{s}/{n + 1:04d}.npy"),
        ("run-*/{view}.npy", lambda v, n, s: f"run-7/{v}.npy"),
        ("*/{split}/*_{index:05d}.npy", lambda v, n, s: f"x/{s}/step9_{n:05d}.npy"),
    ],
)
def test_patterns_find_their_files(
    pattern: str,
    name: Callable[[str, int, str], str],
    theirs: Path,
    take: Adopt,
    own: Path,
    adopted_scene: Path,
    tmp_path: Path,
) -> None:
    write_albedo(theirs, own, adopted_scene, name)
    made = take(f"base_color={pattern}:linear", method="theirs-1")
    assert (made.views, made.layers[0].files) == (7, 7)
    check_albedo(own, tmp_path)
    assert open_predictions(tmp_path / "ours").method == "theirs-1"


def test_a_star_that_fits_twice_is_refused_unless_it_is_told(
    theirs: Path, take: Adopt, own: Path, adopted_scene: Path, tmp_path: Path
) -> None:
    for step in (7000, 30000):
        write_albedo(theirs, own, adopted_scene, lambda v, n, s, step=step: f"ours_{step}/{v}.npy")
    with pytest.raises(GraycardError, match=r"got ours_30000/\S+, ours_7000/\S+. Give --star"):
        take("base_color=ours_*/{view}.npy:linear")
    take("base_color=ours_*/{view}.npy:linear", star="7000")
    check_albedo(own, tmp_path)


@pytest.mark.parametrize(
    "pattern", ["{index}.npy", "{index+1:03d}.npy", "s*_{index:04d}.npy", "{split}/{index}.npy"]
)
@pytest.mark.parametrize("views", ["all", "test"])
def test_files_of_more_views_than_there_are_are_refused(
    pattern: str, views: str, theirs: Path, take: Adopt, adopted_scene: Path
) -> None:
    """Numbers of other views than the scene has are refused, not cut off: 0 may be any of them."""
    capture = open_capture(adopted_scene / "capture")
    chosen = capture.test if views == "test" else capture.views

    def write(split: str, number: int) -> Path:
        name = pattern.replace("{split}", split).replace("*", "9")
        name = name.replace("{index+1:03d}", f"{number + 1:03d}").replace("{index:04d}", f"{number:04d}")
        path = theirs / name.replace("{index}", str(number))
        path.parent.mkdir(parents=True, exist_ok=True)
        np.save(path, np.full((24, 28, 3), 0.1 * number))
        return path

    count = {"train": 0, "test": 0}
    for number, view in enumerate(chosen):
        write(view.split, count[view.split] if "{split}" in pattern else number)
        count[view.split] += 1
    assert take(f"base_color={pattern}:linear", views=views).views == len(chosen)
    extra = write("test", count["test"] if "{split}" in pattern else len(chosen))
    with pytest.raises(GraycardError, match=rf"got more: {extra.name} is there, too.*--order"):
        take(f"base_color={pattern}:linear", views=views)


def test_a_folder_of_many_files_is_read_to_its_end_and_listed_once(
    theirs: Path, take: Adopt, adopted_scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(10_050):
        (theirs / f"{number:05d}_x.log").touch()
    views = open_capture(adopted_scene / "capture").views
    for view in views:
        np.save(theirs / f"z_{view.name}_x.npy", np.full((24, 28, 3), 0.5))
    listed: list[Path] = []
    iterdir = Path.iterdir
    monkeypatch.setattr(Path, "iterdir", lambda self: listed.append(self) or iterdir(self))
    assert take("base_color=z_{view}_*.npy:linear", "radiance=z_{view}_*.npy:linear").views == len(views)
    assert listed.count(theirs) == 1
    monkeypatch.setattr("graycard.adoption._places._MOST", 10_000)
    with pytest.raises(GraycardError, match="expected up to 10000 files in .*theirs, got more"):
        take("base_color=z_{view}_*.npy:linear")


def test_arrays_of_all_views_are_taken_in_order(
    theirs: Path, take: Adopt, own: Path, adopted_scene: Path, tmp_path: Path
) -> None:
    mine, capture = open_predictions(own), open_capture(adopted_scene / "capture")
    every = np.stack([mine.layers(v.name)["base_color"] for v in capture.views])
    np.save(theirs / "all.npy", every)
    np.save(theirs / "torch.npy", np.moveaxis(every, -1, 1))
    np.savez(theirs / "all.npz", albedo=every, other=every * 0)
    np.savez(theirs / "named.npz", **{v.name: a for v, a in zip(capture.views, every, strict=True)})
    for split, views in (("train", capture.train), ("test", capture.test)):
        np.save(theirs / f"{split}.npy", np.stack([mine.layers(v.name)["base_color"] for v in views]))
    for pattern in (
        "all.npy:linear",
        "torch.npy:channels-first",
        "all.npz:key=albedo",
        "named.npz:key={view}",
        "{split}.npy",
    ):
        take(f"base_color={pattern}")
        check_albedo(own, tmp_path)
    with pytest.raises(GraycardError, match=r"expected 3 views of base_color in .*all.npy, got shape \(7, "):
        take("base_color=all.npy", views="test")
    with pytest.raises(GraycardError, match="expected one array in .*got 2: albedo, other. Name one by key="):
        take("base_color=all.npz")
    with pytest.raises(GraycardError, match="expected array 'nose' in .*got albedo, other"):
        take("base_color=all.npz:key=nose")


def test_an_exr_is_read_by_its_layers(
    theirs: Path, take: Adopt, own: Path, adopted_scene: Path, tmp_path: Path
) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    for view, _, layers, _ in numbered(own, adopted_scene):
        planes = {
            f"albedo.{c}": np.ascontiguousarray(layers["base_color"][..., i]) for i, c in enumerate("RGB")
        }
        planes |= {"Z": layers["depth"]}
        OpenEXR.File(header, planes).write(str(theirs / f"{view.name}.exr"))
    take("base_color={view}.exr:key=albedo", "depth={view}.exr:z")
    check_albedo(own, tmp_path)
    with pytest.raises(GraycardError, match=r"expected layer nose in .*exr, got Z, albedo\.B"):
        take("base_color={view}.exr:key=nose")


@pytest.mark.parametrize("bits", [8, 16])
def test_a_png_keeps_all_bits_of_each_colour(
    bits: int, theirs: Path, take: Adopt, own: Path, adopted_scene: Path, tmp_path: Path
) -> None:
    most, kind = 2**bits - 1, np.uint8 if bits == 8 else np.uint16
    for view, _, layers, _ in numbered(own, adopted_scene):
        found = np.rint(encode(layers["base_color"]) * most).astype(kind)
        cv2.imwrite(str(theirs / f"{view.name}.png"), found[..., ::-1])
    take("base_color={view}.png:srgb")
    check_albedo(own, tmp_path, atol=1.2 / most)


def test_depth_in_millimetres_comes_from_whole_numbers(
    theirs: Path, take: Adopt, own: Path, adopted_scene: Path, tmp_path: Path
) -> None:
    for view, _, layers, _ in numbered(own, adopted_scene):
        save(theirs / f"{view.name}.png", np.rint(layers["depth"] * 1000).astype(np.uint16))
    with pytest.raises(
        GraycardError, match="expected times= or codes for depth in whole numbers, got uint16"
    ):
        take("depth={view}.png:z")
    take("depth={view}.png:z:codes:times=0.001")
    mine, found = open_predictions(own), open_predictions(tmp_path / "ours")
    for view in mine.view_names():
        np.testing.assert_allclose(found.layers(view)["depth"], mine.layers(view)["depth"], atol=6e-4)


def test_a_power_is_undone_as_it_is_declared(
    theirs: Path, take: Adopt, own: Path, adopted_scene: Path, tmp_path: Path
) -> None:
    for view, _, layers, _ in numbered(own, adopted_scene):
        np.save(theirs / f"{view.name}.npy", layers["base_color"].astype(np.float64) ** (1 / 2.2))
    take("base_color={view}.npy:gamma2.2")
    check_albedo(own, tmp_path, atol=1e-6)


FAULTS = (
    ("size", "28x24 pixels, as its view is, got 14x12", lambda v: v[::2, ::2]),
    ("one channel", "expected 3 channels of base_color in .*, got 1. Write all", lambda v: v[..., 0]),
    ("five channels", "expected 3 channels of base_color in .*, got 5", lambda v: v[..., [0, 1, 2, 0, 1]]),
    ("alpha", "expected an opaque picture at .*alpha in 100%", lambda v: v[..., [0, 1, 2, 0]] * 0.9),
    ("channels first", "got shape \\(3, 24, 28\\). Add channels-first", lambda v: np.moveaxis(v, -1, 0)),
    ("four axes", "expected one picture in .*got an array of shape \\(2, ", lambda v: np.stack([v, v])),
    ("large whole numbers", "8 or 16 bits, in .*, got int64. Add codes", lambda v: (v * 255).astype(int)),
    ("codes of unknown curve", "expected a curve for colours", lambda v: (v * 255).astype(np.uint8)),
    ("complex", "expected numbers in .*, got complex", lambda v: v + 0j),
)  # fmt: skip


@pytest.mark.parametrize(("name", "says", "change"), FAULTS, ids=[fault[0] for fault in FAULTS])
def test_a_faulty_file_is_refused_and_nothing_is_written(
    name: str,
    says: str,
    change: Callable[[np.ndarray], np.ndarray],
    theirs: Path,
    take: Adopt,
    own: Path,
    adopted_scene: Path,
    tmp_path: Path,
) -> None:
    """The fault is in the last view; older predictions stay as they were."""
    write_albedo(theirs, own, adopted_scene, lambda v, n, s: f"{v}.npy")
    take("base_color={view}.npy")
    last = open_capture(adopted_scene / "capture").views[-1].name
    np.save(theirs / f"{last}.npy", change(np.load(theirs / f"{last}.npy")))
    with pytest.raises(GraycardError, match=says):
        take("base_color={view}.npy")
    check_albedo(own, tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["ours", "theirs"]


def test_a_missing_view_is_named(
    theirs: Path, take: Adopt, own: Path, adopted_scene: Path, tmp_path: Path
) -> None:
    write_albedo(theirs, own, adopted_scene, lambda v, n, s: f"{s}/{v}.npy")
    lacking = next((theirs / "train").iterdir())
    lacking.unlink()
    with pytest.raises(GraycardError, match=f"got it of 6: train/{lacking.stem}.npy for view {lacking.stem}"):
        take("base_color={split}/{view}.npy")
    for path in (theirs / "train").iterdir():
        path.unlink()
    with pytest.raises(GraycardError, match="or adopt one split by --views test"):
        take("base_color={split}/{view}.npy")
    made = take("base_color={split}/{view}.npy", views="test")
    assert made.views == 3
    assert "4 training views have no prediction" in made.left_out[0]


def test_outputs_of_strangers_stay_in_their_folder(
    theirs: Path, take: Adopt, own: Path, adopted_scene: Path, tmp_path: Path
) -> None:
    write_albedo(theirs, own, adopted_scene, lambda v, n, s: f"{v}.npy")
    name = open_predictions(own).view_names()[0]
    (theirs / f"{name}.npy").unlink()
    np.save(tmp_path / "secret.npy", np.zeros((24, 28, 3)))
    os.symlink(tmp_path / "secret.npy", theirs / f"{name}.npy")
    with pytest.raises(GraycardError, match="got a link to"):
        take("base_color={view}.npy")
    for pattern in ("../{view}.npy", "/etc/{view}.npy", ".hidden/{view}.npy"):
        with pytest.raises(GraycardError, match="stays in its folder"):
            take(f"base_color={pattern}")
    with pytest.raises(GraycardError, match="to be free or to hold predictions, got secret.npy"):
        adopt(request_of(theirs, adopted_scene, ["base_color={view}.npy"]), tmp_path)


@pytest.mark.parametrize(
    ("suffix", "data"),
    [
        (".npy", b"nothing"),
        (".npz", b"PK\x03\x04"),
        (".npy.gz", b"\x1f\x8b\x08"),
        (".png", b"\x89PNG\r\n\x1a\n"),
        (".png", b""),
        (".exr", b"\x76\x2f\x31\x01"),
        (".tiff", b"II*\x00"),
    ],
)
def test_broken_files_are_refused(suffix: str, data: bytes, theirs: Path, take: Adopt, own: Path) -> None:
    for name in open_predictions(own).view_names():
        (theirs / f"{name}{suffix}").write_bytes(data)
    with pytest.raises(GraycardError, match="expected a whole"):
        take(f"base_color={{view}}{suffix}:linear")


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".npy.gz"])
def test_arrays_of_objects_are_refused_as_such(suffix: str, theirs: Path, take: Adopt, own: Path) -> None:
    """They are whole, but to open one would run what it holds."""
    for name in open_predictions(own).view_names():
        with (
            gzip.open(theirs / f"{name}{suffix}", "wb")
            if suffix.endswith("gz")
            else open(theirs / f"{name}{suffix}", "wb") as file
        ):
            (np.savez if suffix == ".npz" else np.save)(file, np.array([{1: 2}], dtype=object))
    with pytest.raises(GraycardError, match="expected numbers in .*, got objects of Python"):
        take(f"base_color={{view}}{suffix}:linear")


@pytest.mark.parametrize(
    ("declared", "values", "says"),
    [
        ("depth={view}.npy:z", np.nan, "expected values of depth in .*, got none that is finite"),
        ("depth={view}.npy:z", -2.0, "expected depths above 0 in .*, got -2 to -2"),
        ("depth={view}.npy:distance", 0.0, "expected depths above 0 in .*, got 0 to 0"),
        ("depth={view}.npy:inverse", 0.0, "got none that is finite"),
        (
            "roughness={view}.npy:linear",
            np.inf,
            "expected values of roughness in .*, got none that is finite",
        ),
    ],
)
def test_a_layer_that_says_nothing_is_refused(
    declared: str, values: float, says: str, theirs: Path, take: Adopt, own: Path, tmp_path: Path
) -> None:
    for name in open_predictions(own).view_names():
        np.save(theirs / f"{name}.npy", np.full((24, 28), values))
    with pytest.raises(GraycardError, match=says):
        take(declared)
    assert [path.name for path in tmp_path.iterdir()] == ["theirs"]
    first = open_predictions(own).view_names()[0]
    np.save(theirs / f"{first}.npy", np.full((24, 28), 1.5))  # one view may see nothing
    assert take(declared).views == 7


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("base_color", "expected LAYER=PATTERN:WORD"),
        ("albeedo={view}.png", "did you mean 'albedo'"),
        ("object_id={view}.png", "ids are not scored"),
        ("base_color={view}.png:sgrb", "did you mean 'srgb'"),
        ("base_color={view}.png:world", "expected axes and coded for normals alone"),
        ("base_color={view}.png:exposed", "expected exposed for light alone"),
        ("base_color={view}.png:z", "for depth alone"),
        ("normal={view}.png", "expected the axes of normals"),
        ("normal={view}.png:world:srgb", "expected normal without a curve"),
        ("depth={view}.png", "expected the kind of depth"),
        ("roughness={view}.png:bgr", "expected bgr for colours alone"),
        ("base_color={view}.png:channel=1", "expected channel= for a layer of one channel"),
        ("roughness={view}.png:channel=9", "channels are 0 to 3"),
        ("base_color={view}.png:panel=3/2", "the first number is 1 up to the second"),
        ("base_color={view}.png:times=nan", "finite and not 0"),
        ("base_color={view}.png:gamma0", "a gamma above 0"),
    ],
)
def test_a_malformed_map_says_what_is_expected(text: str, says: str) -> None:
    with pytest.raises(GraycardError, match=says):
        parse_map(text)


def test_strange_requests_are_refused(theirs: Path, adopted_scene: Path, take: Adopt) -> None:
    for maps, options, says in (
        ([], {}, "expected --layout or --map, got neither"),
        (["base_color={name}.png"], {}, r"expected \{view\}, .* got \{name\}"),
        (["base_color={index:5d}.png"], {}, r"got \{index:5d\}. Write \{index:05d\} where zeros fill"),
        (["base_color={index:03}.png"], {}, r"got \{index:03\}. Write \{index:03d\} where"),
        (["base_color={index+1:4}.png"], {}, r"got \{index\+1:4\}. Write \{index\+1:04d\} where"),
        (["base_color=:srgb"], {}, "expected a pattern"),
        (["base_color=a.npy", "base_color=b.npy"], {}, "expected one --map for base_color, got 2"),
        (["base_color={view}.npy"], {"views": "held"}, "expected --views all, train or test, got held"),
        (["base_color={view}.npy"], {"order": "nowhere"}, "text file with a view on each line, got nowhere"),
        (["base_color={view}.bmp"], {}, "got it of 0"),
    ):
        with pytest.raises(GraycardError, match=says):
            take(*maps, **options)
    with pytest.raises(GraycardError, match="expected a folder of outputs at"):
        adopt(request_of(theirs / "none", adopted_scene, ["base_color={view}.npy"]), theirs / "out")


def test_the_order_of_a_file_names_each_view_once(theirs: Path, take: Adopt, tmp_path: Path) -> None:
    (tmp_path / "order.txt").write_text("test_001\nnobody\n")
    with pytest.raises(
        GraycardError, match=r"each of the 7 views once in .*order.txt, got 2 lines. Look at nobody"
    ):
        take("base_color={index}.npy", order=str(tmp_path / "order.txt"))


words = st.sampled_from(["linear", "srgb", "exposed", "world", "coded", "z", "times=2", "x", "", "panel=1/0"])


@given(st.text(max_size=12), st.text("{}*/.abview:index+05d", max_size=20), st.lists(words, max_size=3))
def test_any_text_is_a_map_or_a_named_error(layer: str, pattern: str, extra: list[str]) -> None:
    for name in (layer, "radiance", "normal", "depth"):
        with suppress(GraycardError):
            assert parse_map(f"{name}={':'.join((pattern, *extra))}").layer == name


def test_the_verb_adopts_and_names_a_wrong_declaration(
    theirs: Path, own: Path, adopted_scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for view, _, layers, _ in numbered(own, adopted_scene):
        Image.fromarray(np.rint(255 * encode(layers["base_color"])).astype(np.uint8)).save(
            theirs / f"{view.name}.png"
        )
    out, told = tmp_path / "ours", tmp_path / "told.json"
    common = ["adopt", str(theirs), str(adopted_scene), "--out", str(out), "--json", str(told), "--map"]
    assert main([*common, "base_color={view}.png:linear"]) == 0
    said = capsys.readouterr().out
    assert "hint 1: base_color looks sRGB-encoded" in said
    assert "of base_color: try srgb" in said
    assert f"score: graycard score {out} {adopted_scene}" in said
    assert [hint["declare"] for hint in read_json(told)["result"]["hints"]] == ["srgb", ""]  # and 8 bits
    assert main([*common, "base_color={view}.png:srgb"]) == 0
    assert "try srgb" not in capsys.readouterr().out
    view = open_predictions(out).view_names()[0]
    codes = np.asarray(Image.open(theirs / f"{view}.png"))
    np.testing.assert_allclose(
        open_predictions(out).layers(view)["base_color"], decode(codes / 255), atol=1e-6
    )


def test_the_verb_lists_layouts_and_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["adopt", "--layouts"]) == 0
    said = capsys.readouterr().out
    for text in ("gs-ir: GS-IR", "source: lzhnb/GS-IR, render.py", "panel=1/3", "camera-opengl"):
        assert text in said
    assert main(["adopt", "x"]) == 2
    assert "expected FOLDER, SCENE and --out PREDICTIONS" in capsys.readouterr().err
