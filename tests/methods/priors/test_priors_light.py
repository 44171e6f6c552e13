# SPDX-License-Identifier: Apache-2.0
"""The calibration of the lamp on the camera: exact at severity 0, and as wrong as it says."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from graycard import (
    Light,
    MethodError,
    PointLight,
    RectangleLight,
    SpotLight,
    UnknownNameError,
    angles,
    methods,
    open_capture,
    open_truth,
)
from graycard.benchmarks._privileged import priors_for
from graycard.methods import Ask
from graycard.methods.priors import Override, PriorSpec, check_priors, make_priors, truth_of, weights_of
from graycard.methods.priors._light import LightErrors, calibrated, corrupt_light

SPOT = SpotLight("lamp", (0.25, -0.06, 0.0), (-0.08, 0.03, 1.0), (9.0, 8.0, 6.0), 15.0, 38.0, "camera")
CEILING = RectangleLight("ambient", (3.0, 0, 3), (0, 2.0, 0), (3.0, 0, 0), (0.02, 0.02, 0.03))
ASK = (Ask("light"),)


def told(scene: Path, spec: PriorSpec, lights: tuple[Light, ...] = (CEILING, SPOT)) -> SpotLight | PointLight:
    capture = open_capture(scene / "capture", check=False)
    return make_priors(spec, ASK, capture, {}, lights).light()


def wrongness(lamp: SpotLight | PointLight) -> tuple[float, ...]:
    assert isinstance(lamp, SpotLight)
    return (
        float(np.linalg.norm(np.subtract(lamp.position, SPOT.position))),
        float(angles(np.array(lamp.direction), np.array(SPOT.direction))),
        abs(float(np.log(lamp.cutoff_angle / SPOT.cutoff_angle))),
        float(np.abs(np.log(np.divide(lamp.intensity, SPOT.intensity))).max()),
    )


@pytest.fixture
def scene(make_scene: Callable[..., Path]) -> Path:
    return make_scene()


def test_at_severity_0_it_is_the_truth(scene: Path):
    assert wrongness(told(scene, PriorSpec("oracle", 0, seed=3))) == pytest.approx((0, 0, 0, 0), abs=1e-5)


def test_errors_grow_in_place_with_severity_and_follow_the_seed(scene: Path):
    for seed in range(1000, 1006):
        errors = [wrongness(told(scene, PriorSpec("oracle", level, seed))) for level in range(6)]
        assert (np.diff(errors, axis=0) > 0).all()
    assert told(scene, PriorSpec("oracle", 5, 1000)) == told(scene, PriorSpec("oracle", 5, 1000))
    assert told(scene, PriorSpec("oracle", 5, 1000)) != told(scene, PriorSpec("oracle", 5, 1001))


def test_each_scene_has_errors_of_its_own(make_scene: Callable[..., Path]):
    one, other = (make_scene(scene=name) for name in ("one-0001", "other-0002"))
    spec = PriorSpec("oracle", 3)
    assert told(one, spec) == told(one, spec)
    assert told(one, spec) != told(other, spec)
    assert told(one, PriorSpec("oracle", 0)) == told(other, PriorSpec("oracle", 0))


def test_each_error_is_alone_and_as_large_as_it_says():
    """The mean square is that of what is set; a factor's logarithm is normal."""
    cases = (LightErrors(translation=0.1), LightErrors(rotation=4.0), LightErrors(width=0.1))
    cases = (*cases, LightErrors(intensity=0.2))
    for number, (errors, size) in enumerate(zip(cases, (0.1, 4.0, 0.1, 0.2), strict=True)):
        found = np.array([wrongness(corrupt_light(SPOT, errors, seed)) for seed in range(1000, 1300)])
        assert np.abs(np.delete(found, number, axis=1)).max() < 1e-5
        if number == 0:
            assert np.mean(found[:, 0] ** 2) == pytest.approx(size**2, rel=0.15)
        if number == 1:  # of three coordinates the one along the beam turns nothing
            assert np.mean(found[:, 1] ** 2) == pytest.approx(2 / 3 * size**2, rel=0.2)
    factors = [corrupt_light(SPOT, cases[3], seed).intensity[0] for seed in range(1000, 1300)]
    assert stats.kstest(np.log(np.divide(factors, 9.0)), stats.norm(0, 0.2).cdf).pvalue > 0.01
    widths = [corrupt_light(SPOT, cases[2], seed) for seed in range(1000, 1300)]
    assert all(isinstance(lamp, SpotLight) for lamp in widths)
    ratio = [lamp.beam_width / lamp.cutoff_angle for lamp in widths if isinstance(lamp, SpotLight)]
    np.testing.assert_allclose(ratio, 15 / 38)


def test_a_beam_is_no_wider_than_everything():
    wide = replace(SPOT, beam_width=100.0, cutoff_angle=170.0)
    cutoffs = []
    for seed in range(20):
        lamp = corrupt_light(wide, LightErrors(width=2.0), seed)
        assert isinstance(lamp, SpotLight)
        cutoffs.append(lamp.cutoff_angle)
    assert max(cutoffs) == 180


def test_a_bare_bulb_has_no_beam():
    bulb = PointLight("lamp", (0.3, -0.1, 0.0), (12.0, 10.0, 8.0), "camera")
    wrong = corrupt_light(bulb, LightErrors(0.1, 5.0, 0.2, 0.2), 1000)
    assert isinstance(wrong, PointLight)
    assert wrong.frame == "camera"
    assert 0.01 < np.linalg.norm(np.subtract(wrong.position, bulb.position)) < 0.3


@pytest.mark.parametrize(
    ("lights", "message"),
    [
        ((CEILING,), "one point or spot light on the camera to calibrate, got none"),
        ((SPOT, replace(SPOT, name="other")), r"got lamp \(SpotLight\), other \(SpotLight\)"),
        ((replace(CEILING, frame="camera"),), r"got ambient \(RectangleLight\)"),
    ],
)
def test_what_cannot_be_calibrated_says_why(lights: tuple[Light, ...], message: str):
    with pytest.raises(MethodError, match=message):
        calibrated(lights, LightErrors(), 0)


def test_only_an_oracle_knows_the_lamp():
    assert truth_of(PriorSpec("oracle"), ASK) == {"lights"}
    for source in ("none", "classical"):
        with pytest.raises(MethodError, match=f"gives light, got '{source}'. One of oracle does"):
            check_priors(PriorSpec(source), ASK)
    optional = (Ask("light", optional=True),)
    for source in ("none", "classical", "pretrained"):  # no network tells it, so no weights are missed
        assert weights_of(PriorSpec(source), optional) == []
    override = PriorSpec("oracle", overrides={"light": Override(errors={"rotation": 3.0})})
    assert str(override) == "oracle, severity 0; light: oracle, severity 0, rotation 3"
    with pytest.raises(UnknownNameError, match="error of light"):
        PriorSpec("oracle", overrides={"light": Override(errors={"kappa": 3.0})})


def test_without_a_calibration_or_with_one_of_the_room_it_says_so():
    assert methods.Priors().kinds == frozenset()
    with pytest.raises(MethodError, match="expected a prior that gives light, got one of source 'none'"):
        methods.Priors().light()
    standing = methods.Priors("oracle", calibration=replace(SPOT, frame="world"))
    assert standing.kinds == {"light"}
    with pytest.raises(MethodError, match="of a lamp on the camera, got 'lamp' in the world"):
        standing.light()


def test_a_run_hands_the_calibration_alone(scene: Path):
    """A method that asks for the lamp gets it, and neither the lights nor any layer."""
    capture = open_capture(scene / "capture", check=False)
    darkgs = methods.load_method("darkgs")
    found = priors_for(darkgs.needs, methods.asks_of(darkgs), PriorSpec("oracle", 2), capture, scene)
    assert found.kinds == {"light"}
    assert (found.lights, dict(found.layers)) == (None, {})
    (true,) = open_truth(scene / "truth", check=False).lights()
    assert isinstance(true, PointLight)
    assert 0 < np.linalg.norm(np.subtract(found.light().position, true.position)) < 0.1
