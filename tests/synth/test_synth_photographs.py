# SPDX-License-Identifier: Apache-2.0
"""Photographs with the faults of a camera: noise of known size, levels that were rounded and cut off."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graycard import Sensor, open_capture, srgb_encode
from graycard.io import sha256
from graycard.synth import CaptureSettings, RenderSettings, SceneSpec, render_scene
from graycard.synth.dataset._photographs import photographed, sensor_of

EXPOSURE = 0.25
WHITE = 1 / EXPOSURE
VIEWS = ("train_000", "train_001", "train_002")
RAMP = np.linspace(0, 1.5 * WHITE, 3 * 64 * 64).reshape(64, 64, 3).astype(np.float32)


def taken(radiance: np.ndarray, view: str = VIEWS[0], seed: int = 1000, **faults: Any) -> np.ndarray:
    sensor = sensor_of(CaptureSettings(**faults), VIEWS, seed)
    assert sensor is not None
    return photographed(radiance, view, EXPOSURE, sensor, seed)


def test_without_faults_there_is_no_sensor() -> None:
    assert sensor_of(CaptureSettings(), VIEWS, 1000) is None


@pytest.mark.parametrize("level", [0.05, 0.3, 0.7])
@pytest.mark.parametrize("read", [0.0, 20.0])
def test_noise_has_the_mean_and_variance_of_counted_electrons(level: float, read: float) -> None:
    """Errors of n numbers: sigma / sqrt(n) of the mean, sigma² sqrt(2 / n) of the variance, nearly normal."""
    electrons, n = 2000.0, 3 * 128**2
    flat = np.full((128, 128, 3), level * WHITE, np.float32)
    found = taken(flat, shot_noise=electrons, read_noise=read) / WHITE
    variance = level / electrons + (read / electrons) ** 2
    of_mean = (found.mean(dtype=np.float64) - level) / np.sqrt(variance / n)
    of_variance = (found.var(dtype=np.float64) / variance - 1) / np.sqrt(2 / n)
    assert abs(of_mean) < 4, f"mean {found.mean()} of {level}: z = {of_mean:.1f}"
    assert abs(of_variance) < 4, f"variance {found.var()} of {variance}: z = {of_variance:.1f}"


def test_a_longer_exposure_is_less_noisy_and_saturates_earlier() -> None:
    flat = np.full((128, 128, 3), 0.2 * WHITE, np.float32)
    for factor in (0.5, 2.0):
        sensor = Sensor(shot_noise=2000, exposures={VIEWS[0]: factor})
        found = photographed(flat, VIEWS[0], EXPOSURE, sensor, 1000) / WHITE
        assert found.var(dtype=np.float64) == pytest.approx(0.2 / (2000 * factor), rel=0.04)  # 4 sigma: 2.6 %
        assert found.mean(dtype=np.float64) == pytest.approx(0.2, rel=1e-3)
        bright = photographed(20 * flat, VIEWS[0], EXPOSURE, sensor, 1000)
        assert bright.max() == pytest.approx(WHITE / factor)


@pytest.mark.parametrize("bits", [8, 12])
def test_levels_are_rounded_to_the_nearest_and_cut_off(bits: int) -> None:
    found = taken(RAMP, bits=bits)
    shown, wanted = (srgb_encode(x * EXPOSURE) for x in (found, np.minimum(RAMP, WHITE)))
    assert np.abs(shown - wanted).max() <= 0.5 / (2**bits - 1) + 1e-6
    steps = shown * (2**bits - 1)
    assert np.abs(steps - np.rint(steps)).max() < 1e-2
    assert found.max() == pytest.approx(WHITE)
    assert len(np.unique(found)) == 2**bits or bits > 8


def test_the_share_that_is_cut_off_is_the_share_above_white() -> None:
    found = taken(RAMP, exposure_spread=0.5)
    sensor = sensor_of(CaptureSettings(exposure_spread=0.5), VIEWS, 1000)
    assert sensor is not None
    white = WHITE / sensor.exposure(VIEWS[0])
    assert (found >= 0.999999 * white).mean() == pytest.approx(np.mean(white <= RAMP), abs=1e-3)
    below = 0.999 * white > RAMP
    np.testing.assert_allclose(found[below], RAMP[below], rtol=1e-6)


def test_exposures_lie_within_the_spread_and_grow_with_it() -> None:
    names = [f"train_{i:03d}" for i in range(400)]
    one, two = (sensor_of(CaptureSettings(exposure_spread=s), names, 1000) for s in (0.5, 1.0))
    assert one is not None
    assert two is not None
    stops, double = (np.log2([s.exposure(n) for n in names]) for s in (one, two))
    np.testing.assert_allclose(2 * stops, double, atol=1e-12)
    assert np.abs(double).max() <= 1
    assert double.std() == pytest.approx(1 / np.sqrt(3), rel=0.1)  # uniform: 4 sigma of 400 are 9 %
    assert one.exposure("test_000") == 1


def test_equal_seeds_give_equal_photographs_and_views_differ() -> None:
    faults: dict[str, Any] = {"shot_noise": 500.0, "read_noise": 5.0}
    first, again = taken(RAMP, **faults), taken(RAMP, **faults)
    assert (first == again).all()
    assert (first != taken(RAMP, seed=1001, **faults)).any()
    flat, noises = np.full((128, 128, 3), 0.5 * WHITE, np.float32), []
    for name in VIEWS:
        shot = taken(flat, name, shot_noise=500.0)
        noises += [shot.ravel(), (taken(flat, name, **faults) - shot).ravel()]
    related = np.corrcoef(noises) - np.eye(len(noises))
    assert np.abs(related).max() < 5 / np.sqrt(flat.size)


def test_a_fault_leaves_the_numbers_of_the_others_alone() -> None:
    flat = np.full((32, 32, 3), 0.4 * WHITE, np.float32)
    shot = taken(flat, shot_noise=1000.0)
    small, large = (taken(flat, shot_noise=1000.0, read_noise=r) - shot for r in (3.0, 6.0))
    np.testing.assert_allclose(large, 2 * small, atol=1e-5)
    rounded = taken(flat, shot_noise=1000.0, bits=16)
    np.testing.assert_allclose(rounded, shot, atol=1e-4)


def test_black_stays_black_without_read_noise() -> None:
    black = np.zeros((8, 8, 3), np.float32)
    assert taken(black, shot_noise=100.0, bits=8).max() == 0
    assert taken(black, shot_noise=100.0, read_noise=9.0).min() == 0


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        ({"bits": 17}, "expected bits from 0 to 16, got 17"),
        ({"bits": -1}, "expected bits from 0"),
        ({"shot_noise": -1.0}, "expected shot_noise to be 0 or more"),
        ({"shot_noise": 9.0, "read_noise": np.inf}, "expected read_noise to be 0 or more"),
        ({"read_noise": 2.0}, "expected shot_noise, the electrons at white"),
        ({"exposure_spread": -0.1}, "expected exposure_spread to be 0 or more"),
    ],
)
def test_faults_out_of_range_are_refused(faults: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        CaptureSettings(**faults)


def test_exposures_of_nothing_are_refused() -> None:
    with pytest.raises(ValueError, match="expected finite exposures above 0"):
        Sensor(exposures={"train_000": 0.0})


def test_a_rendered_capture_says_what_took_it_and_truth_is_as_it_was(tmp_path: Path, no_llvm: str) -> None:
    faults = CaptureSettings(bits=8, shot_noise=4000, read_noise=4, exposure_spread=0.5)
    clean = RenderSettings(20, 16, 3, 1, 16, 3)
    spec = SceneSpec("tabletop", "glossy-table", 1000)
    plain = render_scene(spec, clean, tmp_path / "plain")
    found = render_scene(spec, replace(clean, capture=faults), tmp_path / "faulty")
    capture, ideal = (open_capture(f / "capture") for f in (found, plain))
    assert ideal.sensor is None
    assert capture.sensor is not None
    assert (capture.sensor.bits, capture.sensor.shot_noise, capture.sensor.read_noise) == (8, 4000, 4)
    assert set(capture.sensor.exposures) == {v.name for v in capture.train}
    assert "knobs" not in json.loads((found / "capture" / "manifest.json").read_text())["settings"]
    assert capture.exposure == ideal.exposure
    for view in capture.views:
        assert sha256(found / f"truth/views/{view.name}.exr") == sha256(
            plain / f"truth/views/{view.name}.exr"
        )
    for view in capture.train:
        noisy, light = capture.photograph(view), ideal.photograph(view)
        assert noisy.max() <= 1 / (capture.exposure * capture.sensor.exposure(view.name)) * (1 + 1e-6)
        assert 0.005 < np.abs(noisy - np.minimum(light, noisy.max())).mean() * capture.exposure < 0.05
