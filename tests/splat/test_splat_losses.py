# SPDX-License-Identifier: Apache-2.0
"""Losses between images, against their definitions in float64 and against scikit-image."""

from collections.abc import Callable
from typing import cast

import numba
import numpy as np
import pytest
import torch
from skimage.metrics import structural_similarity

from graycard import Camera, look_at
from graycard.methods import splat

SIZES = [(1, 1, 1), (3, 2, 1), (2, 60, 3), (60, 2, 3), (16, 16, 3), (33, 29, 2), (21, 40, 4), (40, 33, 3)]
RANGES = {
    "unit": (0.0, 1.0),
    "bright and flat": (5.0, 0.01),
    "nearly black": (0.0, 1e-3),
    "lamps": (0.0, 100),
}


def window(values: torch.Tensor) -> torch.Tensor:
    """Weighted mean around each pixel of ``(H, W, C)``, zero beyond the border."""
    line = torch.exp(-0.5 * (torch.arange(-5, 6, dtype=torch.float64) / 1.5) ** 2)
    line = line / line.sum()
    stack = values.permute(2, 0, 1)[:, None]
    return torch.nn.functional.conv2d(stack, torch.outer(line, line)[None, None], padding=5)[:, 0].permute(
        1, 2, 0
    )


def ssim_definition(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """Wang et al. 2004, equation 13, as one fraction."""
    mean_x, mean_y = window(x), window(y)
    variances = window(x * x) - mean_x**2 + window(y * y) - mean_y**2
    covariance = window(x * y) - mean_x * mean_y
    above = (2 * mean_x * mean_y + 0.01**2) * (2 * covariance + 0.03**2)
    return above / ((mean_x**2 + mean_y**2 + 0.01**2) * (variances + 0.03**2))


def photometric_definition(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    return 0.8 * (x - y).abs() + 0.2 * (1 - ssim_definition(x, y))


def pair(shape: tuple[int, ...], values: str = "unit", seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """An image with structure and a target that is like it, float32."""
    random = np.random.default_rng(seed)
    offset, contrast = RANGES[values]
    first = random.uniform(size=shape)
    second = 0.6 * first + 0.4 * random.uniform(size=shape)
    both = (torch.from_numpy((offset + contrast * v).astype(np.float32)) for v in (first, second))
    return cast(tuple[torch.Tensor, torch.Tensor], tuple(both))


def gradient_of(
    function: Callable[[torch.Tensor, torch.Tensor], torch.Tensor], image: torch.Tensor, target: torch.Tensor
) -> torch.Tensor:
    """Return the gradient of a random weighting of the map, by the image, in its dtype."""
    leaf = image.clone().requires_grad_()
    weights = torch.rand(image.shape, generator=torch.Generator().manual_seed(3), dtype=torch.float64) - 0.3
    (weights.to(image.dtype) * function(leaf, target)).sum().backward()
    return cast(torch.Tensor, leaf.grad)


def assert_near(got: torch.Tensor, expected: torch.Tensor) -> None:
    """Within 1e-4 of the length of the whole, and of the largest number one by one."""
    error = got.double() - expected
    assert error.norm() <= 1e-4 * expected.norm()
    assert error.abs().max() <= 1e-4 * expected.abs().max()


@pytest.mark.parametrize("values", RANGES)
@pytest.mark.parametrize("shape", SIZES)
def test_ssim_is_that_of_the_definition(shape: tuple[int, ...], values: str):
    image, target = pair(shape, values)
    expected = ssim_definition(image.double(), target.double())
    assert (splat.ssim_map(image, target).double() - expected).abs().max() < 1e-5


def test_ssim_is_that_of_scikit_image_away_from_the_border():
    image, target = pair((48, 40, 3))
    found = structural_similarity(
        image.double().numpy(), target.double().numpy(), win_size=11, gaussian_weights=True, sigma=1.5,
        use_sample_covariance=False, data_range=1.0, channel_axis=2, full=True,
    )  # fmt: skip
    expected = cast(np.ndarray, found[1])
    inner = slice(5, -5)
    np.testing.assert_allclose(splat.ssim_map(image, target)[inner, inner], expected[inner, inner], atol=1e-5)


@pytest.mark.parametrize("share", [0.0, 0.2, 1.0])
def test_the_photometric_map_is_its_parts(share: float):
    image, target = pair((20, 23, 3))
    parts = (1 - share) * splat.l1_map(image, target) + share * (1 - splat.ssim_map(image, target))
    torch.testing.assert_close(splat.photometric_map(image, target, share), parts, atol=1e-6, rtol=1e-6)


@pytest.mark.parametrize("values", RANGES)
@pytest.mark.parametrize("shape", SIZES)
def test_gradients_are_those_of_the_definition(shape: tuple[int, ...], values: str):
    image, target = pair(shape, values)
    expected = gradient_of(photometric_definition, image.double(), target.double())
    assert_near(gradient_of(splat.photometric_map, image, target), expected)


def test_the_gradient_of_ssim_alone():
    image, target = pair((31, 18, 3))
    expected = gradient_of(ssim_definition, image.double(), target.double())
    assert_near(gradient_of(splat.ssim_map, image, target), expected)


def test_finite_differences_confirm_the_definition():
    image, target = pair((3, 5, 1))
    leaf = image.double().requires_grad_()
    assert torch.autograd.gradcheck(lambda x: ssim_definition(x, target.double()), (leaf,))


@pytest.mark.parametrize("values", RANGES)
def test_equal_images_lack_nothing_and_pull_nowhere(values: str):
    image, _ = pair((24, 19, 3), values)
    assert (splat.ssim_map(image, image) == 1).all()
    assert (splat.photometric_map(image, image) == 0).all()
    assert (gradient_of(splat.photometric_map, image, image) == 0).all()


def test_nearly_equal_images_keep_their_digits():
    """A fraction in float32 would be all rounding at 1 - SSIM of 1e-8."""
    image, _ = pair((24, 19, 3))
    target = image + 1e-5 * torch.from_numpy(
        np.random.default_rng(1).normal(size=image.shape).astype(np.float32)
    )
    lack = splat.photometric_map(image, target, ssim_share=1.0).double()
    expected = 1 - ssim_definition(image.double(), target.double())
    assert expected.max() < 1e-7
    assert (lack - expected).abs().max() < 1e-2 * expected.max()
    assert_near(
        gradient_of(lambda x, y: splat.photometric_map(x, y, 1.0), image, target),
        gradient_of(lambda x, y: 1 - ssim_definition(x, y), image.double(), target.double()),
    )


def test_an_offset_is_seen_by_the_means_and_a_gain_by_both():
    """Flat images, far from the border, have a luminance term only; waves have one of contrast, too."""
    flat = torch.full((32, 32, 1), 0.3)
    got = splat.ssim_map(flat + 0.2, flat)[16, 16, 0]
    assert got == pytest.approx((2 * 0.5 * 0.3 + 1e-4) / (0.5**2 + 0.3**2 + 1e-4), abs=1e-6)
    waves = 0.1 * torch.sin(torch.arange(32.0))[:, None, None].expand(32, 32, 1)
    mean, second = float(window(waves.double())[16, 16, 0]), float(window(waves.double() ** 2)[16, 16, 0])
    square, variance = mean**2, second - mean**2
    expected = (4 * square + 1e-4) / (5 * square + 1e-4) * (4 * variance + 9e-4) / (5 * variance + 9e-4)
    assert splat.ssim_map(2 * waves, waves)[16, 16, 0] == pytest.approx(expected, abs=1e-6)


def test_channels_and_orientations_do_not_mix():
    image, target = pair((26, 21, 3))
    whole = splat.photometric_map(image, target)
    for channel in range(3):
        alone = splat.photometric_map(image[..., channel : channel + 1], target[..., channel : channel + 1])
        torch.testing.assert_close(whole[..., channel : channel + 1], alone, atol=1e-6, rtol=1e-5)
    turned = splat.photometric_map(image.transpose(0, 1), target.transpose(0, 1)).transpose(0, 1)
    torch.testing.assert_close(whole, turned, atol=1e-6, rtol=1e-5)
    mirrored = splat.photometric_map(image.flip(1), target.flip(1)).flip(1)
    torch.testing.assert_close(whole, mirrored, atol=1e-6, rtol=1e-5)


def test_one_thread_and_two_give_the_same_bits():
    image, target = pair((50, 37, 3))
    before, found = numba.get_num_threads(), []
    try:
        for threads in (1, min(2, before), min(2, before)):
            numba.set_num_threads(threads)
            values = splat.photometric_map(image, target)
            found.append((values, gradient_of(splat.photometric_map, image, target)))
    finally:
        numba.set_num_threads(before)
    assert all(torch.equal(a, b) for other in found[1:] for a, b in zip(found[0], other, strict=True))


def test_only_the_image_has_a_gradient():
    image, target = pair((9, 8, 3))
    image.requires_grad_()
    target.requires_grad_()
    for function in (splat.l1_map, splat.ssim_map, splat.photometric_map):
        function(image, target).sum().backward()
    assert image.grad is not None
    assert target.grad is None


def test_no_gradient_is_made_ready_where_none_is_wanted():
    image, target = pair((9, 8, 3))
    assert not splat.photometric_map(image, target).requires_grad


def test_l1_is_the_absolute_difference():
    image, target = pair((5, 4, 3))
    image[0] = target[0]
    np.testing.assert_array_equal(splat.l1_map(image, target), np.abs(image.numpy() - target.numpy()))
    leaf = image.clone().requires_grad_()
    splat.l1_map(leaf, target).sum().backward()
    np.testing.assert_array_equal(cast(torch.Tensor, leaf.grad), np.sign(image.numpy() - target.numpy()))


def test_an_image_that_changes_before_its_gradient_is_refused():
    """Its derivatives would be those of another image."""
    image, target = pair((9, 8, 3))
    source = image.clone().requires_grad_()
    leaf = source * 1
    value = splat.ssim_map(leaf, target).sum()
    with torch.no_grad():
        leaf += 1
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        value.backward()


def test_a_nan_spreads_to_its_windows_only():
    image, target = pair((40, 40, 1))
    image[20, 20] = torch.nan
    for got in (splat.ssim_map(image, target), splat.photometric_map(image, target)):
        seen = got[..., 0].isnan()
        assert seen[15:26, 15:26].all()
        assert seen.sum() == 121
    gradient = gradient_of(splat.photometric_map, image, target)
    assert gradient[..., 0].isnan()[20, 20]
    assert not gradient[:9].isnan().any()


@pytest.mark.parametrize(
    ("image", "target", "match"),
    [
        (
            torch.zeros(4, 4),
            torch.zeros(4, 4),
            r"image of shape \(H, W, C\), none of them zero, got \(4, 4\)",
        ),
        (torch.zeros(4, 4, 3), torch.zeros(4, 5, 3), r"target of shape \(4, 4, 3\) on cpu, got \(4, 5, 3\)"),
        (torch.zeros(0, 4, 3), torch.zeros(0, 4, 3), "none of them zero"),
        (
            torch.zeros(4, 4, 3).double(),
            torch.zeros(4, 4, 3),
            "image in float32 on the CPU or a GPU, got torch.float64",
        ),
        (
            torch.zeros(4, 4, 3),
            torch.zeros(4, 4, 3, dtype=torch.uint8),
            "target in float32 on the CPU or a GPU, got",
        ),
        (torch.zeros(4, 4, 3, device="meta"), torch.zeros(4, 4, 3), "got torch.float32 on meta"),
    ],
)
def test_other_images_are_refused(image: torch.Tensor, target: torch.Tensor, match: str):
    for function in (splat.l1_map, splat.ssim_map, splat.photometric_map):
        with pytest.raises(ValueError, match=match):
            function(image, target)


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_share_outside_zero_and_one_is_refused(share: float):
    with pytest.raises(ValueError, match=r"ssim_share in \[0, 1\]"):
        splat.photometric_map(*pair((4, 4, 3)), share)


def camera_of(width: int = 33, height: int = 27, focal: float = 31) -> Camera:
    K = np.array([[focal, 0.7, width / 2 + 0.3], [0, 1.1 * focal, height / 2 - 0.2], [0, 0, 1]])
    return Camera(width, height, K, look_at(np.array([0.4, -2.5, 0.9]), np.array([0.1, 0, 0.2])))


def plane_depth(camera: Camera, normal: np.ndarray, point: np.ndarray) -> np.ndarray:
    """z-depth of a plane."""
    rays = camera.rays()
    distance = normal @ (point - camera.position) / (rays @ normal)
    return distance * (rays @ camera.forward)


def sphere_depth(camera: Camera, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """z-depth of a sphere in the world's origin, infinite beside it, and its normals."""
    rays, origin = camera.rays(), camera.position
    along = rays @ origin
    square = along**2 - origin @ origin + radius**2
    distance = np.where(square > 0, -along - np.sqrt(np.maximum(square, 0)), np.inf)
    point = origin + np.where(square > 0, distance, 0)[..., None] * rays
    return distance * (rays @ camera.forward), point / radius


def normals_definition(depth: torch.Tensor, camera: Camera) -> torch.Tensor:
    """By whole images, in float64; for depths that are positive everywhere."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(camera.K).T
    points = depth[..., None] * torch.from_numpy(rays @ camera.camera_to_world[:3, :3].T)
    right = points[1:-1, 2:] - points[1:-1, :-2]
    down = points[2:, 1:-1] - points[:-2, 1:-1]
    inner = torch.nn.functional.normalize(torch.linalg.cross(down, right), dim=-1)
    return torch.nn.functional.pad(inner, (0, 0, 1, 1, 1, 1))


def bumpy_inputs(dtype: torch.dtype = torch.float64) -> list[torch.Tensor]:
    """Depth, normal and alpha of no surface in particular."""
    random, camera = np.random.default_rng(0), camera_of()
    size = (camera.height, camera.width)
    values = 2 + 0.3 * random.uniform(size=size), random.normal(size=(*size, 3)), random.uniform(size=size)
    return [torch.from_numpy(value).to(dtype) for value in values]


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_plane_has_its_normal(dtype: torch.dtype):
    camera, normal = camera_of(), np.array([0.3, -0.8, 0.52])
    normal /= np.linalg.norm(normal)
    depth = torch.from_numpy(plane_depth(camera, normal, np.zeros(3))).to(dtype)
    got = splat.depth_to_normals(depth, camera)
    assert got.dtype == dtype
    expected = np.broadcast_to(normal, (25, 31, 3))
    np.testing.assert_allclose(got[1:-1, 1:-1], expected, atol=1e-12 if dtype == torch.float64 else 1e-4)
    assert (got[[0, -1]] == 0).all()
    assert (got[:, [0, -1]] == 0).all()


def test_a_sphere_has_its_normals_and_its_rim_none():
    camera = camera_of(200, 180, 190)
    depth, normals = sphere_depth(camera, 0.7)
    inside = np.isfinite(depth)
    got = splat.depth_to_normals(torch.from_numpy(depth), camera).numpy()
    assert (got[~inside] == 0).all()
    front = inside & ((normals * camera.rays()).sum(axis=2) < -0.4)  # at the rim a difference is no tangent
    assert front.sum() > 5000
    assert ((got * normals).sum(axis=2)[front] > 0.99999).all()
    np.testing.assert_allclose(np.linalg.norm(got[front], axis=1), 1, atol=1e-12)


@pytest.mark.parametrize("nothing", [0.0, -1.0, np.inf])
def test_no_normal_where_a_neighbour_is_no_surface(nothing: float):
    depth = torch.full((27, 33), 2.0)
    depth[10, 12] = nothing
    zero = (splat.depth_to_normals(depth, camera_of()) == 0).all(dim=2)[1:-1, 1:-1].nonzero() + 1
    assert {tuple(place) for place in zero.tolist()} == {(9, 12), (11, 12), (10, 11), (10, 13)}


def test_a_depth_of_nan_shows():
    depth = torch.full((27, 33), 2.0)
    depth[10, 12] = torch.nan
    assert splat.depth_to_normals(depth, camera_of()).isnan().any(dim=2).sum() == 4


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_disagreement_is_that_of_the_definition(dtype: torch.dtype):
    depth, normal, alpha = bumpy_inputs(dtype)
    got = splat.depth_normal_map(depth, normal, alpha, camera_of())
    drawn = normals_definition(depth.double(), camera_of()) * alpha.double()[..., None]
    assert got.dtype == dtype
    np.testing.assert_allclose(got, 1 - (normal.double() * drawn).sum(dim=2), atol=1e-5)
    assert (got[0] == 1).all()


@pytest.mark.parametrize("width", [3, 19, 20, 21, 53])
def test_single_and_double_precision_agree_where_depth_ends(width: int):
    """Two kernels, of which the one for float32 takes sixteen pixels at a time."""
    random, size = np.random.default_rng(1000), (23, width)
    K = np.array([[40, 0.3, width / 2], [0, 44, 11], [0, 0, 1]])
    camera = Camera(width, 23, K, look_at(np.array([0.2, -2.5, 0.3]), np.zeros(3)))
    depth = 2 + 0.3 * random.uniform(size=size)
    for nothing, share in ((0.0, 0.05), (-1.0, 0.02), (np.inf, 0.02), (np.nan, 0.01)):
        depth[random.uniform(size=size) < share] = nothing
    values = depth, random.normal(size=(*size, 3)), random.uniform(size=size)
    single, double = (
        [torch.from_numpy(one.astype(np.float32)).to(dtype) for one in values]
        for dtype in (torch.float32, torch.float64)
    )

    def disagreement(*images: torch.Tensor) -> torch.Tensor:
        depth, normal, alpha = images
        return splat.depth_normal_map(depth, normal, alpha, camera)

    ours = [disagreement(*images) for images in (single, double)]
    torch.testing.assert_close(ours[0].double(), ours[1], rtol=0, atol=1e-5, equal_nan=True)
    slopes = [both_gradients(disagreement, images) for images in (single, double)]
    for ours_single, truth in zip(*slopes, strict=True):
        torch.testing.assert_close(ours_single.double(), truth, rtol=1e-4, atol=1e-4, equal_nan=True)


def test_surfels_on_their_surface_agree():
    camera, normal = camera_of(), np.array([0.0, -1.0, 0.0])
    depth = torch.from_numpy(plane_depth(camera, normal, np.zeros(3)))
    drawn = 0.9 * torch.from_numpy(normal).expand(27, 33, 3)
    got = splat.depth_normal_map(depth, drawn, torch.full((27, 33), 0.9, dtype=torch.float64), camera)
    np.testing.assert_allclose(got[1:-1, 1:-1], 1 - 0.81, atol=1e-12)


def both_gradients(
    function: Callable[..., torch.Tensor], inputs: list[torch.Tensor]
) -> tuple[torch.Tensor, torch.Tensor]:
    depth, normal, alpha = (one.clone().requires_grad_() for one in inputs)
    weights = torch.rand(depth.shape, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    (weights.to(depth.dtype) * function(depth, normal, alpha)).sum().backward()
    assert alpha.grad is None
    return cast(torch.Tensor, depth.grad), cast(torch.Tensor, normal.grad)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_gradients_of_disagreement_are_those_of_the_definition(dtype: torch.dtype):
    def definition(depth: torch.Tensor, normal: torch.Tensor, alpha: torch.Tensor) -> torch.Tensor:
        drawn = normals_definition(depth, camera_of()) * alpha.detach()[..., None]
        return 1 - (normal * drawn).sum(dim=2)

    inputs = bumpy_inputs(dtype)
    got = both_gradients(lambda d, n, a: splat.depth_normal_map(d, n, a, camera_of()), inputs)
    expected = both_gradients(definition, [one.double() for one in inputs])
    for ours, truth in zip(got, expected, strict=True):
        assert ours.dtype == dtype
        assert_near(ours, truth)


def test_gradients_of_normals_are_those_of_finite_differences():
    """They agree at the end of the depth, too: beyond it nothing pulls."""
    camera, random = camera_of(7, 6), np.random.default_rng(0)
    depth = torch.from_numpy(random.uniform(1, 2, (6, 7)))
    depth[2, 3] = 0
    depth.requires_grad_()
    inside = torch.ones(6, 7, dtype=torch.bool)
    inside[2, 3] = False

    def normals(values: torch.Tensor) -> torch.Tensor:
        return splat.depth_to_normals(
            torch.zeros(6, 7, dtype=torch.float64).masked_scatter(inside, values), camera
        )

    assert torch.autograd.gradcheck(normals, (depth.detach()[inside].requires_grad_(),))
    splat.depth_to_normals(depth, camera).sum().backward()
    assert cast(torch.Tensor, depth.grad)[2, 3] == 0


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda d, n, a: (d[1:], n, a), r"depth of shape \(27, 33\), got \(26, 33\)"),
        (lambda d, n, a: (d, n[..., :2], a), r"normal of shape \(27, 33, 3\), got"),
        (lambda d, n, a: (d, n, a[..., None]), r"alpha of shape \(27, 33\), got"),
        (
            lambda d, n, a: (d, n.float(), a),
            "normal in the dtype of the depth, torch.float64, on its device, cpu, got torch.float32",
        ),
        (
            lambda d, n, a: (d.half(), n, a),
            "depth in float32 or float64 on the CPU or a GPU, got torch.float16",
        ),
        (
            lambda d, n, a: (d.to("meta"), n, a),
            "depth in float32 or float64 on the CPU or a GPU, got torch.float64 on meta",
        ),
    ],
)
def test_other_maps_are_refused(change: Callable[..., tuple[torch.Tensor, ...]], match: str):
    depth, normal, alpha = change(*bumpy_inputs())
    with pytest.raises(ValueError, match=match):
        splat.depth_normal_map(depth, normal, alpha, camera_of())
