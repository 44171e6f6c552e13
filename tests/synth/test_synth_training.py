# SPDX-License-Identifier: Apache-2.0
"""Training views of which no more is rendered than methods, gauges and priors need, from fewer paths."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from graycard import Truth, View, open_truth
from graycard.colour import display_variance
from graycard.synth import RenderSettings, SceneSpec, render_scene
from graycard.synth.verify import verify_dataset

ALL = RenderSettings(24, 20, train_views=3, test_views=1, samples=64)
NEEDED = replace(ALL, training_layers="needed")
NOISY = replace(NEEDED, training_samples=16)
SPECS = {
    "dark": SceneSpec("dark", "corridor", 1000),
    "tabletop": SceneSpec("tabletop", "glossy-table", 1000),
}
SPLIT = ("direct.", "indirect.", "irradiance.", "visibility.", "effect.")


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict[str, Truth]]:
    """``rendered(track)``: the truth of one scene, rendered in three ways on first use."""

    @cache
    def render(track: str) -> dict[str, Truth]:
        found = {}
        for name, settings in (("all", ALL), ("needed", NEEDED), ("noisy", NOISY)):
            out = tmp_path_factory.mktemp(name)
            found[name] = open_truth(render_scene(SPECS[track], settings, out) / "truth")
        return found

    return render


@pytest.fixture(params=SPECS)
def truths(request: pytest.FixtureRequest, rendered: Callable[[str], dict[str, Truth]]) -> dict[str, Truth]:
    """Those of one track."""
    return rendered(request.param)


def of_split(truth: Truth, split: str) -> list[View]:
    return [view for view in truth.views if view.split == split]


def differing(one: Truth, other: Truth, view: View) -> set[str]:
    """Layers of a view in ``other`` whose bits are not those of ``one``."""
    before, after = one.layers(view), other.layers(view)
    return {name for name, values in after.items() if not np.array_equal(before[name], values, True)}


def test_training_views_hold_what_is_needed_with_the_same_bits(truths: dict[str, Truth]) -> None:
    for view in of_split(truths["all"], "train"):
        held = truths["needed"].layers(view).keys()
        assert not [name for name in held if name.startswith(SPLIT)]
        assert {"radiance", "radiance.var", "base_color", "normal", "depth", "pure"} <= held
        assert differing(truths["all"], truths["needed"], view) <= {"albedo"}
        albedo = [truths[name].layers(view)["albedo"] for name in ("all", "needed")]
        assert np.abs(albedo[0] - albedo[1]).mean() < 5e-3


def test_held_out_views_do_not_change(truths: dict[str, Truth]) -> None:
    for name in ("needed", "noisy"):
        for view in of_split(truths["all"], "test"):
            assert truths["all"].layers(view).keys() == truths[name].layers(view).keys()
            assert not differing(truths["all"], truths[name], view)


def test_ceilings_are_told_apart_where_samples_differ(truths: dict[str, Truth]) -> None:
    assert truths["needed"].photograph_ceiling is None
    noisy, ceilings = truths["noisy"], list[float]()
    for split, said in (("train", noisy.photograph_ceiling), ("test", noisy.noise_ceiling)):
        found = [noisy.layers(view) for view in of_split(noisy, split)]
        noise = [display_variance(v["radiance"], v["radiance.var"], noisy.exposure).mean() for v in found]
        assert said == pytest.approx(-10 * np.log10(np.mean(noise)))
        assert said is not None
        ceilings.append(said)
    assert ceilings[0] < ceilings[1] - 3


def test_such_scenes_are_verified(truths: dict[str, Truth]) -> None:
    for name in ("needed", "noisy"):
        root = truths[name].root
        assert root is not None
        verdict = verify_dataset(root.parents[2], views=2)
        assert [check for check in verdict.checks if check.status == "failed"] == []


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"training_samples": 50}, "training_samples to be 4 times a square"),
        ({"training_samples": -4}, "training_samples to be 4 times a square"),
        ({"training_layers": "few"}, "training_layers to be all or needed, got 'few'"),
    ],
)
def test_settings_that_are_none_are_refused(changed: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        replace(ALL, **changed)
