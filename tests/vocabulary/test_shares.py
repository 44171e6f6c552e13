# SPDX-License-Identifier: Apache-2.0
"""Light adds up."""

import doctest

import numpy as np
import pytest

from graycard import UnknownNameError, find_layer
from graycard.layers import LOBES, PARTS, _shares, lights_of, with_sums

ONE = np.ones((2, 2, 3), np.float32)


def test_examples() -> None:
    assert doctest.testmod(_shares).attempted >= 2
    assert doctest.testmod(_shares).failed == 0


def test_what_is_there_already_stays() -> None:
    layers = {f"{part}.lamp": ONE for part in PARTS} | {"direct.diffuse": 7 * ONE}
    found = with_sums(layers)
    assert found["direct.diffuse"].max() == 7
    assert np.array_equal(found["radiance.lamp"], 4 * ONE)
    assert np.array_equal(found["indirect.specular"], ONE)
    assert "direct.specular" not in layers, "what is handed in is left alone"


def test_a_light_without_all_its_parts_has_no_sum() -> None:
    found = with_sums({f"{part}.lamp": ONE for part in PARTS[:3]})
    assert "radiance.lamp" not in found


def test_parts_of_unequal_size_are_not_added() -> None:
    found = with_sums({"direct.diffuse.a": ONE, "direct.diffuse.b": ONE[:1]})
    assert "direct.diffuse" not in found


def test_how_well_a_layer_is_known_is_no_light() -> None:
    names = ["radiance.var", "radiance.half_a", "radiance.sky", "direct.radiance.x", "irradiance.lamp"]
    assert lights_of("radiance", names) == ["sky"]


def test_a_lobe_is_direct_and_indirect_light() -> None:
    found = with_sums({f"{part}.{light}": ONE for part in PARTS for light in ("lamp", "sky")})
    assert [found[lobe].max() for lobe in LOBES] == [4, 4]
    assert with_sums({"direct.diffuse": ONE, "indirect.diffuse": 2 * ONE})["diffuse"].max() == 3
    assert (
        with_sums({"direct.diffuse": ONE, "diffuse": 5 * ONE, "indirect.diffuse": ONE})["diffuse"].max() == 5
    )
    assert "diffuse" not in with_sums({"direct.diffuse": ONE, "indirect.specular": ONE})
    assert "diffuse" not in with_sums({"direct.diffuse": ONE, "indirect.diffuse": ONE[:1]})


def test_a_lobe_is_no_light_of_a_name() -> None:
    """``diffuse`` may be the name of a lamp, too."""
    found = with_sums({f"{part}.diffuse": ONE for part in PARTS})
    assert found["radiance.diffuse"].max() == 4
    assert found["diffuse"].max() == 2
    assert lights_of("radiance", found) == ["diffuse"]
    with pytest.raises(UnknownNameError, match=r"diffuse\.lamp"):
        find_layer("diffuse.lamp")
