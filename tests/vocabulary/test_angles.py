# SPDX-License-Identifier: Apache-2.0
"""Angles where closed forms are hard; more of them, with statistics, in the tests of the scores."""

import doctest
import importlib

import numpy as np

from graycard import angles


def test_angles_are_exact_where_the_arc_cosine_is_not() -> None:
    tilt = 1e-6
    a = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    b = np.array([[np.sin(tilt), 0.0, np.cos(tilt)], [0.0, 3.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(angles(a, b), [np.degrees(tilt), 90, 180, 90], rtol=1e-9)


def test_either_may_point_nowhere() -> None:
    some, none = np.ones((2, 3)), np.zeros((2, 3))
    assert angles(some, none).tolist() == angles(none, none).tolist() == [90.0, 90.0]


def test_the_example_says_what_happens() -> None:
    result = doctest.testmod(importlib.import_module("graycard._angles"))
    assert (result.attempted, result.failed) == (2, 0)
