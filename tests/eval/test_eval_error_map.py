# SPDX-License-Identifier: Apache-2.0
"""Error maps against closed forms."""

import numpy as np
import pytest

import graycard as gc
import graycard.eval as ge

MASK = np.array([[True, False], [True, True]])


def test_radiance_is_compared_as_displayed() -> None:
    true = np.full((2, 2, 3), 0.25)
    predicted = true.copy()
    predicted[0, 0] = (0.25, 0.5, 0.1)
    error = ge.error_map("radiance", predicted, true, MASK, exposure=2)
    assert error[0, 0] == pytest.approx(1 - gc.srgb_encode(np.array(0.5)))
    assert error[1].tolist() == [0, 0]
    assert np.isnan(error[0, 1])


def test_base_color_is_compared_in_linear_light_whatever_the_exposure() -> None:
    true, predicted = np.zeros((2, 2, 3)), np.zeros((2, 2, 3), np.float32)
    predicted[1, 1] = (0.1, -0.3, 0.2)
    error = ge.error_map("base_color", predicted, true, MASK, exposure=50)
    assert error[1].tolist() == pytest.approx([0, 0.3])


def test_normals_in_degrees_and_depth_in_metres() -> None:
    true = np.broadcast_to([0.0, 0, 1], (2, 2, 3))
    assert ge.error_map("normal", -true, true, MASK)[1].tolist() == [180, 180]
    depth = np.array([[1.0, np.inf], [2, 3]])
    assert ge.error_map("depth", depth + np.array([[0.5, 0], [0, -1]]), depth, MASK)[MASK].tolist() == [
        0.5,
        0,
        1,
    ]


def test_every_layer_with_a_map_has_a_unit() -> None:
    assert ge.error_map_unit("normal") == "degrees"
    with pytest.raises(gc.UnknownNameError, match="expected a layer with an error map"):
        ge.error_map("object_id", MASK, MASK, MASK)


def test_shapes_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match="expected two images of one shape"):
        ge.error_map("depth", np.zeros((3, 2)), np.zeros((2, 2)), MASK)
