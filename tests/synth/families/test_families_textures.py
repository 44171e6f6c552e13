# SPDX-License-Identifier: Apache-2.0
"""Textures: within the range of reflectances, without seams, repeatable, with detail at each scale."""

from collections.abc import Callable

import numpy as np
import pytest

from graycard.synth.families.props import _textures as textures

RED, GRAY = (0.5, 0.1, 0.1), (0.4, 0.4, 0.4)
MAKERS: dict[str, Callable[[np.random.Generator], np.ndarray]] = {
    "plaster": lambda rng: textures.plaster(rng, RED),
    "stone": lambda rng: textures.stone(rng, [RED, GRAY, (0.6, 0.6, 0.5)]),
    "marble": lambda rng: textures.marble(rng, GRAY, RED),
    "brushed": lambda rng: textures.brushed(rng, GRAY),
    "linen": lambda rng: textures.linen(rng, RED, GRAY),
    "wood": lambda rng: textures.wood(rng, RED),
    "boards": lambda rng: textures.boards(rng, RED),
    "bricks": lambda rng: textures.bricks(rng, RED),
    "tiles": lambda rng: textures.tiles(rng, [RED, GRAY]),
    "bands": lambda rng: textures.bands(rng, RED, [GRAY, (0.1, 0.1, 0.4)]),
    "cardboard": lambda rng: textures.cardboard(rng, RED),
}


def make(name: str, seed: int = 1) -> np.ndarray:
    return MAKERS[name](np.random.default_rng(seed))


@pytest.mark.parametrize("name", MAKERS)
def test_reflectances_are_in_range(name: str) -> None:
    image = make(name)
    assert image.shape == (textures.SIZE, textures.SIZE, 3)
    assert image.min() >= textures.DARKEST
    assert image.max() <= textures.BRIGHTEST


@pytest.mark.parametrize("name", MAKERS)
def test_the_seed_decides(name: str) -> None:
    assert np.array_equal(make(name), make(name))
    assert not np.allclose(make(name), make(name, 2))


@pytest.mark.parametrize("name", [n for n in MAKERS if n not in ("bands", "cardboard")])
@pytest.mark.parametrize("axis", [0, 1])
def test_there_is_no_seam(name: str, axis: int) -> None:
    image = make(name)
    steps = np.abs(np.diff(np.concatenate([image, image.take([0], axis)], axis), axis=axis))
    typical = np.sort(steps.mean(axis=(1 - axis, 2)))
    # joints of boards, bricks and tiles are steps that occur inside as well
    assert steps.take(-1, axis).mean() <= 1.5 * typical[-4]


def test_noise_is_standard_and_falls_as_it_should() -> None:
    noise = textures.fractal_noise(np.random.default_rng(0), size=256, slope=1.5)
    assert noise.mean() == pytest.approx(0, abs=1e-12)
    assert noise.std() == pytest.approx(1)
    amplitude = np.abs(np.fft.fft2(noise))
    f = np.hypot(*np.meshgrid(*[np.fft.fftfreq(256) * 256] * 2))
    low, high = (amplitude[(f > k) & (f < 1.3 * k)].mean() for k in (10, 80))
    assert np.log(high / low) / np.log(8) == pytest.approx(-1.5, abs=0.1)


def test_stretched_noise_is_longer_along_u() -> None:
    noise = textures.fractal_noise(np.random.default_rng(0), stretch=12.0)
    along_v, along_u = (np.abs(np.diff(noise, axis=k)).mean() for k in (0, 1))
    assert along_u < 0.3 * along_v


def test_the_chart_holds_its_patches_upright() -> None:
    patches = {f"p{k}": (0.01 * k, 0.2, 0.3) for k in range(24)}
    image = textures.chart(patches, 6)
    assert image.shape == (4 * 32, 6 * 32, 3)
    for k in range(24):
        row, column = divmod(k, 6)
        np.testing.assert_allclose(image[32 * row + 16, 32 * column + 16], patches[f"p{k}"])
    np.testing.assert_allclose(image[0], 0.03)
