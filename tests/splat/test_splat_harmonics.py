# SPDX-License-Identifier: Apache-2.0
"""Spherical harmonics: orthonormal, turning as they should, and the kernel equal to the definition."""

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from scipy.special import factorial, lpmv

from graycard.methods import splat
from graycard.points import read_points

EYE = np.array([0.3, -2.0, 0.7])


def quadrature(count: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Directions and weights that integrate polynomials of degree below ``2 count`` on the sphere exactly."""
    z, weight = np.polynomial.legendre.leggauss(count)
    angle = np.arange(2 * count) * np.pi / count
    z, angle = (a.ravel() for a in np.meshgrid(z, angle, indexing="ij"))
    across = np.sqrt(1 - z**2)
    directions = np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
    return directions, np.repeat(weight, 2 * count) * np.pi / count


def definition(coefficients: torch.Tensor, centres: torch.Tensor, degree: int) -> torch.Tensor:
    """The colours by autograd's own arithmetic, with the constants as 3D Gaussian Splatting prints them."""
    d = torch.nn.functional.normalize(centres - torch.tensor(EYE, dtype=centres.dtype), dim=1)
    x, y, z = d.unbind(dim=1)
    xx, yy, zz = x * x, y * y, z * z
    basis = [
        0.28209479177387814 + 0 * x,
        *(-0.4886025119029199 * y, 0.4886025119029199 * z, -0.4886025119029199 * x),
        *(1.0925484305920792 * x * y, -1.0925484305920792 * y * z),
        0.31539156525252005 * (2 * zz - xx - yy),
        *(-1.0925484305920792 * x * z, 0.5462742152960396 * (xx - yy)),
        *(-0.5900435899266435 * y * (3 * xx - yy), 2.890611442640554 * x * y * z),
        -0.4570457994644658 * y * (4 * zz - xx - yy),
        0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy),
        *(-0.4570457994644658 * x * (4 * zz - xx - yy), 1.445305721320277 * z * (xx - yy)),
        -0.5900435899266435 * x * (xx - 3 * yy),
    ]
    used = (degree + 1) ** 2
    return torch.einsum("kn,nkc->nc", torch.stack(basis[:used]), coefficients[:, :used])


def some(count: int = 40, kept: int = 16, dtype: torch.dtype = torch.float64) -> list[torch.Tensor]:
    random = torch.Generator().manual_seed(3)
    coefficients = torch.randn(count, kept, 3, generator=random, dtype=torch.float64).to(dtype)
    centres = torch.randn(count, 3, generator=random, dtype=torch.float64).to(dtype)
    return [coefficients.requires_grad_(), centres.requires_grad_()]


def test_the_harmonics_are_orthonormal():
    directions, weights = quadrature()
    basis = splat.harmonics_basis(directions, 3)
    np.testing.assert_allclose(basis.T @ (weights[:, None] * basis), np.eye(16), atol=1e-12)


def test_they_are_those_of_associated_legendre_functions():
    """Real and imaginary parts of the complex harmonics, times the square root of two."""
    directions, _ = quadrature(5)
    x, y, z = directions.T
    basis = splat.harmonics_basis(directions, 3)
    for degree in range(4):
        for order in range(-degree, degree + 1):
            m = abs(order)
            norm = (2 * degree + 1) / (4 * np.pi) * factorial(degree - m) / factorial(degree + m)
            turn = np.cos(m * np.arctan2(y, x)) if order >= 0 else np.sin(m * np.arctan2(y, x))
            expected = np.sqrt(norm * (2 if order else 1)) * lpmv(m, degree, z) * turn
            np.testing.assert_allclose(basis[:, degree**2 + degree + order], expected, atol=1e-12)


def test_degree_one_turns_as_a_vector():
    """Coefficients of degree one are a vector: turning it turns the function."""
    turn = Rotation.from_rotvec([0.4, -0.9, 0.3]).as_matrix()
    directions = quadrature(4)[0]
    to_coefficients = np.array([[0, -1, 0], [0, 0, 1], [-1, 0, 0]])  # of y, z, x, with their signs
    vector = np.array([0.2, 0.5, -0.7])
    before = splat.harmonics_basis(directions, 1)[:, 1:] @ (to_coefficients @ vector)
    after = splat.harmonics_basis(directions @ turn.T, 1)[:, 1:] @ (to_coefficients @ turn @ vector)
    np.testing.assert_allclose(after, before, atol=1e-14)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_the_kernel_is_the_definition(degree: int):
    coefficients, centres = some()
    weight = torch.randn(40, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    expected = definition(coefficients, centres, degree)
    wanted = torch.autograd.grad((expected * weight).sum(), [coefficients, centres])
    for dtype, tolerance in ((torch.float64, 1e-12), (torch.float32, 3e-6)):
        inputs = [values.detach().to(dtype).requires_grad_() for values in (coefficients, centres)]
        found = splat.spherical_harmonics_colours(inputs[0], inputs[1], EYE, degree)
        assert found.dtype == dtype
        torch.testing.assert_close(found.double(), expected, rtol=tolerance, atol=tolerance)
        gradients = torch.autograd.grad((found * weight.to(dtype)).sum(), inputs)
        for got, want in zip(gradients, wanted, strict=True):
            scale = want.abs().max().clamp(min=1)
            torch.testing.assert_close(got.double() / scale, want / scale, rtol=0, atol=tolerance)


def test_more_coefficients_than_are_used_get_no_gradient():
    coefficients, centres = some(kept=9)
    splat.spherical_harmonics_colours(coefficients, centres, EYE, 1).sum().backward()
    assert coefficients.grad is not None
    assert (coefficients.grad[:, :4] != 0).all()
    assert (coefficients.grad[:, 4:] == 0).all()


def test_a_centre_in_the_eye_has_the_colour_of_all_directions():
    coefficients = torch.ones(1, 16, 3, requires_grad=True)
    centres = torch.tensor(EYE[None], dtype=torch.float64).float().requires_grad_()
    eye = centres.detach().double().numpy()[0]
    found = splat.spherical_harmonics_colours(coefficients, centres, eye, 3)
    found.sum().backward()
    np.testing.assert_allclose(found.detach(), 0.28209479, rtol=1e-6)
    assert centres.grad is not None
    assert (centres.grad == 0).all()


@pytest.mark.parametrize(
    ("coefficients", "centres", "degree", "message"),
    [
        (torch.zeros(4, 3, 3), torch.zeros(4, 3), 1, r"shape \(4, 4 or more, 3\), got \(4, 3, 3\)"),
        (torch.zeros(3, 4, 3), torch.zeros(4, 3), 1, r"expected coefficients of shape \(4"),
        (torch.zeros(4, 4, 3), torch.zeros(4, 2), 1, "expected centres of shape"),
        (torch.zeros(4, 4, 3), torch.zeros(4, 3).double(), 1, "in torch.float32, got .* in torch.float64"),
        (torch.zeros(4, 25, 3), torch.zeros(4, 3), 4, "a degree of 0 to 3, got 4"),
    ],
)
def test_what_does_not_fit_is_refused(
    coefficients: torch.Tensor, centres: torch.Tensor, degree: int, message: str
):
    with pytest.raises(ValueError, match=message):
        splat.spherical_harmonics_colours(coefficients, centres, EYE, degree)


def disc(count: int) -> splat.Surfels:
    return splat.surfels_from_points(np.eye(3)[:count], np.eye(3)[:count], np.zeros((count, 0)))


@pytest.mark.parametrize("kept", [1, 4, 16])
def test_viewers_read_all_coefficients_channel_by_channel(tmp_path: Path, kept: int):
    coefficients = torch.arange(2 * kept * 3.0).reshape(2, kept, 3)
    splat.export_harmonics_ply(tmp_path / "s.ply", disc(2), coefficients)
    head, _, body = (tmp_path / "s.ply").read_bytes().partition(b"end_header\n")
    names = [line.split()[2] for line in head.decode().splitlines() if line.startswith("property float")]
    table = np.frombuffer(body, "<f4").reshape(2, -1)
    assert names[6:9] == ["f_dc_0", "f_dc_1", "f_dc_2"]
    assert names[9:54] == [f"f_rest_{i}" for i in range(45)]
    assert names[54] == "opacity"
    np.testing.assert_array_equal(table[:, 6:9], coefficients[:, 0])
    rest = table[:, 9:54].reshape(2, 3, 15)  # as the field's loaders take them apart
    np.testing.assert_array_equal(rest[:, :, : kept - 1], coefficients[:, 1:].mT)
    assert (rest[:, :, kept - 1 :] == 0).all()


def test_a_point_cloud_of_harmonics_is_also_one_of_points(tmp_path: Path):
    splat.export_harmonics_ply(tmp_path / "s.ply", disc(3), torch.zeros(3, 4, 3), scale_axes=2)
    np.testing.assert_allclose(read_points(tmp_path / "s.ply").positions, np.eye(3))


@pytest.mark.parametrize(("kept", "axes"), [(2, 3), (16, 1)])
def test_coefficients_of_no_whole_degree_are_refused(tmp_path: Path, kept: int, axes: int):
    with pytest.raises(ValueError, match="1 or 4 or 9 or 16"):
        splat.export_harmonics_ply(tmp_path / "s.ply", disc(2), torch.zeros(2, kept, 3), axes)
