# SPDX-License-Identifier: Apache-2.0
"""A mirror image that is left, apart from a shadow that is left, where both lie on the same pixels."""

import numpy as np
import pytest

import graycard.eval as ge
from graycard import Camera, View, look_at
from graycard.eval.metrics._removal_lobes import METRICS
from graycard.eval.scoring._readings import TrueView

MIRROR, SHADOW = (metric.rule for metric in METRICS)
HEIGHT, WIDTH = 20, 24
RNG = np.random.default_rng(8)
VIEW = View("v", "test", Camera.from_fov(WIDTH, HEIGHT, 50, look_at(np.array([0.0, -3, 1]), np.zeros(3))))
EXPOSURE = 2.0
Layers = dict[str, np.ndarray]


def table() -> Layers:
    """A polished table: the shadow in rows 4 to 14, the mirror image in rows 8 to 18, nothing overexposed."""
    rows = np.arange(HEIGHT)[:, None] * np.ones((1, WIDTH), int)
    shadow, mirror = (rows >= 4) & (rows < 14), (rows >= 8) & (rows < 18)
    taken = np.where(shadow[..., None], RNG.uniform(0.02, 0.08, (HEIGHT, WIDTH, 3)), 0)
    reflected = np.where(mirror[..., None], RNG.uniform(-0.04, 0.06, (HEIGHT, WIDTH, 3)), 0)
    emptied = RNG.uniform(0.1, 0.2, (HEIGHT, WIDTH, 3))
    without = emptied + 0.15
    return {
        "object_id": np.ones((HEIGHT, WIDTH), np.uint32),
        "radiance": without - taken + reflected,
        "counterfactual.radiance": without,
        "specular": emptied + reflected,
        "counterfactual.specular": emptied,
        "effect.shadow": shadow.astype(np.float32),
        "effect.mirror": mirror.astype(np.float32),
    }


def shares_left(picture: np.ndarray, layers: Layers) -> tuple[float, float]:
    """Return both metrics of a picture, signed."""
    true = TrueView(VIEW, layers, frozenset())
    found = [metric.compute(picture, metric.prepare(true, EXPOSURE)) for metric in (MIRROR, SHADOW)]
    assert [abs(each.parts["signed"]) for each in found] == [each.value for each in found]
    return found[0].parts["signed"], found[1].parts["signed"]


@pytest.mark.parametrize("of_mirror", [0.0, 0.25, 1.0, -0.5])
@pytest.mark.parametrize("of_shadow", [0.0, 0.4, 1.0])
def test_shares_are_told_apart_where_they_overlap(of_mirror: float, of_shadow: float) -> None:
    layers = table()
    reflected = layers["specular"] - layers["counterfactual.specular"]
    taken = layers["counterfactual.radiance"] + reflected - layers["radiance"]
    picture = layers["counterfactual.radiance"] + of_mirror * reflected - of_shadow * taken
    assert shares_left(picture, layers) == pytest.approx((of_mirror, of_shadow), abs=1e-9)


def test_the_whole_share_cannot_tell() -> None:
    """The mirror image is gone and the shadow stays: the share of the whole says that some is left."""
    layers = table()
    reflected = layers["specular"] - layers["counterfactual.specular"]
    picture, mirror = layers["radiance"] - reflected, layers["effect.mirror"] > 0
    without, with_object = layers["counterfactual.radiance"], layers["radiance"]
    assert ge.residual_energy(picture, without, with_object, mirror) > 0.3
    assert shares_left(picture, layers) == pytest.approx((0, 1), abs=1e-9)


@pytest.mark.parametrize("region", ["mirror", "shadow"])
def test_a_picture_of_one_colour_holds_next_to_nothing_of_the_object_and_is_told_by_its_psnr(
    region: str,
) -> None:
    """Why what is left is read beside PSNR: the descriptions of the metrics say so."""
    layers = table()
    without = layers["counterfactual.radiance"]
    picture = np.broadcast_to(without[layers[f"effect.{region}"] > 0].mean(axis=0), without.shape)
    assert shares_left(picture, layers) == pytest.approx((0, 0), abs=0.3)
    assert np.abs(picture - without).mean() > 0.02
    residuals = [metric for metric in ge.registry() if metric.id.startswith("counterfactual.residual.")]
    assert {*METRICS} < {*residuals}
    for metric in residuals:
        for words in (metric.record.formula, metric.note):
            assert "read it beside counterfactual.psnr and counterfactual.psnr.rest" in words


def test_a_least_squares_fit_says_the_same() -> None:
    layers = table()
    picture = layers["counterfactual.radiance"] + RNG.normal(0, 0.02, (HEIGHT, WIDTH, 3))
    reflected = layers["specular"] - layers["counterfactual.specular"]
    taken = layers["radiance"] - layers["counterfactual.radiance"] - reflected
    for region, place, found in zip(("mirror", "shadow"), (0, 1), shares_left(picture, layers), strict=True):
        inside = layers[f"effect.{region}"] > 0
        columns = np.stack([reflected[inside].ravel(), taken[inside].ravel()], axis=1)
        left = (picture - layers["counterfactual.radiance"])[inside].ravel()
        assert found == pytest.approx(np.linalg.lstsq(columns, left)[0][place], abs=1e-12)


def test_overexposed_pixels_say_nothing() -> None:
    layers = table()
    for name in ("radiance", "counterfactual.radiance"):
        layers[name][10:12] += 0.5
    assert shares_left(layers["counterfactual.radiance"], layers) == pytest.approx((0, 0), abs=1e-12)
    without_them = layers["counterfactual.radiance"].copy()
    without_them[10:12] = 0
    assert shares_left(without_them, layers) == pytest.approx((0, 0), abs=1e-12)


@pytest.mark.parametrize("change", ["alike", "none"])
def test_effects_that_are_alike_or_absent_are_not_asked_for(change: str) -> None:
    layers = table()
    taken = layers["radiance"] - layers["counterfactual.radiance"]
    layers["specular"] = layers["counterfactual.specular"] + (0.5 * taken if change == "alike" else 0)
    assert MIRROR.prepare(TrueView(VIEW, layers, frozenset()), EXPOSURE) is None


def test_a_shadow_on_a_matte_surface_is_all_there_is() -> None:
    layers = table()
    layers["radiance"] -= layers["specular"] - layers["counterfactual.specular"]
    layers["specular"] = layers["counterfactual.specular"]
    prepared = SHADOW.prepare(TrueView(VIEW, layers, frozenset()), EXPOSURE)
    assert SHADOW.compute(layers["radiance"], prepared).value == pytest.approx(1)


def test_effects_are_apart_unless_one_is_the_other() -> None:
    effect, other = RNG.normal(size=(2, 5, 3))
    assert ge.are_apart(ge.effect_sums(effect, effect, other))
    assert ge.are_apart(ge.effect_sums(effect, effect, 0 * effect))
    assert not ge.are_apart(ge.effect_sums(effect, effect, 2 * effect + 0.01 * other))
    assert not ge.are_apart(ge.effect_sums(effect, 0 * effect, effect))


def test_views_are_fitted_together() -> None:
    """A view in which next to nothing is mirrored does not decide, whatever is left there."""
    strong, faint = table(), table()
    for name in ("radiance", "specular"):
        mirrored = faint["specular"] - faint["counterfactual.specular"]
        faint[name] = faint[name] - 0.999 * mirrored
    found = []
    for layers, off in ((strong, 0.0), (faint, 0.02)):
        true = TrueView(VIEW, layers, frozenset())
        prepared, picture = MIRROR.prepare(true, EXPOSURE), layers["counterfactual.radiance"] + off
        found.append(MIRROR.compute(picture, prepared))
    assert found[1].value > 1
    assert MIRROR.pool is not None
    pooled = MIRROR.pool(np.concatenate([each.evidence for each in found]))
    assert pooled.value < 0.1


def test_truth_of_before_has_no_such_scores() -> None:
    layers = {name: values for name, values in table().items() if name != "counterfactual.specular"}
    assert not any(metric.applies(TrueView(VIEW, layers, frozenset())) for metric in (MIRROR, SHADOW))
