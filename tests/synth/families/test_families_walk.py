# SPDX-License-Identifier: Apache-2.0
"""The walk of the camera in dark rooms, and spots that a seed moves."""

import numpy as np

from graycard.synth._spec import RenderSettings
from graycard.synth.families._flash_room import Gait, walk
from graycard.synth.families._many_lights import Spots

SETTINGS = RenderSettings(width=16, height=16, train_views=18, test_views=3)


def test_a_walk_without_sway_and_glances_is_a_straight_line():
    gait = Gait(sway=0.0, bob=0.0, glance=0.0, recentre=0.0)
    cameras = walk(np.random.default_rng(0), SETTINGS, (0.5, 0.0, 1.4), 2.0, gait)
    expected = [(0.5 + 2.0 * t, 0.0, 1.4) for t in np.linspace(0, 1, SETTINGS.views)]
    np.testing.assert_allclose([c.position for c in cameras], expected, atol=1e-12)
    ahead = np.array([2.6, 0.0, -0.74]) / np.hypot(2.6, 0.74)
    np.testing.assert_allclose([c.forward for c in cameras], [ahead] * len(cameras), atol=1e-12)


def test_a_walk_stays_within_its_sway_and_bob():
    gait = Gait(sway=0.2, bob=0.05)
    away = np.array(
        [c.position for c in walk(np.random.default_rng(3), SETTINGS, (0.0, 0.0, 1.5), 2.0, gait)]
    )
    assert 0.1 < np.abs(away[:, 1]).max() <= 0.2
    assert 0.02 < np.abs(away[:, 2] - 1.5).max() <= 0.05


def test_a_spot_moves_with_the_seed_and_no_farther_than_its_reach():
    spots = Spots({"urn": (-1.2, 0.75)}, 0.1)
    found = np.array([spots.at("urn", seed) for seed in range(50)])
    away = np.abs(found - (-1.2, 0.75))
    assert 0.08 < away.max() <= 0.1
    assert len(np.unique(found, axis=0)) == 50
    assert spots.at("urn", 7) == spots.at("urn", 7)
