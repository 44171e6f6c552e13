# SPDX-License-Identifier: Apache-2.0
"""Files of trained splats are read as the programs that wrote them meant them, and damaged ones are named."""

import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from graycard import DatasetError, GraycardError
from graycard.methods.splat import DISCS, SH_DC, Gaussians, Surfels
from graycard.methods.trained import SplatFormat, TrainedSplat, read_splat, write_splat
from random_gaussians import random_gaussians
from random_surfels import random_surfels
from splat_files import Raw, brush_columns, inria_columns, plain, raw_splat, write_ply

COUNT = 300  # more than a chunk of the compressed layout


def raw(degree: int = 3, count: int = COUNT) -> Raw:
    return raw_splat(random_gaussians(count, 11, opacities=(0.02, 0.98)), degree)


def assert_is(found: TrainedSplat, wanted: Raw, atol: float = 1e-6) -> None:
    assert isinstance(found.shapes, Gaussians)
    np.testing.assert_allclose(found.shapes.centres, wanted["means"], atol=atol)
    np.testing.assert_allclose(found.shapes.scales, wanted["scales"].exp(), rtol=1e-5)
    np.testing.assert_allclose(found.shapes.opacities, wanted["opacities"].sigmoid(), atol=1e-6)
    turns = torch.nn.functional.normalize(wanted["quats"], dim=1)
    np.testing.assert_allclose(found.shapes.rotations, turns, atol=1e-6)
    np.testing.assert_allclose(
        found.coefficients, torch.cat([wanted["sh0"], wanted["shN"]], dim=1), atol=1e-6
    )


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian", "ascii"])
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_the_layout_of_inria_in_every_degree_and_byte_order(tmp_path: Path, degree: int, form: str):
    wanted = raw(degree, 40)
    found = read_splat(write_ply(tmp_path / "point_cloud.ply", inria_columns(wanted), form))
    assert_is(found, wanted)
    assert (found.degree, found.primitive, found.antialiased, found.unused) == (degree, "3dgs", False, ())


@pytest.mark.parametrize("degree", [0, 3])
def test_what_gsplats_own_exporter_writes(tmp_path: Path, degree: int):
    exporter = pytest.importorskip("gsplat.exporter")
    wanted = raw(degree)
    exporter.export_splats(**wanted, format="ply", save_to=str(tmp_path / "gsplat.ply"))
    assert_is(read_splat(tmp_path / "gsplat.ply"), wanted)


def test_the_compressed_layout_of_gsplats_own_exporter(tmp_path: Path):
    exporter = pytest.importorskip("gsplat.exporter")
    wanted = raw()
    exporter.export_splats(**wanted, format="ply_compressed", save_to=str(tmp_path / "c.ply"))
    found = read_splat(tmp_path / "c.ply")
    order = exporter.sort_centers(wanted["means"], torch.arange(COUNT))
    wanted = {name: values[order] for name, values in wanted.items()}
    shapes = found.shapes
    np.testing.assert_allclose(shapes.centres, wanted["means"], atol=2.0 / 1023)  # a step of ten bits
    np.testing.assert_allclose(shapes.scales.log(), wanted["scales"], atol=0.01)
    np.testing.assert_allclose(shapes.opacities, wanted["opacities"].sigmoid(), atol=0.6 / 255)
    turns = torch.nn.functional.normalize(wanted["quats"], dim=1)
    assert ((shapes.rotations * turns).sum(dim=1).abs() > 1 - 1e-5).all()
    np.testing.assert_allclose(found.coefficients[:, 0], wanted["sh0"][:, 0], atol=0.03)
    np.testing.assert_allclose(found.coefficients[:, 1:], wanted["shN"], atol=8 / 256)


def test_what_gsplats_own_exporter_writes_for_antimatters_viewer(tmp_path: Path):
    exporter = pytest.importorskip("gsplat.exporter")
    wanted = raw(0)
    wanted["sh0"] = wanted["sh0"].clamp(-1, 1)
    exporter.export_splats(**wanted, format="splat", save_to=str(tmp_path / "s.splat"))
    found = read_splat(tmp_path / "s.splat")
    order = exporter.sort_centers(wanted["means"], torch.arange(COUNT))
    np.testing.assert_array_equal(found.shapes.centres, wanted["means"][order])
    np.testing.assert_allclose(found.shapes.scales, wanted["scales"][order].exp(), rtol=1e-5)
    np.testing.assert_allclose(found.shapes.opacities, wanted["opacities"][order].sigmoid(), atol=1.1 / 255)
    shown = 0.5 + SH_DC * wanted["sh0"][order, 0]
    np.testing.assert_allclose(0.5 + SH_DC * found.coefficients[:, 0], shown, atol=1.1 / 255)
    turns = torch.nn.functional.normalize(wanted["quats"][order], dim=1)
    assert ((found.shapes.rotations * turns).sum(dim=1).abs() > 0.999).all()


def test_the_order_and_the_comment_of_brush(tmp_path: Path):
    wanted = raw(2, 20)
    comments = ("Exported from Brush", "Vertical axis: y", "SH degree: 2", "SplatRenderMode: mip")
    found = read_splat(write_ply(tmp_path / "b.ply", brush_columns(wanted), comments=comments))
    assert_is(found, wanted)
    assert found.antialiased
    plain = (*comments[:3], "SplatRenderMode: default")
    assert not read_splat(write_ply(tmp_path / "b.ply", brush_columns(wanted), comments=plain)).antialiased


def test_plain_colours_of_nerfstudio(tmp_path: Path):
    columns = inria_columns(raw(0, 5))
    colours = {name: np.array([0, 64, 128, 192, 255], np.uint8) for name in ("red", "green", "blue")}
    kept = {name: values for name, values in columns.items() if not name.startswith("f_dc")}
    found = read_splat(write_ply(tmp_path / "rgb.ply", {**kept, **colours}))
    np.testing.assert_allclose(
        0.5 + SH_DC * found.coefficients[:, 0, 0], [0, 64 / 255, 128 / 255, 192 / 255, 1], atol=1e-6
    )


def test_two_scales_are_a_disc(tmp_path: Path):
    columns = inria_columns(raw(3, 6))
    flat = {name: values for name, values in columns.items() if name != "scale_2"}
    found = read_splat(write_ply(tmp_path / "2dgs.ply", flat))
    assert isinstance(found.shapes, Surfels)
    assert found.primitive == "2dgs"
    assert read_splat(write_ply(tmp_path / "3.ply", columns), "2dgs").primitive == "2dgs"
    with pytest.raises(DatasetError, match="got none of scale_2"):
        read_splat(tmp_path / "2dgs.ply", "3dgs")


def test_properties_that_are_not_used_are_named(tmp_path: Path):
    columns = inria_columns(raw(0, 3)) | {"segment": np.zeros(3, np.float32)}
    assert read_splat(write_ply(tmp_path / "s.ply", columns)).unused == ("segment",)


@pytest.mark.parametrize(
    ("change", "doubt"),
    [
        (lambda c: c, None),
        (lambda c: c | {"opacity": 1 / (1 + np.exp(-c["opacity"]))}, "opacities lie between 0 and 1"),
        (lambda c: c | {f"scale_{a}": np.exp(c[f"scale_{a}"]) for a in range(3)}, "scales are above 0"),
        (lambda c: c | {f"rot_{part}": c[f"rot_{part}"] * (np.arange(40) > 1) for part in range(4)},
         "2 of 40 rotations have length zero"),
    ],
)  # fmt: skip
def test_numbers_that_training_does_not_write_are_doubted(
    tmp_path: Path, change: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]], doubt: str | None
):
    found = read_splat(write_ply(tmp_path / "d.ply", change(inria_columns(raw(1, 40)))))
    assert [said.startswith(doubt) for said in found.doubts if doubt] == [True] * (doubt is not None)
    assert bool(found.doubts) == (doubt is not None)


def test_a_few_gaussians_may_be_of_any_kind(tmp_path: Path):
    columns = inria_columns(raw(0, 5)) | {"opacity": np.full(5, 0.5, np.float32)}
    assert read_splat(write_ply(tmp_path / "d.ply", columns)).doubts == ()


def test_limits_of_activations(tmp_path: Path):
    """Opaque, clear, flat, and without a direction: all of these are in files that training wrote."""
    columns = inria_columns(raw(0, 4))
    columns["opacity"] = np.array([np.inf, -np.inf, 200, 0], np.float32)
    columns["scale_2"] = np.array([-np.inf, -50, 0, 0], np.float32)
    for part in range(4):
        columns[f"rot_{part}"] = np.zeros(4, np.float32)
    found = read_splat(write_ply(tmp_path / "l.ply", columns))
    assert found.shapes.opacities.tolist() == [1, 0, 1, 0.5]
    assert found.shapes.rotations.tolist() == [[1, 0, 0, 0]] * 4
    assert 0 < found.shapes.scales[0, 2] < 1e-9


def _without(*names: str) -> Callable[[dict[str, np.ndarray]], object]:
    return lambda columns: [columns.pop(name) for name in names]


def _with(name: str, value: float) -> Callable[[dict[str, np.ndarray]], object]:
    return lambda columns: columns[name].__setitem__(1, value)


CLOUD = ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (_without("opacity"), "got none of opacity"),
        (_without("rot_2", "y"), "got none of y, rot_2"),
        (_without("f_dc_1"), "got none of f_dc_1"),
        (_without("f_rest_44"), r"expected 0, 9, 24 or 45 properties f_rest_0, .* got 44"),
        (_without(*CLOUD), "expected a trained splat at .*, got a cloud of points"),
        (_with("x", np.nan), r"expected finite numbers in .*, got another x in row 1 \(1 such rows\)"),
        (_with("f_rest_7", np.inf), "got another f_rest_7 in row 1"),
        (_with("opacity", np.nan), "expected logits of opacities in .*, got another opacity in row 1"),
        (_with("scale_0", np.nan), "got another scale_0 in row 1"),
        (_with("scale_1", 90), "expected logarithms of sizes up to 1e"),
        (lambda columns: columns.update(filter_3D=columns["x"]), "got filter_3D of Mip-Splatting"),
    ],
)
def test_columns_that_cannot_be_drawn_are_named(
    tmp_path: Path, spoil: Callable[[dict[str, np.ndarray]], object], message: str
):
    columns = {name: values.copy() for name, values in inria_columns(raw(3, 5)).items()}
    spoil(columns)
    path = write_ply(tmp_path / "bad.ply", columns)
    with pytest.raises(DatasetError, match=message):
        read_splat(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data[:-1], "cut off or damaged"),
        (lambda data: data[:40], "without its header"),
        (lambda data: b"", "without its header"),
        (lambda data: data.replace(b"vertex 5", b"vertex 99999999999999"), "cut off or damaged"),
        (lambda data: data.replace(b"vertex 5", b"vertex -1"), "cut off or damaged: -1 rows"),
        (
            lambda data: data[: data.index(b"end_header\n") + 11].replace(b"vertex 5", b"vertex 0"),
            "expected Gaussians in .*, got none",
        ),
        (
            lambda data: data.replace(b"vertex 5", b"vertex 4"),
            "damaged: 68 bytes more than the header counts",
        ),
        (lambda data: data.replace(b"vertex 5", b"vertex 0"), "damaged: 340 bytes more than"),
        (lambda data: data + b"more", "damaged: 4 bytes more than the header counts"),
        (
            lambda data: data.replace(b"element vertex", b"element verses"),
            "an element vertex at .*, got verses",
        ),
        (lambda data: data.replace(b"property float x", b"property list uchar int x"), "an element vertex"),
        (lambda data: data.replace(b"float nx", b"float x"), "cut off or damaged"),
        (lambda data: data.replace(b"little", b"middle"), "got another kind: binary_middle_endian"),
    ],
)
def test_damaged_files_are_named(tmp_path: Path, change: Callable[[bytes], bytes], message: str):
    path = write_ply(tmp_path / "bad.ply", inria_columns(raw(0, 5)))
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(DatasetError, match=message):
        read_splat(path)


def _cut(data: bytes, count: int) -> bytes:
    """Leave out bytes after the header."""
    start = data.index(b"end_header\n") + 11
    return data[:start] + data[start + count :]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda data: _cut(data.replace(b"element chunk 2", b"element chunk 1"), 18 * 4),
            "expected a chunk for each 256 of 300",
        ),
        (lambda data: data.replace(b"element chunk 2", b"element chunk 1"), "72 bytes more than the header"),
        (lambda data: data.replace(b"uint packed_scale", b"int packed_scale"), "got none of packed_scale"),
        (lambda data: data.replace(b"min_scale_y", b"min_scale_q"), "got none of min_scale_y"),
        (lambda data: data.replace(b"element sh 300", b"element sh 299")[:-9], "expected harmonics for 300"),
        (lambda data: data[:-1], "cut off or damaged"),
    ],
)
def test_damaged_compressed_files_are_named(tmp_path: Path, change: Callable[[bytes], bytes], message: str):
    exporter = pytest.importorskip("gsplat.exporter")
    data = exporter.export_splats(**raw(1), format="ply_compressed")
    (tmp_path / "c.ply").write_bytes(change(data))
    with pytest.raises(DatasetError, match=message):
        read_splat(tmp_path / "c.ply")


def test_other_files_are_refused_by_name(tmp_path: Path):
    for name, message in [
        ("a.spz", "Niantic's SPZ"), ("a.KSPLAT", "mkkellogg"), ("a.sog", "SOG"), ("step.ckpt", "checkpoint"),
    ]:  # fmt: skip
        (tmp_path / name).write_bytes(b"1234")
        with pytest.raises(DatasetError, match=message):
            read_splat(tmp_path / name)
    (tmp_path / "a.splat").write_bytes(bytes(33))
    with pytest.raises(DatasetError, match="expected whole records of 32 bytes in .*, got 33"):
        read_splat(tmp_path / "a.splat")
    (tmp_path / "a.splat").write_bytes(b"\xff" * 32)
    with pytest.raises(DatasetError, match="expected finite numbers"):
        read_splat(tmp_path / "a.splat")
    with pytest.raises(DatasetError, match="got the folder"):
        read_splat(tmp_path)
    with pytest.raises(DatasetError, match="expected a trained splat at .*, got No such file"):
        read_splat(tmp_path / "none.ply")
    with pytest.raises(DatasetError, match="expected a trained splat at .*, got No such file"):
        read_splat(tmp_path / "none.splat")


@settings(max_examples=60, deadline=None)
@given(place=st.integers(0, 700), value=st.binary(min_size=1, max_size=6))
def test_no_byte_of_a_file_makes_another_error(
    tmp_path_factory: pytest.TempPathFactory, place: int, value: bytes
):
    folder = tmp_path_factory.mktemp("bytes")
    path = write_ply(folder / "p.ply", inria_columns(raw(0, 5)))
    data = path.read_bytes()
    path.write_bytes(data[:place] + value + data[place + len(value) :])
    with suppress(GraycardError):
        assert len(read_splat(path)) <= 5


@pytest.mark.parametrize(
    ("count", "left"), [(4, "1 lines more"), (0, "5 lines more"), (6, "5 of 6 rows of vertex")]
)
def test_text_with_other_rows_than_its_header_counts_is_named(tmp_path: Path, count: int, left: str):
    path = write_ply(tmp_path / "t.ply", inria_columns(raw(0, 5)), "ascii")
    text = path.read_text()
    path.write_text(text + "\n \n")
    assert len(read_splat(path)) == 5  # empty lines are none
    path.write_text(text.replace("element vertex 5", f"element vertex {count}"))
    with pytest.raises(DatasetError, match=f"cut off or damaged: {left}"):
        read_splat(path)


def test_lists_after_the_rows_are_passed_over(tmp_path: Path):
    """Faces, which no splat needs, in both forms."""
    for form in ("ascii", "binary_little_endian"):
        path = write_ply(tmp_path / "t.ply", inria_columns(raw(0, 5)), form)
        data = path.read_bytes().replace(
            b"end_header\n", b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        )
        face = b"3 0 1 2\n" if form == "ascii" else b"\3" + np.arange(3, dtype="<i4").tobytes()
        path.write_bytes(data + face)
        assert len(read_splat(path)) == 5


def test_text_is_read_in_a_small_multiple_of_its_size(tmp_path: Path):
    """Lists of Python's numbers would take ten times as much."""
    path = write_ply(tmp_path / "t.ply", inria_columns(raw(3, 8000)), "ascii")
    tracemalloc.start()
    try:
        found = read_splat(path)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert_is(found, raw(3, 8000), 1e-5)
    assert most < 4 * path.stat().st_size


def surfels_with_colours() -> TrainedSplat:
    surfels = random_surfels(50, 3, 0, opacities=(0.1, 0.95))
    shapes = plain(Surfels, surfels.centres, surfels.rotations, surfels.scales, surfels.opacities)
    r = torch.Generator().manual_seed(1)
    return TrainedSplat(shapes, 0.5 * torch.randn(50, 9, 3, generator=r), False)


@pytest.mark.parametrize(("kind", "axes"), [("ply", 3), ("2dgs", 2)])
def test_our_own_files_come_back_as_discs(tmp_path: Path, kind: SplatFormat, axes: int):
    splat = surfels_with_colours()
    write_splat(tmp_path / "out.ply", splat, kind)
    assert (tmp_path / "out.ply").read_bytes().count(b"float scale_") == axes
    assert DISCS.encode() in (tmp_path / "out.ply").read_bytes()
    found = read_splat(tmp_path / "out.ply")
    assert found.primitive == "2dgs"
    for name in ("centres", "rotations", "scales", "opacities"):
        np.testing.assert_allclose(
            getattr(found.shapes, name), getattr(splat.shapes, name), rtol=1e-5, atol=1e-6
        )
    np.testing.assert_allclose(found.coefficients[:, :9], splat.coefficients, atol=1e-6)
    assert found.coefficients[:, 9:].abs().max() == 0


def test_a_splat_file_of_ours_comes_back(tmp_path: Path):
    splat = surfels_with_colours()
    write_splat(tmp_path / "out.splat", splat, "splat")
    assert (tmp_path / "out.splat").stat().st_size == 50 * 32
    found = read_splat(tmp_path / "out.splat", "2dgs")
    assert sorted(found.shapes.centres[:, 0].tolist()) == sorted(splat.shapes.centres[:, 0].tolist())
    weight = found.shapes.opacities * found.shapes.scales.prod(dim=1)
    assert (weight.diff() < 0.01 * weight.max()).all()
    with pytest.raises(GraycardError, match="expected surfels to write"):
        write_splat(tmp_path / "x.ply", read_splat(tmp_path / "out.splat"), "ply")
