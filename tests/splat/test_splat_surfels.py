# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from graycard import MethodError
from graycard.methods import splat


def some_surfels(count: int = 5, channels: int = 4, seed: int = 0) -> splat.Surfels:
    random = torch.Generator().manual_seed(seed)
    rotations = torch.randn(count, 4, generator=random)
    return splat.Surfels(
        torch.randn(count, 3, generator=random),
        rotations / rotations.norm(dim=1, keepdim=True),
        torch.rand(count, 2, generator=random) + 0.1,
        torch.rand(count, generator=random),
        torch.randn(count, channels, generator=random),
    )


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("centres", np.zeros((5, 3)), "centres to be a torch.Tensor, got ndarray"),
        ("centres", torch.zeros(5, 2), r"centres of shape \(5, 3\), got \(5, 2\)"),
        ("rotations", torch.zeros(4, 4), r"rotations of shape \(5, 4\), got \(4, 4\)"),
        ("opacities", torch.zeros(5, 1), r"opacities of shape \(5\), got \(5, 1\)"),
        ("features", torch.zeros(5), r"features of shape \(5, C\), got \(5,\)"),
        ("features", torch.zeros(5, 2).half(), "features in float32 or float64, got torch.float16"),
        ("features", torch.zeros(5, 2).double(), "features as the centres are .*got torch.float64"),
        ("features", torch.tensor([[0.0]] * 3 + [[float("nan")]] * 2), r"finite, got \[nan\] at surfel 3"),
        ("scales", torch.tensor([[1.0, 1]] * 4 + [[1, 0]]), r"positive, got \[1.0, 0.0\] at surfel 4"),
        ("opacities", torch.tensor([0.0, 0, 1.5, 0, 0]), r"in \[0, 1\], got 1.5 at surfel 2"),
        ("opacities", torch.tensor([-0.1, 0, 0, 0, 0]), r"in \[0, 1\], got -0.1"),
        ("rotations", torch.ones(5, 4), "of unit length, got 2.0 at surfel 0"),
    ],
)
def test_what_is_no_surfel_is_refused(name: str, value: torch.Tensor, message: str):
    with pytest.raises(ValueError, match=message):
        replace(some_surfels(), **{name: value})


def test_none_and_no_channels_are_surfels():
    assert len(some_surfels(count=0)) == 0
    assert some_surfels(channels=0).features.shape == (5, 0)


@pytest.mark.parametrize("count", [0, 5])
def test_saved_and_loaded_bit_by_bit(tmp_path: Path, count: int):
    surfels = some_surfels(count)
    surfels.centres.requires_grad_()
    splat.save_surfels(tmp_path / "s.safetensors", surfels)
    loaded = splat.load_surfels(tmp_path / "s.safetensors")
    for name in ("centres", "rotations", "scales", "opacities", "features"):
        assert torch.equal(getattr(loaded, name), getattr(surfels, name)), name


def test_a_damaged_file_is_named(tmp_path: Path):
    path = tmp_path / "s.safetensors"
    with pytest.raises(MethodError, match="s.safetensors"):
        splat.load_surfels(path)
    splat.save_surfels(path, some_surfels())
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(MethodError, match="expected surfels that graycard saved"):
        splat.load_surfels(path)


def test_other_tensors_are_no_surfels(tmp_path: Path):
    from safetensors.torch import save_file

    save_file({"centres": torch.zeros(2, 3)}, tmp_path / "other.safetensors")
    with pytest.raises(MethodError, match="metadata {}"):
        splat.load_surfels(tmp_path / "other.safetensors")


def read_ply(path: Path) -> dict[str, np.ndarray]:
    """An independent reader of binary PLY files of floats."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    lines = head.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    names = [line.split()[2] for line in lines if line.startswith("property float")]
    (count,) = (int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    table = np.frombuffer(body, "<f4").reshape(count, len(names))
    return dict(zip(names, table.T, strict=True))


@pytest.mark.parametrize("axes", [2, 3])
def test_ply_holds_what_viewers_expect(tmp_path: Path, axes: int):
    surfels = some_surfels()
    colours = torch.rand(5, 3)
    splat.export_ply(tmp_path / "s.ply", surfels, colours, axes)
    ply = read_ply(tmp_path / "s.ply")
    np.testing.assert_allclose(np.stack([ply[k] for k in "xyz"], 1), surfels.centres)
    np.testing.assert_allclose(1 / (1 + np.exp(-ply["opacity"])), surfels.opacities, rtol=1e-5)
    np.testing.assert_allclose(np.exp([ply["scale_0"], ply["scale_1"]]), surfels.scales.T, rtol=1e-6)
    shown = 0.5 + 0.28209479177387814 * np.stack([ply[f"f_dc_{i}"] for i in range(3)], 1)
    np.testing.assert_allclose(shown, colours, atol=1e-6)
    np.testing.assert_allclose(np.stack([ply[f"rot_{i}"] for i in range(4)], 1), surfels.rotations)
    assert [k for k in ply if k.startswith("scale")] == ["scale_0", "scale_1", "scale_2"][:axes]
    if axes == 3:
        np.testing.assert_allclose(np.exp(ply["scale_2"]), 1e-6, rtol=1e-5)


def test_ply_of_opaque_and_of_none_is_finite(tmp_path: Path):
    surfels = replace(some_surfels(2), opacities=torch.tensor([0.0, 1.0]))
    splat.export_ply(tmp_path / "s.ply", surfels, torch.zeros(2, 3))
    assert np.isfinite(read_ply(tmp_path / "s.ply")["opacity"]).all()
    splat.export_ply(tmp_path / "none.ply", some_surfels(0), torch.zeros(0, 3))
    assert read_ply(tmp_path / "none.ply")["x"].size == 0


def test_ply_wants_a_colour_each(tmp_path: Path):
    with pytest.raises(ValueError, match=r"colours of shape \(5, 3\) and 2 or 3"):
        splat.export_ply(tmp_path / "s.ply", some_surfels(), torch.zeros(4, 3))


def test_discs_reach_their_neighbours():
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    surfels = splat.surfels_from_points(line, np.tile([0, 0, 2.0], (4, 1)), np.zeros((4, 1)), opacity=0.3)
    expected = np.sqrt([14 / 3, 2, 2, 14 / 3])
    np.testing.assert_allclose(surfels.scales, np.stack([expected, expected], 1), rtol=1e-6)
    np.testing.assert_allclose(surfels.opacities, 0.3)


def test_points_that_coincide_get_the_smallest_disc():
    surfels = splat.surfels_from_points(
        np.zeros((2, 3)), np.ones((2, 3)), np.zeros((2, 0)), smallest_scale=0.01
    )
    np.testing.assert_allclose(surfels.scales, 0.01)


def test_discs_face_along_the_normals():
    normals = np.concatenate([np.random.default_rng(0).normal(size=(50, 3)), np.eye(3), -np.eye(3)])
    points = np.random.default_rng(1).normal(size=normals.shape)
    surfels = splat.surfels_from_points(points, normals, np.zeros((len(points), 1)))
    turned = Rotation.from_quat(surfels.rotations.numpy(), scalar_first=True).apply([0, 0, 1])
    expected = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    np.testing.assert_allclose(turned, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("points", "normals", "message"),
    [
        (np.zeros((1, 3)), np.ones((1, 3)), "N >= 2"),
        (np.zeros((3, 3)), np.ones((2, 3)), "points and normals"),
        (np.full((2, 3), np.nan), np.ones((2, 3)), "finite points"),
        (np.zeros((2, 3)), np.zeros((2, 3)), "normals of positive length"),
    ],
)
def test_points_without_sense_are_refused(points: np.ndarray, normals: np.ndarray, message: str):
    with pytest.raises(ValueError, match=message):
        splat.surfels_from_points(points, normals, np.zeros((len(points), 1)))
