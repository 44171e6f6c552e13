# SPDX-License-Identifier: Apache-2.0
"""Predictions may hold anything outside the mask: scores under a mask keep every bit."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from changed_scene import enrich
from graycard import Predictions, Truth, View, open_truth
from graycard.dataset import manifest_of
from graycard.eval.scoring._readings import TrueView, read_truth
from graycard.io import read_rgb, write_layers, write_manifest, write_rgb
from graycard.layers import with_derived
from graycard.predictions import finish_predictions, write_composed, write_relit, write_view
from graycard.records import Score, ScoreSheet
from rich_layers import EXACT, SKY, glossy_in, write_rich

Layers = dict[str, np.ndarray]
Fill = Callable[[np.ndarray], np.ndarray]
ANYTHING = (np.nan, np.inf, -np.inf, 1e30, -1e30, 1.0)
"""Not finite, beyond all measure, and white."""
NOT_PREDICTED = (
    *EXACT,
    "visibility.lamp",
    "visibility.left",
    "counterfactual.specular",
    "effect.footprint",
    "effect.shadow",
    "effect.mirror",
)
LOOK_OUTSIDE = {
    "gs-ir-2", "gs-ir-ssim-1", "3dgs-psnr-1", "3dgs-ssim-1", "tensoir-normal-1", "gs-ir-normal-1"
}  # fmt: skip
"""Published protocols that judge the whole picture as it was predicted."""


def flat(value: float) -> Fill:
    return lambda values: np.full_like(values, value)


def mixed(values: np.ndarray) -> np.ndarray:
    return np.random.default_rng(5).choice(ANYTHING, values.shape).astype(values.dtype)


def with_visibility(layers: Layers) -> Layers:
    """With a lamp that half of the picture does not see."""
    return {"visibility.left": np.linspace(0, 1, layers["depth"].size).reshape(layers["depth"].shape)}


def with_specular(layers: Layers) -> Layers:
    """With a mirror image that covers the lower half: what the target changes comes by either lobe."""
    mirrored = 0.02 * (np.arange(layers["radiance"].size).reshape(layers["radiance"].shape) % 7)
    return {"specular": mirrored, "counterfactual.specular": 0 * mirrored}


def add_layers(scene: Path, make: Callable[[Layers], Layers]) -> None:
    """Add layers to the truth of a scene on disk."""
    truth = open_truth(scene / "truth")
    manifest = manifest_of(truth)
    for view in truth.views:
        layers = truth.layers(view)
        more = {k: v.astype(np.float32) for k, v in make(layers).items()}
        write_layers(scene / "truth" / "views" / f"{view.name}.exr", layers | more)
    write_manifest(scene / "truth", manifest)


@dataclass(frozen=True)
class Judged:
    """A scene, and the scores of an honest prediction of it, by graycard's rules and by all others."""

    scene: Path
    sheet: ScoreSheet


@pytest.fixture(scope="module", params=["rich", "multilight", "tabletop"])
def judged(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]
) -> Judged:
    folder, track = tmp_path_factory.mktemp("outside"), request.param
    tiny = write_tiny(folder / "tiny", track="multilight" if track == "rich" else track)
    scene = enrich(tiny) if track != "rich" else write_rich(tiny, folder / "rich" / "multilight" / tiny.name)
    add_layers(scene, with_specular if track == "tabletop" else with_visibility)
    return Judged(scene, score(scene, folder / "honest", lambda values: values))


def worse(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return an honest prediction: the truth with errors."""
    return (values * rng.uniform(0.8, 1.1, values.shape)).astype(np.float32)


def outside(values: np.ndarray, mask: np.ndarray, fill: Fill) -> np.ndarray:
    """Return values with others wherever nothing is judged."""
    return np.where(mask.reshape(mask.shape + (1,) * (values.ndim - 2)), values, fill(values))


def score(scene: Path, folder: Path, fill: Fill) -> ScoreSheet:
    """Score all layers and changed pictures, with errors, filled with something outside the mask."""
    truth = open_truth(scene / "truth", check=False)
    for number, view in enumerate(truth.views):
        rng, true = np.random.default_rng(number), read_truth(truth, view)
        layers = predicted_layers(true, rng)
        write_view(folder, view.name, {k: outside(v, true.mask(k), fill) for k, v in layers.items()})
        if view.split == "test":
            for name, picture, mask in changed(truth, view, true):
                write_changed(folder, name, view.name, outside(worse(picture, rng), mask, fill))
    if (scene / "truth" / SKY.image).is_file():
        write_rgb(folder / SKY.image, read_rgb(scene / "truth" / SKY.image))
    finish_predictions(folder, Predictions("t", truth.track, truth.scene), truth.lights())
    return ge.score_predictions(folder, scene, "all")


def predicted_layers(true: TrueView, rng: np.random.Generator) -> Layers:
    layers = {k: v for k, v in with_derived(true.layers).items() if k not in NOT_PREDICTED}
    layers = {k: v for k, v in layers.items() if not k.endswith((".var", ".half_a", ".half_b"))}
    made = {k: worse(v, rng) for k, v in layers.items()}
    if "f0" in true.layers:
        made["glossy"] = glossy_in(dict(true.layers)).astype(np.float32)
    return made


def changed(truth: Truth, view: View, true: TrueView) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield name, true picture and judged pixels of each change."""
    for edit in truth.edits:
        yield edit.name, truth.relit(edit.name, view)["radiance"], true.mask("radiance")
    if truth.composition() is not None:
        composed = truth.composed(view)
        yield "", composed["radiance"], composed["object_id"] > 0


def write_changed(folder: Path, change: str, view: str, image: np.ndarray) -> None:
    if change:
        write_relit(folder, change, view, image)
    else:
        write_composed(folder, view, image)


def numbers(score: Score) -> tuple[object, ...]:
    return score.status, score.value, dict(score.per_view), dict(score.breakdown), score.gauge, score.reason


def differing(one: Sequence[Score], other: Sequence[Score]) -> set[str]:
    """Return the metrics, or protocols, whose numbers or reasons are not the same."""
    return {
        a.metric if a.protocol == "graycard-1" else a.protocol
        for a, b in zip(one, other, strict=True)
        if numbers(a) != numbers(b)
    }


def hints(sheet: ScoreSheet) -> set[str]:
    return {says for s in sheet.scores for says in s.warnings if " look" in says or " keeps " in says}


@pytest.mark.parametrize("fill", [flat(np.nan), flat(1e30), mixed], ids=["nan", "1e30", "mixed"])
def test_scores_do_not_look_outside(judged: Judged, tmp_path: Path, fill: Fill) -> None:
    found = score(judged.scene, tmp_path, fill)
    assert {s.status for s in judged.sheet.scores} == {"scored"}
    assert differing(found.scores, judged.sheet.scores) == set()
    assert differing(found.protocols, judged.sheet.protocols) <= LOOK_OUTSIDE
    assert hints(found) == set()


def test_the_docs_name_those_that_do() -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "protocols.md").read_text()
    (named,) = re.findall(r"^whole picture as it was predicted: (.*?)\. For them", page, re.M | re.S)
    assert set(re.findall(r"`([^`]+)`", named)) == LOOK_OUTSIDE


def test_six_protocols_look_outside(judged: Judged, tmp_path: Path) -> None:
    found = score(judged.scene, tmp_path, flat(1e30))
    assert differing(found.protocols, judged.sheet.protocols) == LOOK_OUTSIDE
    assert {s.protocol for s in found.protocols if s.status == "failed"} == set()


def test_what_is_not_finite_outside_counts_as_zero_there(judged: Judged, tmp_path: Path) -> None:
    black = score(judged.scene, tmp_path / "black", flat(0.0))
    for name, value in (("nan", np.nan), ("inf", -np.inf)):
        found = score(judged.scene, tmp_path / name, flat(value))
        assert differing(found.protocols, black.protocols) == set()


TRIED = {
    "rich": {"novel_view.psnr.shadow", "albedo.chart", "light_off.psnr", "glossy.iou", "irradiance.psnr"},
    "multilight": {"relighting.psnr", "relighting.ssim", "composition.psnr", "albedo.leakage.shadow"},
    "tabletop": {"counterfactual.residual.mirror.specular", "counterfactual.psnr.rest"},
}
"""Metrics that only one of the scenes has."""


def test_metrics_with_masks_of_their_own_are_tried(judged: Judged) -> None:
    tried = {s.metric for s in judged.sheet.scores}
    assert any(metrics <= tried for metrics in TRIED.values()), tried
