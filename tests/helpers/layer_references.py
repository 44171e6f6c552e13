# SPDX-License-Identifier: Apache-2.0
"""References for scores of layers and lights: other libraries and closed forms."""

import os
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import NamedTuple
from unittest import mock

import flip_evaluator
import numpy as np
import torch
from safetensors.torch import save_file
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import map_coordinates
from scipy.spatial import distance

import graycard.eval as ge
from graycard import (
    Camera,
    PointLight,
    RectangleLight,
    SphereLight,
    SpotLight,
    look_at,
    srgb_decode,
    srgb_encode,
)
from graycard.eval.kinds._images import measure
from graycard.eval.lights._shapes import chromaticity_error, direction_error, extent_error
from graycard.eval.lights._spheres import ALPHA, render_spheres, sphere_normals
from graycard.eval.measures._chart import patch_difference
from graycard.eval.measures._colour_difference import REC709_TO_XYZ
from graycard.eval.measures._lpips import lpips as our_lpips
from graycard.eval.metrics._glossy import overlap
from graycard.eval.scoring._comparison import LayerComparison
from graycard.layers import PARTS, with_sums
from graycard.networks import Net

RNG = np.random.default_rng(32)
TRUE = RNG.uniform(0.02, 0.95, (50, 42, 3))
PREDICTED = np.clip(TRUE * (1.1, 0.9, 1.0) + RNG.normal(0, 0.1, TRUE.shape), 0, 1)
EVERYWHERE = np.ones((50, 42), bool)
Pair = tuple[np.ndarray | float, np.ndarray | float]
"""Value by graycard, and value of the same by something else."""


def colour_science() -> ModuleType:
    """The library, which warns about plotting when it is imported."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


class Layer(NamedTuple):
    """A convolution of a trunk of LPIPS."""

    place: int
    """Index in torchvision's network."""
    channels: int
    kernel: int
    stride: int
    padding: int
    window: int
    """Side of the maximum before it, every 2 pixels; 0: none."""
    compared: bool
    """True if pictures are compared after it."""


ALEX = [
    Layer(0, 6, 11, 4, 2, 0, True),
    Layer(3, 8, 5, 1, 2, 3, True),
    Layer(6, 10, 3, 1, 1, 3, True),
    Layer(8, 7, 3, 1, 1, 0, True),
    Layer(10, 5, 3, 1, 1, 0, True),
]
VGG = [
    Layer(index, 4 + index % 5, 3, 1, 1, 2 * (index in (5, 10, 17, 24)), index in (2, 7, 14, 21, 28))
    for index in (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)
]
"""Trunks of LPIPS with a few channels."""


def random_weights(layers: Sequence[Layer] = ALEX) -> dict[str, np.ndarray]:
    """A trunk with a few channels, and LPIPS on top, at random."""
    rng, found, before, head = np.random.default_rng(5), {}, 3, 0
    for layer in layers:
        shape = layer.channels, before, layer.kernel, layer.kernel
        found[f"features.{layer.place}.weight"] = rng.normal(0, (2 / np.prod(shape[1:])) ** 0.5, shape)
        found[f"features.{layer.place}.bias"] = rng.normal(0, 0.1, shape[0])
        before = layer.channels
        if layer.compared:
            found[f"lin{head}.model.1.weight"] = rng.uniform(0, 1, (1, shape[0], 1, 1))
            head += 1
    return {name: values.astype(np.float32) for name, values in found.items()}


def write_random_weights(folder: Path) -> None:
    """Write files like those of the authors: one each, with more in them than is needed."""
    folder.mkdir()
    for layers, trunk, heads in ((ALEX, "alexnet-owt", "alex"), (VGG, "vgg16-397923af", "vgg")):
        tensors = {name: torch.from_numpy(values) for name, values in random_weights(layers).items()}
        backbone = {name: x for name, x in tensors.items() if name.startswith("features")}
        torch.save(backbone | {"classifier.1.weight": torch.zeros(2, 2)}, folder / f"{trunk}.pth")
        rest = {name: x for name, x in tensors.items() if name.startswith("lin")}
        save_file(rest, folder / f"{heads}.safetensors")


def lpips() -> Pair:
    """Zhang et al. 2018, equation 1, with windows cut out one by one."""
    return _lpips(ALEX, "alex")


def lpips_vgg() -> Pair:
    """The same on VGG-16."""
    return _lpips(VGG, "vgg")


def _windows(x: np.ndarray, size: int, step: int) -> np.ndarray:
    return np.lib.stride_tricks.sliding_window_view(x, (size, size), (1, 2))[:, ::step, ::step]


def layer_errors(predicted: np.ndarray, true: np.ndarray, layers: Sequence[Layer]) -> list[np.ndarray]:
    """Error of two pictures after each layer that is compared, by random weights."""
    weights, features, found = random_weights(layers), [], []
    for image in (predicted, true):
        x = (2 * image - 1 - (-0.030, -0.088, -0.188)) / (0.458, 0.448, 0.450)
        features.append(x.transpose(2, 0, 1))
    for layer in layers:
        for j, x in enumerate(features):
            if layer.window:
                x = _windows(x, layer.window, 2).max(axis=(-1, -2))
            p = layer.padding
            seen = _windows(np.pad(x, ((0, 0), (p, p), (p, p))), layer.kernel, layer.stride)
            y = np.einsum("cyxij,ocij->oyx", seen, weights[f"features.{layer.place}.weight"])
            features[j] = np.maximum(y + weights[f"features.{layer.place}.bias"][:, None, None], 0)
        if layer.compared:
            a, b = (x / (np.sqrt((x**2).sum(axis=0)) + 1e-10) for x in features)
            by_channel = weights[f"lin{len(found)}.model.1.weight"].ravel()
            found.append(np.einsum("cyx,c->yx", (a - b) ** 2, by_channel))
    return found


def _lpips(layers: Sequence[Layer], net: Net) -> Pair:
    errors = layer_errors(PREDICTED, TRUE, layers)
    total = sum(np.mean(enlarged(error, TRUE.shape[0], TRUE.shape[1])) for error in errors)
    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch.dict(os.environ, {"GRAYCARD_LPIPS": f"{folder}/w"}),
    ):
        write_random_weights(Path(folder) / "w")
        return our_lpips(PREDICTED, TRUE, EVERYWHERE, net), float(total)


def random_inception() -> dict[str, torch.Tensor]:
    """Inception with two channels a convolution, at random; its blocks in the order of the network."""
    generator = torch.Generator().manual_seed(9)
    found: dict[str, torch.Tensor] = {}

    def add(name: str, channels: int, kernel: tuple[int, int] = (1, 1)) -> None:
        shape = (2, channels, *kernel)
        scale = (6 / np.prod(shape[1:])) ** 0.5
        found[f"{name}.weight"] = torch.randn(shape, generator=generator) * scale
        found[f"{name}.beta"] = torch.randn(2, generator=generator) * 0.3
        found[f"{name}.mean"], found[f"{name}.var"] = torch.zeros(2), torch.ones(2)

    def chain(prefix: str, channels: int, *kernels: tuple[int, int]) -> None:
        for number, kernel in enumerate(kernels):
            add(f"{prefix}.conv{f'_{number}' if number else ''}", 2 if number else channels, kernel)

    one, three, five, wide, high = (1, 1), (3, 3), (5, 5), (1, 7), (7, 1)
    for name, channels, kernel in (
        ("conv", 3, three), ("conv_1", 2, three), ("conv_2", 2, three), ("conv_3", 2, one),
        ("conv_4", 2, three),
    ):  # fmt: skip
        add(name, channels, kernel)
    channels = 2
    for block in ("mixed", "mixed_1", "mixed_2"):
        add(f"{block}.conv", channels)
        chain(f"{block}.tower", channels, one, five)
        chain(f"{block}.tower_1", channels, one, three, three)
        add(f"{block}.tower_2.conv", channels)
        channels = 8
    add("mixed_3.conv", channels, three)
    chain("mixed_3.tower", channels, one, three, three)
    channels = 4 + channels
    for block in ("mixed_4", "mixed_5", "mixed_6", "mixed_7"):
        add(f"{block}.conv", channels)
        chain(f"{block}.tower", channels, one, wide, high)
        chain(f"{block}.tower_1", channels, one, high, wide, high, wide)
        add(f"{block}.tower_2.conv", channels)
        channels = 8
    chain("mixed_8.tower", channels, one, three)
    chain("mixed_8.tower_1", channels, one, wide, high, three)
    channels = 4 + channels
    for block in ("mixed_9", "mixed_10"):
        add(f"{block}.conv", channels)
        add(f"{block}.tower_conv", channels)
        add(f"{block}.tower_mixed_conv", 2, (1, 3))
        add(f"{block}.tower_mixed_conv_1", 2, (3, 1))
        add(f"{block}.tower_1_conv", channels)
        add(f"{block}.tower_1_conv_1", 2, three)
        add(f"{block}.tower_1_mixed_conv", 2, (1, 3))
        add(f"{block}.tower_1_mixed_conv_1", 2, (3, 1))
        add(f"{block}.tower_2_conv", channels)
        channels = 12
    return found


def enlarged(image: np.ndarray, height: int, width: int) -> np.ndarray:
    """Bilinear between pixel centres, held at the borders."""
    rows, columns = (
        np.clip((np.arange(new) + 0.5) * old / new - 0.5, 0, old - 1)
        for new, old in zip((height, width), image.shape, strict=True)
    )
    return map_coordinates(image, np.meshgrid(rows, columns, indexing="ij"), order=1, mode="nearest")


def flip_hdr() -> Pair:
    metric = ge.find_metric("novel_view.flip_hdr")
    linear = srgb_decode(PREDICTED) * 0.4, srgb_decode(TRUE) * 0.4
    ours, _ = measure(metric, LayerComparison(*linear, EVERYWHERE, 1.25))
    maps = []
    for gain in (1.25, 10.0):
        p, t = (np.float32(srgb_encode(image * gain)) for image in linear)
        maps.append(flip_evaluator.evaluate(t, p, "LDR", applyMagma=False, computeMeanError=False)[0])
    return ours, float(np.max(maps, axis=0).mean())


def chart() -> Pair:
    colour, patches = colour_science(), RNG.uniform(0.05, 0.8, (24, 3))
    which = RNG.integers(0, 24, (50, 42))
    white = colour.XYZ_to_xy(REC709_TO_XYZ.sum(axis=1))
    ours = patch_difference(PREDICTED, patches[which], EVERYWHERE)
    read = np.array([PREDICTED[which == i].mean(axis=0) for i in range(24)])
    p, t = (colour.XYZ_to_Lab(c @ REC709_TO_XYZ.T, white) for c in (read, patches))
    return ours, float(colour.delta_E(p, t, method="CIE 2000").mean())


def pixel_measure(name: str, predicted: np.ndarray, true: np.ndarray) -> float:
    metric = ge.find_metric(name)
    value, _ = measure(metric, LayerComparison(predicted, true, EVERYWHERE, 1.0))
    return metric.rule.finish(value)


def share_of_normals() -> Pair:
    p, t = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in RNG.normal((0, 0, 3), 1, (2, 50, 42, 3)))
    ours = [pixel_measure(f"normal.within_{x}", p, t) for x in ("11_25", "22_5", "30")]
    cosines = np.einsum("ijc,ijc->ij", p, t)
    return np.array(ours), np.array(
        [100 * (cosines > np.cos(np.radians(x))).mean() for x in (11.25, 22.5, 30)]
    )


def plain_distances() -> Pair:
    p, t = RNG.uniform(1, 1.9, (2, 50, 42))
    names = (
        "depth.abs_rel",
        "depth.rmse",
        "f0.mae",
        "f0.rmse",
        "roughness.mae",
        "roughness.rmse",
        "metallic.mae",
        "metallic.rmse",
    )
    a, b, n = p.ravel(), t.ravel(), p.size
    mean, root = distance.cityblock(a, b) / n, distance.euclidean(a, b) / n**0.5
    expected = [distance.cityblock(a, b, w=1 / b) / n, root, mean, root, mean, root, mean, root]
    return np.array([pixel_measure(name, p, t) for name in names]), np.array(expected)


def within_ratio() -> Pair:
    p, t = np.exp(RNG.normal(0, 0.2, (2, 50, 42)))
    near = np.abs(np.log(p) - np.log(t)) < np.log(1.25)
    return pixel_measure("depth.within_1_25", p, t), 100 * near.mean()


def overlap_of_regions() -> Pair:
    p, t = RNG.random((2, 50, 42)) < 0.4
    return overlap(p, t), 1 - float(distance.jaccard(p.ravel(), t.ravel()))


def sums_of_parts() -> Pair:
    light = RNG.uniform(0, 1, (3, 4, 6, 5, 3))
    names = [(f"l{i}", part) for i in range(3) for part in PARTS]
    found = with_sums(
        {f"{part}.{n}": x for (n, part), x in zip(names, light.reshape(-1, 6, 5, 3), strict=True)}
    )
    ours = [found[part] for part in PARTS] + [found[f"radiance.l{i}"] for i in range(3)]
    ours += [found["diffuse"], found["specular"]]
    parts, lights = np.einsum("lpijc->pijc", light), np.einsum("lpijc->lijc", light)
    return np.array(ours), np.concatenate(
        [parts, lights, np.einsum("lbkijc->kijc", light.reshape(3, 2, 2, 6, 5, 3))]
    )


def gauged_intensity() -> Pair:
    p, t, gauge = RNG.uniform(0.5, 8, (3, 3)).tolist()
    lights = [PointLight("a", (0, 0, 0), tuple(x)) for x in (p, t)]
    stops = [abs(np.log2(18 / b) - np.log2(18 / (a * g))) for a, b, g in zip(p, t, gauge, strict=True)]
    return ge.intensity_error(lights[0], lights[1], tuple(gauge)), float(np.mean(stops))


def angle_of_light() -> Pair:
    axes, colors = RNG.normal(size=(2, 3)).tolist(), RNG.uniform(0.5, 9, (2, 3)).tolist()
    camera = Camera.from_fov(8, 8, 50, look_at(np.array([0.0, -3, 1]), np.zeros(3)))
    turned = (np.linalg.inv(camera.camera_to_world[:3, :3]) @ axes[0]).tolist()
    p = SpotLight("p", (0, 0, 0), tuple(turned), tuple(colors[0]), 20, 30, "camera")
    t = SpotLight("t", (0, 0, 0), tuple(axes[1]), tuple(colors[1]), 20, 30)
    ours = direction_error(p, t, [camera]), chromaticity_error(p, t)
    return np.array(ours), np.degrees(np.arccos([1 - distance.cosine(*axes), 1 - distance.cosine(*colors)]))


def size_of_light() -> Pair:
    u, v = RNG.normal(size=(2, 3))
    sides = [2 * np.linalg.norm(x) for x in (u, v, u - v)]
    half = sum(sides) / 2
    area = 2 * np.sqrt(half * np.prod([half - side for side in sides]))
    radius = np.sqrt(area / np.pi)
    flat = RectangleLight("r", (0, 0, 0), tuple(u.tolist()), tuple(v.tolist()), (1, 1, 1))
    ball = SphereLight("s", (0, 0, 0), 0.7, (1, 1, 1))
    return extent_error(ball, flat), float(100 * abs(radius - 0.7) / max(radius, 0.7))


def mirror_sphere() -> Pair:
    sky, height = RNG.uniform(0, 2, (12, 24, 3)), 12
    rows = np.r_[0, (np.arange(height) + 0.5) / height * np.pi, np.pi]
    columns = (np.arange(-1, 25) + 0.5) / 24 * 2 * np.pi
    padded = np.pad(np.pad(sky, ((0, 0), (1, 1), (0, 0)), mode="wrap"), ((1, 1), (0, 0), (0, 0)), mode="edge")
    n = sphere_normals()
    r = 2 * (n @ (0, -1, 0))[:, None] * n - (0, -1, 0)
    at = np.stack([np.arccos(r[:, 2]), np.arctan2(r[:, 1], r[:, 0]) % (2 * np.pi)], axis=-1)
    return render_spheres(sky)["mirror"], RegularGridInterpolator((rows, columns), padded)(at)


def smooth_sky() -> np.ndarray:
    """1 + x/2 + yz/3 of each direction: spherical harmonics of degrees 0, 1 and 2."""
    t, p = np.pi * (np.arange(128) + 0.5) / 128, np.pi * (np.arange(256) + 0.5) / 128
    t, p = np.meshgrid(t, p, indexing="ij")
    x, y, z = np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)
    return np.repeat((1 + x / 2 + y * z / 3)[..., None], 3, axis=-1)


def diffuse_sphere() -> Pair:
    x, y, z = sphere_normals().T
    return render_spheres(smooth_sky())["diffuse"][:, 0], 1 + x / 2 * (2 / 3) + y * z / 3 * (1 / 4)


def glossy_sphere() -> Pair:
    """Over facets h instead of directions of light: D G (h·v) / (n·v) dh, by Gauss and Legendre."""
    normals, glossy, v = (
        sphere_normals(),
        render_spheres(smooth_sky())["glossy"][:, 0],
        np.array([0.0, -1, 0]),
    )
    nodes, weights = np.polynomial.legendre.leggauss(300)
    tilt, turn = np.meshgrid((nodes + 1) * np.pi / 4, np.arange(400) * np.pi / 200, indexing="ij")
    solid_angle = (weights * np.pi / 4)[:, None] * np.sin(tilt) * np.pi / 200
    facets = ALPHA**2 / (np.pi * (np.cos(tilt) ** 2 * (ALPHA**2 - 1) + 1) ** 2)
    picked, other = np.linspace(150, len(normals) - 150, 6).astype(int), []
    for n in normals[picked]:
        side = np.linalg.svd(n[None])[2][1:]
        around = np.cos(turn)[..., None] * side[0] + np.sin(turn)[..., None] * side[1]
        h = np.cos(tilt)[..., None] * n + np.sin(tilt)[..., None] * around
        w = 2 * (h @ v)[..., None] * h - v
        lit = (w @ n > 0) & (h @ v > 0)
        cosine = np.where(lit, w @ n, 1)
        smith = 2 / sum(np.sqrt(1 + ALPHA**2 * (1 / c**2 - 1)) for c in (cosine, n @ v))
        sky = 1 + w[..., 0] / 2 + w[..., 1] * w[..., 2] / 3
        other.append((facets * smith * (h @ v) / (n @ v) * sky * solid_angle)[lit].sum())
    return glossy[picked], np.array(other)
