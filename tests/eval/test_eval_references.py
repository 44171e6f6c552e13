# SPDX-License-Identifier: Apache-2.0
"""Every metric against a second library or a closed form, as closely as one table says."""

import re
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from itertools import permutations
from pathlib import Path
from typing import Any

import flip_evaluator
import numpy as np
import pytest
from scipy.ndimage import convolve1d
from scipy.stats import theilslopes
from skimage.color import deltaE_ciede2000
from skimage.metrics import peak_signal_noise_ratio

import graycard.eval as ge
import layer_references
import statistics_references
from graycard import Camera, PointLight, View, look_at, srgb_encode
from graycard.eval.kinds._changed import ChangedPicture, judge_picture
from graycard.eval.measures._colour_difference import REC709_TO_XYZ
from graycard.eval.scoring._findings import SceneFacts
from graycard.eval.scoring._readings import TrueView
from graycard.eval.scoring._training import Fit, Training, fit_gauges
from layer_references import Pair, colour_science

RNG = np.random.default_rng(31)
TRUE = RNG.uniform(0.02, 0.95, (50, 42, 3))
PREDICTED = np.clip(TRUE * (1.1, 0.9, 1.0) + RNG.normal(0, 0.1, TRUE.shape), 0, 1)
EVERYWHERE = np.ones((50, 42), bool)
VIEW = View("v", "test", Camera.from_fov(42, 50, 50, look_at(np.array([0.0, -3, 1]), np.zeros(3))))
SHARMA = (
    ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
    ((50.0, 3.1571, -77.2803), (50.0, 0.0, -82.7485), 2.8615),
    ((50.0, 2.4900, -0.0010), (50.0, -2.4900, 0.0009), 7.1792),
    ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
)
"""Pairs 1, 2, 9, 17, 25 and 34 of the paper's test data: hue near blue, hues apart, dark."""


def psnr() -> Pair:
    ours = ge.psnr(ge.mean_square_error(PREDICTED, TRUE, EVERYWHERE))
    return ours, float(peak_signal_noise_ratio(TRUE, PREDICTED, data_range=1))


def ssim() -> Pair:
    bell = np.exp(-(np.arange(-5, 6) ** 2) / (2 * 1.5**2))

    def mean(x: np.ndarray) -> np.ndarray:
        return convolve1d(convolve1d(x, bell / bell.sum(), axis=0), bell / bell.sum(), axis=1)

    a, b, c1, c2 = PREDICTED, TRUE, 0.01**2, 0.03**2
    ma, mb = mean(a), mean(b)
    va, vb, cov = mean(a * a) - ma**2, mean(b * b) - mb**2, mean(a * b) - ma * mb
    found = (2 * ma * mb + c1) * (2 * cov + c2) / ((ma**2 + mb**2 + c1) * (va + vb + c2))
    return ge.ssim(PREDICTED, TRUE, EVERYWHERE), float(found[5:-5, 5:-5].mean())


def flip() -> Pair:
    images = np.float32(TRUE), np.float32(PREDICTED)
    _, mean, _ = flip_evaluator.evaluate(*images, "LDR", inputsRGB=True, applyMagma=False)
    return ge.flip(PREDICTED, TRUE, EVERYWHERE), float(mean)


def ciede2000() -> Pair:
    colour = colour_science()
    white = colour.XYZ_to_xy(REC709_TO_XYZ.sum(axis=1))
    p, t = (colour.XYZ_to_Lab(image @ REC709_TO_XYZ.T, white) for image in (PREDICTED, TRUE))
    return ge.ciede2000(PREDICTED, TRUE), colour.delta_E(p, t, method="CIE 2000")


def published_pairs() -> Pair:
    a, b, expected = (np.array(column) for column in zip(*SHARMA, strict=True))
    return deltaE_ciede2000(a, b), expected


def lmse() -> Pair:
    p, t = PREDICTED.mean(axis=-1), TRUE.mean(axis=-1)
    error = total = 0.0
    for i in range(0, 31, 10):
        for j in range(0, 23, 10):
            pw, tw = p[i : i + 20, j : j + 20].ravel(), t[i : i + 20, j : j + 20].ravel()
            error += np.linalg.lstsq(pw[:, None], tw)[1].item()
            total += tw @ tw
    return ge.lmse(PREDICTED, TRUE, EVERYWHERE), error / total


def angle() -> Pair:
    p, t = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in RNG.normal(size=(2, 300, 3)))
    chord = np.linalg.norm(p - t, axis=-1)
    return ge.angles(p, t), np.degrees(2 * np.arcsin(chord / 2))


def assignment() -> Pair:
    cameras = [Camera.from_fov(8, 8, 50, look_at(np.array([0.0, -3, 1]), np.zeros(3)))]
    ours, best = [], []
    for _ in range(20):
        places = RNG.normal(size=(2, 5, 3))
        p, t = ([PointLight("l", tuple(x), (1, 1, 1)) for x in side.tolist()] for side in places)
        cost = np.linalg.norm(places[0][:, None] - places[1][None], axis=-1)
        ours.append(sum(ge.match_lights(p, t, cameras).distances))
        best.append(min(cost[range(5), list(order)].sum() for order in permutations(range(5))))
    return np.array(ours), np.array(best)


def residual() -> Pair:
    inside = RNG.random((50, 42)) < 0.3
    effect, left = (image[inside].ravel() for image in (TRUE - PREDICTED, 0.4 * TRUE))
    ours = ge.residual_energy(PREDICTED + 0.4 * TRUE, PREDICTED, TRUE, inside)
    return ours, np.linalg.lstsq(effect[:, None], left)[0].item()


def leakage() -> Pair:
    """One pixel in five has any error at all, which moves a least squares fit and not a median."""
    light = RNG.normal(size=301)
    errors = np.where(RNG.random(301) < 0.2, RNG.normal(0, 5, 301) + 3 * light, 0.37 * light + 0.1)
    assert abs(np.polyfit(light, errors, 1)[0] - 0.37) > 0.1
    return ge.median_slope(errors, light, *ge.partners(light)), float(
        np.asarray(theilslopes(errors, light))[0]
    )


def local_variance() -> Pair:
    mask = RNG.random((50, 42)) < 0.7
    expected = np.zeros_like(TRUE)
    for i, j in np.argwhere(mask):
        window = slice(max(i - 2, 0), i + 3), slice(max(j - 2, 0), j + 3)
        expected[i, j] = TRUE[window][mask[window]].mean(axis=0)
    return ge.local_variance(TRUE, mask), expected


def error_over_noise() -> Pair:
    offsets, sigma = RNG.uniform(0, 4, 3), 0.01
    layers = {"radiance": TRUE, "radiance.var": np.full_like(TRUE, sigma**2), "object_id": EVERYWHERE * 1}
    rule = ge.find_metric("novel_view.noise_rms").rule
    noisy = rule.prepare(TrueView(VIEW, layers, frozenset()), 1.0)
    return rule.compute(TRUE + offsets * sigma, noisy).value, float(np.sqrt(np.mean(offsets**2)))


def relit() -> Pair:
    p, t = PREDICTED.reshape(-1, 3), TRUE.reshape(-1, 3)
    factors = np.array([np.linalg.lstsq(p[:, [c]], t[:, c])[0].item() for c in range(3)])
    fit = Fit((ge.moments(PREDICTED, TRUE, EVERYWHERE),))
    training = Training(frozenset({"base_color"}), (), {"base_color": fit})
    light, dark = PREDICTED[::-1], TRUE[::-1]
    picture = ChangedPicture("e", "off", VIEW, {"radiance": dark}, lambda: {"radiance": light}, EVERYWHERE)
    scene = SceneFacts(0.8, training, fit_gauges(training))
    found = judge_picture([ge.find_metric("relighting.psnr")], picture, scene)["relighting.psnr"].value
    shown = srgb_encode(dark * 0.8), srgb_encode(light * factors * 0.8)
    return ge.psnr(found or 0), float(peak_signal_noise_ratio(*shown, data_range=1))


def gauge() -> Pair:
    found = ge.fit_gauge([ge.moments(PREDICTED, TRUE, EVERYWHERE)], "channel")
    p, t = PREDICTED.reshape(-1, 3), TRUE.reshape(-1, 3)
    return np.array(found), np.array([np.linalg.lstsq(p[:, [c]], t[:, c])[0].item() for c in range(3)])


def encoding() -> Pair:
    x = np.linspace(0, 1, 1001)
    return srgb_encode(x), colour_science().models.eotf_inverse_sRGB(x)


COMPUTED: dict[str, Callable[[], Pair]] = {
    "PSNR": psnr,
    "SSIM": ssim,
    "FLIP": flip,
    "CIEDE2000": ciede2000,
    "CIEDE2000, published pairs": published_pairs,
    "LMSE": lmse,
    "angle between normals": angle,
    "assignment of lights": assignment,
    "residual energy": residual,
    "leakage slope": leakage,
    "local variance": local_variance,
    "error over noise": error_over_noise,
    "relit PSNR": relit,
    "gauge": gauge,
    "display encoding": encoding,
    "HDR-FLIP": layer_references.flip_hdr,
    "colour chart": layer_references.chart,
    "share of normals": layer_references.share_of_normals,
    "depth and materials": layer_references.plain_distances,
    "depth within a ratio": layer_references.within_ratio,
    "overlap of glossy regions": layer_references.overlap_of_regions,
    "sums of parts": layer_references.sums_of_parts,
    "gauged intensity": layer_references.gauged_intensity,
    "direction and colour of light": layer_references.angle_of_light,
    "size of light": layer_references.size_of_light,
    "mirror sphere": layer_references.mirror_sphere,
    "diffuse sphere": layer_references.diffuse_sphere,
    "glossy sphere": layer_references.glossy_sphere,
    "signed-rank test, exact": statistics_references.signed_rank,
    "signed-rank test with ties": statistics_references.signed_rank_with_ties,
    "bootstrap-t interval": statistics_references.bootstrap_t,
    "test of the mean": statistics_references.test_of_mean,
    "LPIPS": layer_references.lpips,
    "LPIPS, VGG-16": layer_references.lpips_vgg,
}


def computed(tests: Path = Path(__file__).parent) -> dict[str, Callable[[], Pair]]:
    """All computations: a metric's own test file adds to them by a ``COMPUTED`` of its own."""
    found = dict(COMPUTED)
    for path in sorted(tests.glob("test_*.py")):
        if path.name != Path(__file__).name and re.search(
            r"^COMPUTED\b", path.read_text("utf-8"), re.MULTILINE
        ):
            spec = spec_from_file_location(f"references_of_{path.stem}", path)
            assert spec is not None
            assert spec.loader is not None
            module = module_from_spec(spec)
            spec.loader.exec_module(module)
            found |= module.COMPUTED
    return found


LONG = {"bootstrap-t interval", "test of the mean"}
"""References that take more than ten seconds."""


@pytest.mark.parametrize(
    "reference",
    [pytest.param(r, id=r.name, marks=pytest.mark.slow if r.name in LONG else ()) for r in ge.references()],
)
def test_a_metric_agrees_with_its_reference(reference: ge.Reference) -> None:
    ours, other = computed()[reference.name]()
    assert np.abs(np.asarray(ours) - np.asarray(other)).max() <= reference.tolerance
    assert np.abs(np.asarray(other)).max() > 100 * reference.tolerance, "something to disagree about"


def test_the_table_is_whole() -> None:
    assert {r.name for r in ge.references()} == set(computed())
    assert len({r.name for r in ge.references()}) == len(ge.references())
    assert all(r.tolerance <= 1e-6 or "digits" in r.against for r in ge.references())


@pytest.mark.parametrize("metric", ge.registry(), ids=lambda m: m.id)
def test_every_metric_has_a_reference(metric: ge.Metric[Any]) -> None:
    assert metric.references


def test_another_test_file_may_compute_a_reference(tmp_path: Path) -> None:
    (tmp_path / "test_new.py").write_text('COMPUTED = {"new": lambda: (1.0, 1.0)}\n')
    (tmp_path / "test_other.py").write_text("NOTHING = {}\n")
    assert set(computed(tmp_path)) == {*COMPUTED, "new"}
