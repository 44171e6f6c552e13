# SPDX-License-Identifier: Apache-2.0
import base64
import io
import math
import re

import numpy as np
import pytest
from PIL import Image
from skimage.color import rgb2lab

from graycard import srgb_encode
from graycard.layers import shape_of
from graycard.reports.pictures._colour_maps import STEPS, ColourMap, colour_map, to_index
from graycard.reports.pictures._error_images import error_image, error_unit, noise_ratio_image, shared_scale
from graycard.reports.pictures._pictures import (
    KNEE,
    LEVELS,
    NUMBERS,
    PEAK,
    STEP,
    PagePicture,
    coloured_picture,
    direction_picture,
    gradient,
    light_picture,
    linear_codes,
    map_picture,
    number_picture,
    seen_picture,
    share_picture,
    shrink,
    sketch_picture,
    split_codes,
)

RNG = np.random.default_rng(3)


def pixels_of(picture: PagePicture) -> np.ndarray:
    image = Image.open(io.BytesIO(base64.b64decode(picture.webp)))
    assert (image.format, image.mode) == ("WEBP", "RGB")
    return np.asarray(image)


def decode_linear(pixels: np.ndarray) -> np.ndarray:
    """The inverse of the codes, written anew from their definition."""
    high, low = np.split(pixels.astype(np.float64), 2)
    return KNEE * np.expm1((256 * high + low) * STEP)


@pytest.mark.parametrize("scale", [1e-3, 0.1, 1.0, 100.0])
def test_linear_light_survives_the_file(scale: float) -> None:
    light = scale * RNG.random((9, 7, 3))
    picture = light_picture(light, "x")
    assert (picture.width, picture.height, picture.code) == (7, 9, "light")
    back = decode_linear(pixels_of(picture))
    np.testing.assert_allclose(back, light, rtol=0.502 * STEP, atol=0.51 * STEP * KNEE)


def test_linear_light_is_exact_to_less_than_a_display_step() -> None:
    light = np.linspace(0, 1, 5001)[:, None, None].repeat(3, axis=2)
    back = decode_linear(split_codes(linear_codes(light)))
    assert 255 * np.abs(srgb_encode(back) - srgb_encode(light)).max() < 0.7


def test_codes_of_the_ends() -> None:
    codes = linear_codes(np.array([-1.0, 0.0, PEAK, 10 * PEAK]))
    assert codes.tolist() == [0, 0, LEVELS - 1, LEVELS - 1]
    assert LEVELS <= 2**16


def test_light_is_seen_as_a_display_shows_it() -> None:
    light = np.array([[[0.0, 0.5, 2.0], [0.2, 0.2, 0.2]]])
    seen = seen_picture(light_picture(light, "two pixels"))
    assert np.abs(pixels_of(seen) - 255 * srgb_encode(light)).max() <= 1.1
    assert (seen.width, seen.height, seen.alt, seen.code) == (2, 1, "two pixels", "sketch")


def test_shares_and_directions_are_clipped_to_what_they_can_be() -> None:
    values = np.array([[[-1.0, 0.5, 3.0]]])
    assert pixels_of(share_picture(values, "")).tolist() == [[[0, 188, 255]]]
    assert pixels_of(direction_picture(values, "")).tolist() == [[[0, 191, 255]]]
    assert pixels_of(sketch_picture(values, "")).tolist() == [[[0, 128, 255]]]


def test_numbers_are_read_back_to_16_bits() -> None:
    values = np.array([[2.0, 2.7182818, 5.0, 9.0, np.nan]])
    picture = number_picture(values, 2.0, 5.0, "")
    codes = pixels_of(picture)[0].astype(int) @ (256, 1, 0)
    assert codes[[0, 2, 3, 4]].tolist() == [0, NUMBERS - 1, NUMBERS - 1, NUMBERS]
    assert 2 + codes[1] / (NUMBERS - 1) * 3 == pytest.approx(2.7182818, abs=3 / NUMBERS)
    seen = pixels_of(seen_picture(picture))[0]
    assert seen[[0, 2, 4]].tolist() == [*colour_map("depth")[[0, 254]].tolist(), [128, 128, 128]]


def test_map_of_errors_has_steps_and_a_place_for_nothing() -> None:
    picture = map_picture(np.array([[0.0, 5.0, 10.0, 30.0, math.nan]]), 10, "")
    assert pixels_of(picture)[0, :, 0].tolist() == [0, 127, 254, 254, 255]
    assert (picture.low, picture.high) == (0, 10)
    seen = pixels_of(seen_picture(picture))[0]
    table = colour_map("error")
    assert seen.tolist() == [*table[[0, 127, 254, 254]].tolist(), [128, 128, 128]]
    shown = pixels_of(coloured_picture(np.array([[0.0, 10.0, math.nan]]), 0, 10, "error", ""))[0]
    assert shown.tolist() == [*table[[0, 254]].tolist(), [128, 128, 128]]


def test_gradient_has_the_colours_of_the_pictures() -> None:
    table = colour_map("error")
    stops = re.findall(r"#([0-9a-f]{6})", gradient("error"))
    ends = [tuple(bytes.fromhex(stop)) for stop in (stops[0], stops[-1])]
    assert ends == [tuple(table[0]), tuple(table[-1])]
    assert len(stops) == 17


@pytest.mark.parametrize("name", ["error", "depth"])
def test_colour_map_is_perceptually_uniform(name: ColourMap) -> None:
    table = colour_map(name)
    lab = rgb2lab(table[None] / 255)[0]
    steps = np.linalg.norm(lab[8:] - lab[:-8], axis=-1)  # eight at once: single ones drown in rounding
    assert table.shape == (STEPS, 3)
    assert (lab[8:, 0] > lab[:-8, 0]).all()
    assert np.median(steps) * 0.75 < steps.min()
    assert steps.max() < np.median(steps) * 1.25


def test_a_flat_range_does_not_divide_by_zero() -> None:
    assert to_index(np.array([3.0, 3.0]), 3.0, 3.0).tolist() == [0, 0]


def test_shrink_is_the_mean_of_whole_blocks() -> None:
    image = RNG.random((10, 7, 3))
    small = shrink(image, 5)
    assert small.shape == (5, 3, 3)
    np.testing.assert_allclose(small[1, 2], image[2:4, 4:6].mean(axis=(0, 1)))
    assert shrink(image, 10) is image
    assert shrink(np.ones((40, 2)), 10).tolist() == np.ones((10, 1)).tolist()


def test_errors_by_layer() -> None:
    mask = np.array([[True, False]])
    p, t = np.full((1, 2, 3), 0.5), np.full((1, 2, 3), 0.25)
    base = error_image("base_color", p, t, mask, 8.0)
    assert base[0, 0] == 0.25
    assert np.isnan(base[0, 1])
    light = error_image("radiance", p, t, mask, 2.0)
    assert light[0, 0] == pytest.approx(1 - float(srgb_encode(np.array(0.5))))
    depth = error_image("depth", np.array([[3.0, 1.0]]), np.array([[2.5, 1.0]]), mask, 1.0)
    assert depth[0, 0] == 0.5
    units = [error_unit(n) for n in ("radiance", "counterfactual.radiance", "base_color", "normal", "depth")]
    assert units == ["display difference", "display difference", "linear difference", "degrees", "m"]


def test_two_infinite_depths_agree_and_one_does_not() -> None:
    here = np.ones((1, 3), bool)
    p, t = np.array([[np.inf, np.inf, 1.0]]), np.array([[np.inf, 1.0, np.inf]])
    assert error_image("depth", p, t, here, 1.0).tolist() == [[0.0, np.inf, np.inf]]


@pytest.mark.parametrize(("top", "scale"), [(0.027, 0.03), (1.0, 1.0), (1.2, 1.5), (91.0, 100.0), (0.0, 1.0)])
def test_scale_is_the_next_round_number(top: float, scale: float) -> None:
    assert shared_scale([np.array([[0.0, np.nan, top]])]) == scale
    assert shared_scale([]) == 1.0


def test_error_of_noise_alone_is_one_standard_deviation() -> None:
    true, sigma = RNG.random((60, 60, 3)), 0.1 + RNG.random((60, 60, 3))
    mask = np.ones((60, 60), bool)
    mask[0] = False
    ratio = noise_ratio_image(true + sigma * RNG.normal(size=true.shape), true, sigma**2, mask)
    assert np.isnan(ratio[0]).all()
    squares = ratio[mask] ** 2  # each a mean of three: the mean of all has a deviation of sqrt(2 / 3 / 3540)
    assert squares.mean() == pytest.approx(1, abs=4 * math.sqrt(2 / 3 / squares.size))
    np.testing.assert_allclose(noise_ratio_image(true + 2 * sigma, true, sigma**2, mask)[mask], 2)


def test_without_noise_an_equal_value_is_right_and_another_wrong() -> None:
    true = np.array([[0.0, 0.0, 0.5, 0.5]], np.float32)
    found = noise_ratio_image(np.array([[0.0, 0.1, 0.5, 0.6]]), true, np.zeros((1, 4)), np.ones((1, 4), bool))
    assert found[0, [0, 2]].tolist() == [0, 0]
    assert (found[0, [1, 3]] > 1e3).all()


@pytest.mark.parametrize(
    ("layer", "unit"),
    [("roughness", "linear difference"), ("shading", "display difference"), ("position", "m"),
     ("irradiance.lamp", "display difference"), ("albedo", "linear difference")],
)  # fmt: skip
def test_every_layer_has_an_error(layer: str, unit: str) -> None:
    shape = shape_of(layer, 4, 5)
    error = error_image(layer, np.full(shape, 0.5), np.full(shape, 0.25), np.ones((4, 5), bool), 1.0)
    step = float(srgb_encode(np.array(0.5)) - srgb_encode(np.array(0.25)))
    assert error_unit(layer) == unit
    np.testing.assert_allclose(error, step if unit.startswith("display") else 0.25)
