# SPDX-License-Identifier: Apache-2.0
"""True layers that follow from others."""

import doctest

import numpy as np
import pytest

from graycard.layers import _derived, find_fault, with_derived

IDS = np.array([[1, 1, 1, 0]], np.uint32)
ROUGHNESS = np.array([[0.49, 0.5, 0.1, 0.1]], np.float32)
F0 = np.array([[[0, 0.04, 0], [1, 1, 1], [0, 0, 0], [1, 1, 1]]], np.float32)


def test_examples() -> None:
    assert doctest.testmod(_derived).attempted >= 2
    assert doctest.testmod(_derived).failed == 0


def test_glossy_is_what_has_a_narrow_lobe() -> None:
    found = with_derived({"object_id": IDS, "roughness": ROUGHNESS, "f0": F0})["glossy"]
    assert found.tolist() == [[1, 0, 0, 0]], "one channel is enough; at the threshold it is rough"
    assert find_fault("glossy", found, 1, 4) is None
    assert found.dtype == np.float32


@pytest.mark.parametrize("lacking", ["object_id", "roughness", "f0"])
def test_it_needs_all_three(lacking: str) -> None:
    layers = {"object_id": IDS, "roughness": ROUGHNESS, "f0": F0}
    assert "glossy" not in with_derived({k: v for k, v in layers.items() if k != lacking})


def test_what_does_not_fit_is_left_to_those_who_judge_it() -> None:
    assert "glossy" not in with_derived({"object_id": IDS, "roughness": ROUGHNESS[:, :2], "f0": F0})


def test_what_is_there_already_stays() -> None:
    layers = {"object_id": IDS, "roughness": ROUGHNESS, "f0": F0, "glossy": IDS * 0.0}
    assert not with_derived(layers)["glossy"].any()
    assert "diffuse" in with_derived({"direct.diffuse": F0, "indirect.diffuse": F0})
