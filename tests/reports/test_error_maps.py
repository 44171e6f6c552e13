# SPDX-License-Identifier: Apache-2.0
"""Maps of errors that a page computes: the numbers of the metrics, and what a reader sees meanwhile."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page
from scipy.ndimage import binary_erosion
from skimage.metrics import structural_similarity

from graycard import srgb_encode
from graycard.eval.measures._depth import depth_errors, relative_depth_errors
from report_pages import CHROMIUM, SCENE, open_report

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")

SHARE = {"truth": {"picture": {"code": "share"}}, "unit": "1", "error_scale": {"unit": "linear difference"}}
LIGHT = {
    "truth": {"picture": {"code": "light"}},
    "unit": "as displayed",
    "error_scale": {"unit": "display difference"},
}
DEPTH = {"truth": {"picture": {"code": "number"}}, "unit": "m", "error_scale": {"unit": "m"}}
MAP = """([name, layer, ...planes]) => {
  const [p, t] = planes.map((channels) => (
    { width: 26, height: 20, channels: channels.map((values) => Float64Array.from(values)) }));
  return [...MEASURES[name].map(p, t, layer, Uint8Array.from(planes[2][0]))];
}"""
MEANS = """async ([name, layer, ...planes]) => {
  const drawn = ([values]) => ({ width: 26, height: 20, read: (x, y) => [values[y * 26 + x]] });
  const [p, t, judged] = planes.map((plane) => ({ plane }));
  const own = { ...layer, title: "Depth", predictions: [{ picture: p }], errors: [{ picture: judged }] };
  own.truth = { picture: { ...layer.truth.picture, ...t } };
  const maps = await computeMaps([{ rows: [own] }], "Depth", MEASURES[name], async (one) => drawn(one.plane));
  return [maps.means.get("0 0"), maps.drawn.get("0 0").read(3, 0)[0]];
}"""
"""The mean of a map, and its value in row 0, column 3."""
OTHER = """async ([id, damaged]) => {
  const { pictures } = JSON.parse(await inflate(await island('kept', id)));
  const root = document.createElement('div');
  document.querySelector('main').append(root);
  const blobs = { ...await blobsOf(id) };
  const last = pictures.gallery.views.at(-1).rows.find((row) => row.layer === 'base_color');
  if (damaged) blobs[last.predictions.find((tile) => tile.picture).picture.webp] = btoa('no picture');
  window.other = new Viewer(root, pictures.gallery, pictures.methods, blobs, 'truth');
  other.layer = other.layers.findIndex((row) => row.layer === 'base_color');
  other.arrange();
}"""
CHOOSE = """(name) => {
  const select = other.root.querySelector('select.measure');
  select.value = name;
  select.dispatchEvent(new Event('change'));
  select.options[0].dataset.mine = '1';
  other.root.querySelector('.tiles figure[data-row] button').focus();
}"""
UNTOUCHED = """() => other.root.querySelector('select.measure').options[0].dataset.mine === '1'
  && document.activeElement.closest('.tiles figure[data-row]') !== null"""
END = "() => other.root.querySelector('.of-errors .high').textContent"
WAIT = """async () => {
  while ([...other.maps.values()].includes(undefined)) await new Promise((next) => { setTimeout(next, 5); });
}"""
SMALL = """([values, mean]) => {
  const { width, height } = other.shown.truth.picture;
  other.measure = 'squares';
  const own = other.shown.predictions.findIndex((tile) => tile.picture);
  const drawn = drawMap(new Float64Array(width * height).fill(values), width, height, 0.00008);
  other.maps.set(other.mapsKey, {
    high: 0.00008, means: new Map([[`0 ${own}`, mean]]), drawn: new Map([[`0 ${own}`, drawn]]),
  });
  other.right = own;
  other.arrange();
  other.moveTo(3, 2);
  other.tell();
  return [other.errorEnd(), other.errorNote(own), other.errorText(own)];
}"""


@pytest.fixture
def page(browser: Browser, report_path: Path, heard: list[str]) -> Iterator[Page]:
    found = open_report(browser, report_path, heard, SCENE)
    yield found
    found.close()


@pytest.fixture
def images() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a predicted image, a true one and a mask; a few values are above 1."""
    noise = np.random.default_rng(5)
    true = noise.uniform(0.02, 1.1, (20, 26, 3))
    found = np.clip(true + 0.2 * noise.normal(size=true.shape), 0, 1.3)
    inside = np.ones(true.shape[:2], bool)
    inside[:6, :9] = False
    return found, true, inside


def planes(image: np.ndarray) -> list[list[float]]:
    """Return the channels of an image, row by row."""
    return [channel.ravel().tolist() for channel in np.moveaxis(np.atleast_3d(image), -1, 0)]


def map_of(page: Page, name: str, layer: dict[str, Any], images: tuple[np.ndarray, ...]) -> np.ndarray:
    given = [name, layer, *(planes(image) for image in images)]
    return np.array(page.evaluate(MAP, given), float).reshape(images[2].shape)


@pytest.mark.parametrize("layer", [SHARE, LIGHT], ids=["share", "light"])
def test_similarity_is_that_of_display_values(
    page: Page, heard: list[str], images: tuple[np.ndarray, ...], layer: dict[str, Any]
) -> None:
    found, true, inside = images
    similarity = map_of(page, "ssim", layer, images)
    shown, exact = (srgb_encode(image) for image in (np.where(inside[..., None], found, true), true))
    similar = structural_similarity(
        exact, shown, data_range=1, channel_axis=-1, gaussian_weights=True, sigma=1.5,
        use_sample_covariance=False, full=True,
    )[1].mean(axis=-1)  # fmt: skip
    whole = ~np.isnan(similarity)
    assert np.array_equal(whole, binary_erosion(inside, np.ones((11, 11))))
    assert np.allclose(similarity[whole], 1 - similar[whole], atol=1e-9)
    assert heard == []


def test_squares_of_light_are_as_displayed_and_others_linear(
    page: Page, heard: list[str], images: tuple[np.ndarray, ...]
) -> None:
    found, true, _ = images
    shown, exact = srgb_encode(found), srgb_encode(true)
    light, share = (map_of(page, "squares", layer, images) for layer in (LIGHT, SHARE))
    relative = map_of(page, "relative", SHARE, images)
    assert np.allclose(light, ((shown - exact) ** 2).mean(axis=-1))
    assert np.allclose(share, ((found - true) ** 2).mean(axis=-1))
    assert np.allclose(relative, (100 * np.abs(found - true) / true).mean(axis=-1))
    assert not np.allclose(light, share)
    assert heard == []


def test_a_hole_and_a_far_pixel_of_depth_count_as_in_the_metric(page: Page, heard: list[str]) -> None:
    """A page has no number where nothing is predicted; the metric takes the true depth as the error."""
    noise = np.random.default_rng(6)
    true = noise.uniform(1, 4, (20, 26))
    found = true + noise.normal(size=true.shape)
    found[0, 3], found[1, 4], found[2, 5] = np.inf, 9 * true[1, 4], 0.0
    mask = np.ones(true.shape, bool)
    mask[5:, :7] = False
    coded = np.where(np.isinf(found), np.nan, found), true, np.where(mask, 0.1, np.nan)
    for name, errors in (
        ("squares", depth_errors(found, true, mask) ** 2),
        ("relative", 100 * relative_depth_errors(found, true, mask)),
    ):
        assert np.allclose(map_of(page, name, DEPTH, coded)[mask], errors)
        mean, hole = page.evaluate(MEANS, [name, DEPTH, *(planes(image) for image in coded)])
        assert mean == pytest.approx(errors.mean())
        assert hole == pytest.approx({"squares": true[0, 3] ** 2, "relative": 100}[name])
    assert heard == []


def test_small_errors_are_numbers_and_not_zero(page: Page, heard: list[str]) -> None:
    """A row above 43 dB has squared errors below 5e-5."""
    noise = np.random.default_rng(7).normal(size=5000)
    mean = float(((0.004 * noise) ** 2).mean())
    assert -10 * np.log10(mean) > 43
    page.evaluate(OTHER, [SCENE, False])
    end, note, read = page.evaluate(SMALL, [3.2e-7, mean])
    assert end.startswith("≥ 8e−5 ")
    assert float(note.partition(",")[0].removeprefix("mean ").replace("−", "-")) == pytest.approx(
        mean, rel=0.05
    )
    assert read == "3.2e−7"
    told = {0: "0", 1e-17: "0", -2.5e-4: "−2.5e−4", 0.00123: "0.0012", 0.5: "0.500", 123.4: "123"}
    assert [page.evaluate("mapNumber", value) for value in told] == list(told.values())
    assert page.evaluate("mapNumber(NaN)") == "none"
    assert heard == []


@pytest.mark.parametrize("chosen", [["relative"], ["relative", "error"], ["relative", "squares"]])
def test_a_map_that_arrives_leaves_what_a_reader_has_in_focus(
    page: Page, heard: list[str], chosen: list[str]
) -> None:
    page.evaluate(OTHER, [SCENE, False])
    page.evaluate(f"(names) => names.forEach({CHOOSE})", chosen)
    page.evaluate(WAIT)
    assert page.evaluate(UNTOUCHED)
    notes = page.locator(".tiles figure[data-row] .note").all_text_contents()
    if chosen[-1] == "error":
        assert not [note for note in notes if "mean " in note]
        assert page.evaluate(END).endswith(" linear difference")
    else:
        assert len([note for note in notes if "mean " in note]) == 3
        assert page.evaluate(END).startswith("≥ ")
    assert heard == []


def test_a_picture_that_cannot_be_read_says_so(page: Page, heard: list[str]) -> None:
    page.evaluate(OTHER, [SCENE, True])
    page.evaluate(CHOOSE, "relative")
    page.evaluate(WAIT)
    assert page.evaluate(END) == "could not be computed"
    assert page.evaluate(UNTOUCHED)
    assert {"decoded" in message for message in heard} == {True}
