# SPDX-License-Identifier: Apache-2.0
"""The gauge: what it may change, what it may not, and against an independent least squares."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import graycard.eval as ge
from graycard import PredictionError
from graycard.eval.scoring._gauge import Kind

RNG = np.random.default_rng(8)
TRUE = RNG.uniform(0.05, 0.9, (2, 12, 14, 3))
PREDICTED = TRUE * (1.3, 0.8, 1.1) + RNG.normal(0, 0.05, TRUE.shape)
MASKS = RNG.random((2, 12, 14)) < 0.7
GAINS = st.tuples(*[st.floats(0.05, 20)] * 3)


def fit(predicted: np.ndarray, kind: Kind) -> tuple[float, ...]:
    return ge.fit_gauge([ge.moments(p, t, m) for p, t, m in zip(predicted, TRUE, MASKS, strict=True)], kind)


def score(predicted: np.ndarray, kind: Kind) -> float:
    shown = ge.apply_gauge(predicted, fit(predicted, kind))
    pairs = zip(shown, TRUE, MASKS, strict=True)
    return ge.psnr(float(np.mean([ge.mean_square_error(p, t, m) for p, t, m in pairs])))


def test_it_is_the_least_squares_solution() -> None:
    p, t = PREDICTED[MASKS], TRUE[MASKS]
    per_channel = [np.linalg.lstsq(p[:, [c]], t[:, c])[0].item() for c in range(3)]
    assert fit(PREDICTED, "channel") == pytest.approx(per_channel, rel=1e-12)
    single = np.linalg.lstsq(p.reshape(-1, 1), t.ravel())[0].item()
    assert fit(PREDICTED, "scalar") == pytest.approx([single] * 3, rel=1e-12)
    assert fit(PREDICTED, "raw") == (1, 1, 1)


@settings(max_examples=40)
@given(GAINS)
def test_per_channel_gains_move_raw_and_not_the_channel_score(gains: tuple[float, float, float]) -> None:
    assert score(PREDICTED * gains, "channel") == pytest.approx(score(PREDICTED, "channel"), abs=1e-6)


@settings(max_examples=40)
@given(st.floats(0.05, 20))
def test_one_gain_does_not_move_the_scalar_score(gain: float) -> None:
    assert score(PREDICTED * gain, "scalar") == pytest.approx(score(PREDICTED, "scalar"), abs=1e-6)


def test_what_each_protocol_does_not_forgive() -> None:
    tinted = PREDICTED * (1.7, 0.6, 1.1)
    assert abs(score(tinted, "raw") - score(PREDICTED, "raw")) > 1
    assert abs(score(tinted, "scalar") - score(PREDICTED, "scalar")) > 1
    assert score(tinted, "channel") > score(tinted, "scalar") > score(tinted, "raw")


def test_pixels_outside_the_mask_do_not_enter() -> None:
    changed = np.where(MASKS[..., None], PREDICTED, 100.0)
    assert fit(changed, "channel") == fit(PREDICTED, "channel")


def test_a_channel_in_which_the_truth_is_black_leaves_nothing_to_fit() -> None:
    true = TRUE[0] * (1, 0, 1)
    found = ge.fit_gauge([ge.moments(true, true, MASKS[0])], "channel")
    assert found == pytest.approx((1, 1, 1))


@pytest.mark.parametrize(("values", "what"), [(0.0, "black in"), (-1.0, "not positive in")])
def test_a_prediction_that_no_gauge_can_mend(values: float, what: str) -> None:
    predicted = PREDICTED.copy()
    predicted[..., 1] = values
    with pytest.raises(PredictionError, match=f"{what} channel G wherever an object is seen"):
        fit(predicted, "channel")
    assert fit(predicted, "raw") == (1, 1, 1)


def test_apply_gauge_keeps_the_input() -> None:
    image = np.full((2, 2, 3), 2, np.float32)
    assert ge.apply_gauge(image, (0.5, 1, 2))[1, 1].tolist() == [1, 2, 4]
    assert (image == 2).all()


def test_one_prediction_has_many_scores_and_the_rules_decide() -> None:
    """The same albedo, a tenth of the image: why a number without its protocol says nothing."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:60, :60] / 59
    mask = np.hypot(x - 0.5, y - 0.5) < np.sqrt(0.1 / np.pi)
    true = rng.uniform(0.1, 0.9, (6, 6, 3)).repeat(10, 0).repeat(10, 1)
    shading = (1 + 0.25 * np.sin(5 * x) * np.cos(4 * y))[..., None]
    predicted = true * (1.35, 1.0, 0.7) * shading + rng.normal(0, 0.01, true.shape)
    seen = [ge.moments(predicted, true, mask)]
    kinds: tuple[Kind, ...] = ("raw", "scalar", "channel")
    fitted = [ge.apply_gauge(predicted, ge.fit_gauge(seen, k)) for k in kinds]
    raw, scalar, channel = (ge.psnr(ge.mean_square_error(f, true, mask)) for f in fitted)
    multiplied = ge.psnr(float(np.mean(((fitted[2] - true) * mask[..., None]) ** 2)))
    assert raw < scalar < channel < multiplied
    assert channel - raw > 3
    assert multiplied - raw > 13
