# SPDX-License-Identifier: Apache-2.0
import json
import os
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from graycard import DatasetError, PredictionError, UnknownNameError, all_layers, find_layer
from graycard.io import read_layers, read_rgb, unknown_channels, write_layers, write_rgb
from graycard.layers import find_fault, shape_of

rng = np.random.default_rng(3)


@pytest.fixture
def arrays() -> dict[str, np.ndarray]:
    depth = rng.random((5, 7)).astype(np.float32)
    depth[0, 0] = np.inf
    return {
        "radiance": rng.random((5, 7, 3)).astype(np.float32),
        "radiance.var": rng.random((5, 7, 3)).astype(np.float32),
        "normal": rng.normal(size=(5, 7, 3)).astype(np.float32),
        "depth": depth,
        "object_id": rng.integers(0, 2**32, (5, 7), dtype=np.uint32),
        "visibility.lamp": rng.random((5, 7)).astype(np.float32),
    }


@pytest.mark.parametrize("dense", [False, True])
def test_round_trip_is_exact(tmp_path: Path, arrays: dict[str, np.ndarray], dense: bool):
    write_layers(tmp_path / "a.exr", arrays, dense=dense)
    back = read_layers(tmp_path / "a.exr")
    assert back.keys() == arrays.keys()
    for name, values in arrays.items():
        assert back[name].dtype == values.dtype
        assert np.array_equal(back[name], values)


def test_dense_files_are_small_and_keep_each_bit(tmp_path: Path):
    """Noise, layers that repeat others far away, and a small picture: each has its own best compression."""
    noise = rng.integers(0, 2**32, (64, 48, 3), dtype=np.uint32).view(np.float32)
    light = np.exp(rng.normal(0, 1e-3, noise.shape)).astype(np.float32)
    alike = dict.fromkeys(("albedo", "base_color", "diffuse_reflectance", "f0"), noise)
    cases = {
        "HTJ2K256_COMPRESSION": {"radiance": light},
        "ZSTD_COMPRESSION": {**alike, "radiance": light, "normal": light[::-1], "shading": light[:, ::-1]},
        "ZIP_COMPRESSION": {"base_color": noise, "f0": noise},
    }
    for kind, layers in cases.items():
        write_layers(tmp_path / "plain.exr", layers)
        write_layers(tmp_path / "dense.exr", layers, dense=True)
        plain, dense = ((tmp_path / f"{name}.exr").stat().st_size for name in ("plain", "dense"))
        assert dense <= plain if kind == "ZIP_COMPRESSION" else dense < 0.8 * plain
        for name, values in read_layers(tmp_path / "dense.exr").items():
            assert np.array_equal(values.view(np.uint32), layers[name].view(np.uint32))
        with OpenEXR.File(str(tmp_path / "dense.exr"), header_only=True) as file:
            assert file.header()["compression"] == getattr(OpenEXR, kind)


def test_strided_views_are_written_right(tmp_path: Path):
    """OpenEXR itself writes wrong pixels for them, without an error."""
    image = rng.random((9, 7, 3)).astype(np.float32)
    write_rgb(tmp_path / "a.exr", image[::-1, :, ::-1])
    assert np.array_equal(read_rgb(tmp_path / "a.exr"), image[::-1, :, ::-1])


def test_another_program_sees_named_float32_channels_in_rec709(tmp_path: Path, arrays: dict[str, np.ndarray]):
    write_layers(tmp_path / "a.exr", arrays, {"view": "test_000"})
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert {
            "radiance.R",
            "radiance.var.B",
            "normal.X",
            "depth.Z",
            "object_id.ID",
        } <= file.channels().keys()
        assert file.channels()["radiance.R"].pixels.dtype == np.float32
        assert file.header()["chromaticities"] == pytest.approx(
            (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
        )
        assert json.loads(file.header()["graycard"]) == {"view": "test_000"}


def test_channels_of_several_types_and_in_any_company(tmp_path: Path):
    """Colours are read in one piece where they can be."""
    colours = np.random.default_rng(0).random((4, 5, 3)).astype(np.float16).astype(np.float32)
    planes = {f"radiance.{c}": colours[..., i].copy() for i, c in enumerate("RGB")}
    half = {**planes, "radiance.G": planes["radiance.G"].astype(np.float16)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    for channels in (planes, half, {**half, "depth.Z": planes["radiance.B"]}):
        OpenEXR.File(dict(header), channels).write(str(tmp_path / "a.exr"))
        found = read_layers(tmp_path / "a.exr")["radiance"]
        assert np.array_equal(found, colours)
        assert found.dtype == np.float32
        found[0] = 0  # nothing else holds it


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.99])
def test_a_truncated_file(tmp_path: Path, arrays: dict[str, np.ndarray], share: float):
    path = tmp_path / "a.exr"
    write_layers(path, arrays)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(DatasetError, match=r"expected a whole EXR file at .*a\.exr, got one that breaks off"):
        read_layers(path)


def test_damage_is_said_in_the_error_and_not_on_stdout(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """OpenEXR itself prints why it leaves pixels out: there results are expected."""
    path = tmp_path / "a.exr"
    write_layers(path, {"depth": np.zeros((40, 40))})  # so plain that its pixels are compressed
    data = path.read_bytes()
    path.write_bytes(data[:-20] + b"\xff" * 20)
    with pytest.raises(DatasetError, match="reading pixel data"):
        read_layers(path)
    unknown_channels(path)
    assert capsys.readouterr().out == ""


def test_a_pipe_is_no_file(tmp_path: Path):
    os.mkfifo(tmp_path / "a.exr")
    assert unknown_channels(tmp_path / "a.exr") == {}
    with pytest.raises(DatasetError, match="expected an EXR file at .*, got none"):
        read_layers(tmp_path / "a.exr")


def test_names_of_channels_that_are_no_text_are_damage(tmp_path: Path):
    path = tmp_path / "a.exr"
    write_layers(path, {"depth": np.ones((3, 4), np.float32)})
    data = path.read_bytes()
    assert b"depth." in data
    path.write_bytes(data.replace(b"depth.", b"\xffepth."))
    assert unknown_channels(path) == {}
    with pytest.raises(DatasetError, match="breaks off or is none"):
        read_layers(path)


def test_a_missing_file(tmp_path: Path):
    with pytest.raises(PredictionError, match="expected an EXR file at .*, got none"):
        read_layers(tmp_path / "no.exr", PredictionError)


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        (
            ["albedoo.R", "albedoo.G", "albedoo.B"],
            r"expected a layer that exists, got 'albedoo' \(did you mean 'albedo'",
        ),
        (
            ["normal.R", "normal.G", "normal.B"],
            r"expected channels normal\.X, normal\.Y, normal\.Z .* got normal\.R",
        ),
        (["radiance.R", "radiance.G"], r"expected channels radiance\.R, radiance\.G, radiance\.B"),
        (["R", "G", "B"], "expected channels named <layer>.<suffix> in .*, got R, G, B"),
        ([f"radiance.{c}" for c in "RGBA"], r"expected channels radiance.* got .*radiance\.A"),
    ],
)
def test_wrong_channel_names(tmp_path: Path, channels: list[str], message: str):
    planes = {name: np.zeros((4, 4), np.float32) for name in channels}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, planes).write(str(tmp_path / "a.exr"))
    with pytest.raises(DatasetError, match=message):
        read_layers(tmp_path / "a.exr")


def test_a_photograph_has_plain_channels(tmp_path: Path, arrays: dict[str, np.ndarray]):
    write_layers(tmp_path / "a.exr", arrays)
    with pytest.raises(DatasetError, match="expected channels R, G, B"):
        read_rgb(tmp_path / "a.exr")


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"radiance": np.zeros((4, 4))}, r"expected radiance of shape \(H, W, 3\), got \(4, 4\)"),
        ({"depth": np.zeros((4, 4, 3))}, r"expected depth of shape \(H, W\), got \(4, 4, 3\)"),
        ({"depth": np.zeros((4, 4)), "alpha": np.zeros((4, 5))}, "layers of one size"),
        ({}, "layers of one size"),
    ],
)
def test_wrong_shapes(tmp_path: Path, arrays: dict[str, np.ndarray], message: str):
    with pytest.raises(ValueError, match=message):
        write_layers(tmp_path / "a.exr", arrays)


def test_layers_have_units_and_know_their_families():
    assert find_layer("irradiance.lamp_2").unit == "W/m²"
    assert find_layer("counterfactual.radiance.var").channels == ("R", "G", "B")
    assert len({layer.name for layer in all_layers()}) == len(all_layers())
    assert shape_of("normal", 4, 5) == (4, 5, 3)
    with pytest.raises(UnknownNameError, match="did you mean 'roughness'"):
        find_layer("roughnes")


def test_faults_are_found():
    good = np.ones((4, 5, 3))
    assert find_fault("radiance", good, 4, 5) is None
    assert "of shape (4, 6, 3), got (4, 5, 3)" in str(find_fault("radiance", good, 4, 6))
    good[2, 3, 1] = np.nan
    assert "1 of 60 values are not, the first at (2, 3, 1)" in str(find_fault("radiance", good, 4, 5))
    depth = np.array([[np.inf, 1.0]])
    assert find_fault("depth", depth, 1, 2) is None
    assert find_fault("depth", -depth, 1, 2) is not None
    assert find_fault("object_id", np.zeros((1, 2), np.uint32), 1, 2) is None
