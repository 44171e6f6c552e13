# SPDX-License-Identifier: Apache-2.0
"""Matching of lights against brute force, and errors against closed forms."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import graycard.eval as ge
from graycard import (
    Camera,
    LocalLight,
    PointLight,
    PredictionError,
    RectangleLight,
    SphereLight,
    SpotLight,
    View,
    look_at,
)
from graycard.eval.kinds._lights import score_lights
from graycard.eval.metrics._lights import METRICS

RNG = np.random.default_rng(4)


def camera(x: float) -> Camera:
    return Camera.from_fov(8, 8, 50, look_at(np.array([x, -3, 1]), np.zeros(3)))


CAMERAS = [camera(-1.0), camera(0.5), camera(2.0)]


def points(count: int) -> list[LocalLight]:
    places = RNG.normal(size=(count, 3))
    return [
        PointLight(f"p{i}", (float(x), float(y), float(z)), (1, 1, 1)) for i, (x, y, z) in enumerate(places)
    ]


@pytest.mark.parametrize(("predicted", "true"), [(3, 3), (4, 4), (2, 4), (5, 3), (1, 5)])
def test_the_assignment_is_the_best_of_all(predicted: int, true: int) -> None:
    for _ in range(10):
        p, t = points(predicted), points(true)
        cost = np.linalg.norm(
            np.array([a.position for a in p])[:, None] - np.array([b.position for b in t])[None], axis=-1
        )
        cost = cost if predicted <= true else cost.T
        best = min(
            sum(cost[i, j] for i, j in enumerate(chosen))
            for chosen in permutations(range(cost.shape[1]), cost.shape[0])
        )
        match = ge.match_lights(p, t, CAMERAS)
        assert sum(match.distances) == pytest.approx(best)
        assert (match.missing, match.extra) == (max(true - predicted, 0), max(predicted - true, 0))


def test_order_and_names_do_not_matter() -> None:
    lights = points(4)
    shuffled = [replace(lights[i], name="x") for i in (2, 0, 3, 1)]
    match = ge.match_lights(shuffled, lights, CAMERAS)
    assert set(match.pairs) == {(0, 2), (1, 0), (2, 3), (3, 1)}
    assert max(match.distances) == 0


def test_a_light_on_the_camera_is_placed_by_each_camera() -> None:
    mounted = PointLight("lamp", (0.3, -0.1, 0.2), (1, 1, 1), "camera")
    fixed = replace(mounted, position=(0.5, 0.0, 1.0), frame="world")
    places = [c.camera_to_world @ (0.3, -0.1, 0.2, 1) for c in CAMERAS]
    expected = np.mean([np.linalg.norm(p[:3] - (0.5, 0, 1)) for p in places])
    assert ge.light_distances([fixed], [mounted], CAMERAS).item() == pytest.approx(expected)
    assert ge.light_distances([mounted], [mounted], CAMERAS).item() == 0


def test_a_light_that_stays_where_the_mean_camera_is_does_not_pass_for_a_mounted_one() -> None:
    mounted = PointLight("lamp", (0, 0, 0), (1, 1, 1), "camera")
    x, y, z = np.mean([c.position for c in CAMERAS], axis=0).tolist()
    assert ge.light_distances([PointLight("still", (x, y, z), (1, 1, 1))], [mounted], CAMERAS).item() > 0.5


def test_no_lights_on_one_side() -> None:
    assert ge.match_lights([], points(3), CAMERAS).missing == 3
    assert ge.match_lights(points(2), [], CAMERAS).extra == 2
    with pytest.raises(ValueError, match="expected cameras to place the lights by"):
        ge.match_lights(points(1), points(1), [])


@pytest.mark.parametrize(("factor", "stops"), [(1, 0), (2, 1), (0.5, 1), (8, 3), (2**-0.5, 0.5)])
def test_intensity_error_is_in_stops(factor: float, stops: float) -> None:
    true = PointLight("a", (0, 0, 0), (4, 2, 1))
    predicted = PointLight("b", (9, 9, 9), (4 * factor, 2 * factor, factor))
    assert ge.intensity_error(predicted, true) == pytest.approx(stops)


def test_intensities_of_different_kinds_are_compared_on_the_axis() -> None:
    sphere = SphereLight("s", (0, 0, 0), 0.5, (4, 4, 4))
    point = PointLight("p", (0, 0, 0), (np.pi, np.pi, np.pi))
    assert ge.intensity_error(point, sphere) == pytest.approx(0, abs=1e-12)


def test_a_channel_without_light_has_no_ratio() -> None:
    red = PointLight("red", (0, 0, 0), (4, 0, 0))
    assert ge.intensity_error(PointLight("x", (0, 0, 0), (8, 1, 5)), red) == pytest.approx(1)
    dark = replace(red, intensity=(0, 0, 0))
    assert ge.intensity_error(red, dark) == 0


@dataclass(frozen=True)
class Stub:
    """Answers that light scores ask predictions and truth for."""

    found: tuple[LocalLight, ...]
    views: tuple[View, ...] = tuple(View(f"v{i}", "test", c) for i, c in enumerate(CAMERAS))
    diameter: float = 5.0

    def lights(self) -> tuple[LocalLight, ...]:
        return self.found


def scores(predicted: tuple[LocalLight, ...], true: tuple[LocalLight, ...]) -> dict[str, float | None]:
    found = score_lights(METRICS, Stub(predicted), Stub(true))  # pyright: ignore[reportArgumentType]
    return {score.metric: score.value for score in found}


def spots(factors: Sequence[float], turns: Sequence[float]) -> tuple[LocalLight, ...]:
    """Three spots in a row, off by factors of red and by angles."""
    return tuple(
        SpotLight(f"s{i}", (i, 0, 2), (np.sin(a), 0, -np.cos(a)), (3 * f, 2, 1), 20, 40)
        for i, (f, a) in enumerate(zip(factors, turns, strict=True))
    )


PANEL = RectangleLight("panel", (3, 0, 2), (0.5, 0, 0), (0, -0.5, 0), (4, 4, 4))
MISSED = {metric.id: metric.rule.price for metric in METRICS if metric.rule.error}
"""Price of a true light that no predicted one stands for."""
HARD_TRUTH = (*spots((1, 1, 1), (0, 0, 0)), PANEL)


@settings(max_examples=40, database=None, deadline=None, derandomize=True)
@given(
    st.tuples(*[st.floats(1e-4, 1e4)] * 3),
    st.tuples(*[st.floats(0, float(np.pi))] * 3),
    st.sets(st.integers(0, 3), min_size=1),
)
def test_of_lights_in_their_places_none_is_worth_leaving_out(
    factors: tuple[float, ...], turns: tuple[float, ...], left_out: set[int]
) -> None:
    found = (*spots(factors, turns), replace(PANEL, half_u=(0.1, 0, 0), radiance=(9, 4, 1)))
    fewer = tuple(light for i, light in enumerate(found) if i not in left_out)
    whole, part = scores(found, HARD_TRUTH), scores(fewer, HARD_TRUTH)
    assert whole.keys() == part.keys()
    for metric in whole.keys() - {"light.extra"}:
        assert (part[metric] or 0) >= (whole[metric] or 0) - 1e-9, metric
    assert part["light.position"] == pytest.approx(100 * len(left_out) / 4)


def test_what_a_missed_light_costs() -> None:
    none = scores((), HARD_TRUTH)
    assert {metric: none[metric] for metric in MISSED} == MISSED
    half = scores(HARD_TRUTH[:2], HARD_TRUTH)
    for metric in MISSED.keys() - {"light.extent"}:
        assert half[metric] == pytest.approx(MISSED[metric] / 2), metric
    assert half["light.extent"] == MISSED["light.extent"], "only the panel has a size"


def test_no_light_costs_more_than_one_that_is_missed() -> None:
    wild = replace(HARD_TRUTH[0], intensity=(3e9, 2e9, 1e9))
    assert scores((wild,), HARD_TRUTH[:1])["light.intensity"] == MISSED["light.intensity"]


def test_a_predicted_light_that_is_off() -> None:
    off = PointLight("off", (0, 0, 0), (1, 0, 1))
    with pytest.raises(PredictionError, match="expected light 'off' with a positive intensity"):
        ge.intensity_error(off, PointLight("lamp", (0, 0, 0), (1, 1, 1)))


def test_errors_of_opposite_sign_do_not_cancel() -> None:
    true = PointLight("a", (0, 0, 0), (4, 4, 4))
    assert ge.intensity_error(replace(true, intensity=(8, 2, 4)), true) == pytest.approx(2 / 3)
