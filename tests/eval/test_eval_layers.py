# SPDX-License-Identifier: Apache-2.0
"""Scores of depth, material, the three reflectances and light on surfaces, on a scene that has them all."""

import json
import math
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from graycard import (
    Light,
    PointLight,
    Predictions,
    View,
    open_truth,
    srgb_encode,
)
from graycard.dataset import manifest_of
from graycard.io import read_rgb, write_layers, write_manifest, write_rgb
from graycard.layers import LOBES, PARTS, with_derived, with_sums
from graycard.predictions import finish_predictions, write_view
from graycard.records import ScoreSheet
from odd_files import rewrite
from rich_layers import EXACT, LAMPS, NAMES, PATCHES, SKY, enriched, glossy_in, write_rich

Layers = dict[str, np.ndarray]
Change = Callable[[View, Layers], Layers]


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory, tiny_scenes: dict[str, Path]) -> Path:
    """The tiny multilight scene with every layer, three lights, and a ball that is a colour chart."""
    return write_rich(tiny_scenes["multilight"], tmp_path_factory.mktemp("rich") / "multilight" / "tiny-0000")


@pytest.fixture
def score(scene: Path, tmp_path: Path) -> Callable[..., ScoreSheet]:
    """``score(change, lights)`` scores the truth as ``change(view, layers)`` makes it."""
    made = iter(range(100))

    def run(
        change: Callable[[View, Layers], Layers] = lambda view, layers: layers,
        lights: tuple[Light, ...] | None = (*LAMPS, SKY),
    ) -> ScoreSheet:
        truth, folder = open_truth(scene / "truth"), tmp_path / f"predicted-{next(made)}"
        for view in truth.views:
            true = truth.layers(view)
            layers = {k: v for k, v in true.items() if k not in EXACT} | {"glossy": glossy_in(true)}
            write_view(folder, view.name, change(view, layers))
        if SKY in (lights or ()):
            write_rgb(folder / "sky.exr", read_rgb(scene / "truth" / "sky.exr"))
        finish_predictions(folder, Predictions("t", truth.track, truth.scene), lights)
        return ge.score_predictions(folder, scene)

    return run


def only(*names: str) -> Callable[[View, Layers], Layers]:
    return lambda view, layers: {k: v for k, v in layers.items() if k in names}


def times(factors: Mapping[str, float | np.ndarray]) -> Callable[[View, Layers], Layers]:
    return lambda view, layers: layers | {k: (layers[k] * f).astype(np.float32) for k, f in factors.items()}


def test_the_truth_reaches_the_optimum_of_every_metric(score: Callable[..., ScoreSheet]) -> None:
    sheet = score()
    missing = {m.id for m in ge.all_metrics()} - {s.metric for s in sheet.scores}
    elsewhere = (
        "counterfactual.", "novel_view.lpips", "novel_view.fid", "novel_view.kid", "novel_view.psnr.",
        "relighting.", "composition.", "albedo.leakage.",
    )  # fmt: skip
    assert {m for m in missing if not m.startswith(elsewhere)} == set()
    for found in sheet.scores:
        assert (found.status, found.value) == ("scored", found.optimum), (found.metric, found.reason)
        assert found.expected == found.scored > 0


def test_what_is_not_predicted_is_not_provided(score: Callable[..., ScoreSheet]) -> None:
    sheet = score(only("radiance"), None)
    statuses = {s.metric: (s.status, s.reason) for s in sheet.scores}
    assert {m for m, (status, _) in statuses.items() if status == "scored"} == {
        m for m in statuses if m.startswith(("novel_view.", "training_view."))
    }
    assert statuses["irradiance.psnr"] == ("not provided", "no view has irradiance.<light>")
    assert statuses["depth.rmse"] == ("not provided", "no view has depth")
    assert statuses["hemispherical_albedo.psnr.raw"] == ("not provided", "no view has albedo")
    assert statuses["environment.psnr"] == ("not provided", "there is no lights.json")
    assert [sheet.score(m).expected for m in ("light.position", "light.extent")] == [2, 1], "a spot has none"


def test_another_reflectance_is_judged_by_its_own_name(score: Callable[..., ScoreSheet]) -> None:
    gains = np.array((2.0, 0.5, 1.5))

    def change(view: View, layers: Layers) -> Layers:
        return {
            "diffuse_reflectance": layers["diffuse_reflectance"] / gains,
            "shading": layers["shading"] * gains,
        }

    sheet = score(change, None)
    assert sheet.score("albedo.psnr.channel").status == "not provided"
    assert (sheet.score("diffuse_reflectance.psnr.channel").value or 0) > 100
    assert sheet.score("diffuse_reflectance.psnr.channel").gauge == pytest.approx(gains, rel=1e-6)
    assert (sheet.score("diffuse_reflectance.psnr.raw").value or 99) < 20
    assert (sheet.score("diffuse_reflectance.psnr.scalar").value or 99) < 30
    assert (sheet.score("shading.psnr").value or 0) > 100, "light is gauged by what albedo there is"
    assert sheet.score("shading.psnr").gauge == pytest.approx(1 / gains, rel=1e-6)


def test_without_albedo_nothing_was_traded(score: Callable[..., ScoreSheet]) -> None:
    sheet = score(lambda view, layers: {"shading": layers["shading"]}, LAMPS)
    assert sheet.score("shading.psnr").value == math.inf
    assert sheet.score("shading.psnr").gauge == (1, 1, 1)
    assert sheet.score("light.intensity.channel").value == 0


def test_light_gains_what_albedo_loses(score: Callable[..., ScoreSheet]) -> None:
    traded = {"base_color": 0.5, "shading": 2.0, "irradiance.left": 2.0, "irradiance.right": 2.0}
    brighter = tuple(
        replace(LAMPS[0], intensity=(10.0, 8.0, 6.0))
        if x is LAMPS[0]
        else replace(x, radiance=(60.0, 40.0, 20.0))
        for x in LAMPS
    )
    sheet = score(times(traded | {"irradiance.sky": 2.0}), (*brighter, SKY))
    assert (sheet.score("shading.psnr").value or 0) > 100
    assert (sheet.score("irradiance.psnr").value or 0) > 100
    assert sheet.score("light.intensity").value == pytest.approx(1)
    assert sheet.score("light.intensity.channel").value == pytest.approx(0, abs=1e-6)
    assert sheet.score("light.intensity.channel").gauge == pytest.approx((0.5, 0.5, 0.5), rel=1e-6)
    baked = score(times({"shading": 2.0}))
    assert (baked.score("shading.psnr").value or 99) < 25, "not traded, but wrong"


def test_depth_of_a_hole_costs_as_much_as_the_surface_is_far(
    score: Callable[..., ScoreSheet], scene: Path
) -> None:
    def holes(view: View, layers: Layers) -> Layers:
        depth = layers["depth"].copy()
        depth[:, :14] = np.inf
        depth[0, 20:] = -1.0
        return layers | {"depth": depth}

    sheet, truth = score(holes), open_truth(scene / "truth")
    expected = {"relative": [], "square": [], "near": []}
    for view in (v for v in truth.views if v.split == "test"):
        seen = truth.layers(view)["object_id"] > 0
        bad = np.zeros(seen.shape, bool)
        bad[:, :14], bad[0, 20:] = True, True
        depth = truth.layers(view)["depth"].astype(float)
        expected["relative"].append(bad[seen].mean())
        expected["near"].append(100 - 100 * bad[seen].mean())
        expected["square"].append(np.where(bad, depth, 0)[seen] @ np.where(bad, depth, 0)[seen] / seen.sum())
    assert sheet.score("depth.abs_rel").value == pytest.approx(np.mean(expected["relative"]))
    assert sheet.score("depth.within_1_25").value == pytest.approx(np.mean(expected["near"]))
    assert sheet.score("depth.rmse").value == pytest.approx(np.sqrt(np.mean(expected["square"])))
    assert "depths are +inf where there is a surface" in sheet.score("depth.rmse").warnings[0]


def test_depth_is_not_scaled(score: Callable[..., ScoreSheet]) -> None:
    sheet = score(times({"depth": 1.2}))
    assert sheet.score("depth.abs_rel").value == pytest.approx(0.2, abs=1e-6)
    assert sheet.score("depth.within_1_25").value == 100
    assert score(times({"depth": 1.3})).score("depth.within_1_25").value == 0
    assert score(times({"depth": 1 / 1.3})).score("depth.within_1_25").value == 0


def test_roughness_is_judged_where_something_shines(score: Callable[..., ScoreSheet]) -> None:
    def change(view: View, layers: Layers) -> Layers:
        rough, metal = layers["roughness"], layers["metallic"]
        return layers | {
            "roughness": np.where(metal > 0, rough + 0.1, 0).astype(np.float32),
            "metallic": metal * 0.8,
        }

    sheet = score(change)
    assert sheet.score("roughness.mae").value == pytest.approx(0.1, abs=1e-6), "matte parts have none"
    assert sheet.score("roughness.rmse").value == pytest.approx(0.1, abs=1e-6)
    mean, root = sheet.score("metallic.mae").value, sheet.score("metallic.rmse").value
    assert mean is not None
    assert root is not None
    assert 0 < mean < root < 0.2


def test_patches_are_read_off_as_means_and_count_alike(score: Callable[..., ScoreSheet]) -> None:
    def noisy(view: View, layers: Layers) -> Layers:
        color = layers["base_color"].copy()
        red = (np.abs(color - PATCHES[0]) < 1e-6).all(axis=-1)
        even = np.flatnonzero(red)[: red.sum() // 2 * 2]
        color.reshape(-1, 3)[even] *= np.where(np.arange(len(even)) % 2, 0.5, 1.5)[:, None]
        return layers | {"base_color": color.astype(np.float32)}

    sheet = score(noisy)
    assert (sheet.score("albedo.chart").value or 0) < 1.5, "errors within a patch cancel, up to the gauge"
    tinted = score(times({"base_color": np.array((1.4, 1.0, 0.7))}))
    assert (tinted.score("albedo.chart").value or 0) > 5


def test_a_scene_without_a_chart_has_no_score_of_one(
    tiny_scenes: dict[str, Path], predict: Callable[..., Path]
) -> None:
    sheet = ge.score_predictions(predict(tiny_scenes["dark"]), tiny_scenes["dark"])
    assert "albedo.chart" not in {s.metric for s in sheet.scores}


def test_lights_go_by_their_place_and_not_by_their_names(score: Callable[..., ScoreSheet]) -> None:
    names = {"left": "b", "right": "left", "sky": "dome"}

    def renamed(view: View, layers: Layers) -> Layers:
        stems = ((*k.rpartition("."), v) for k, v in layers.items())
        return {
            f"{stem}.{names[tail]}" if tail in names else f"{stem}{dot}{tail}": v
            for stem, dot, tail, v in stems
        }

    lights = (replace(LAMPS[1], name="left"), replace(LAMPS[0], name="b"), replace(SKY, name="dome"))
    sheet = score(renamed, lights)
    for metric in ("irradiance.psnr", "light_share.psnr", "direct.diffuse.psnr"):
        assert (sheet.score(metric).value or 0) > 120, metric
    swapped = score(
        renamed, (replace(LAMPS[0], name="left"), replace(LAMPS[1], name="b"), replace(SKY, name="dome"))
    )
    assert (swapped.score("irradiance.psnr").value or 99) < 40
    by_name = score(renamed, None).score("irradiance.psnr")
    assert by_name.status == "failed"
    assert "expected irradiance.right in views" in by_name.reason, (
        "without lights.json names stand as they are"
    )


def of_lights(*lights: str, error: float = 1.0) -> Change:
    """Layers of some of the lights, off by a factor."""

    def change(view: View, layers: Layers) -> Layers:
        each = {k: v for k, v in layers.items() if k.rpartition(".")[2] in NAMES}
        kept = {k: v * np.float32(error) for k, v in each.items() if k.rpartition(".")[2] in lights}
        return {k: v for k, v in layers.items() if k not in each} | kept

    return change


def test_a_light_that_is_not_predicted_is_dark(score: Callable[..., ScoreSheet]) -> None:
    left_out = score(of_lights("left", "right"), LAMPS)

    def darkened(view: View, layers: Layers) -> Layers:
        return layers | {k: v * 0 for k, v in layers.items() if k.endswith(".sky")}

    written = score(darkened)
    for metric, layer in (("irradiance.psnr", "irradiance.sky"), ("light_share.psnr", "radiance.sky")):
        found = left_out.score(metric)
        assert found.status == "scored"
        assert found.value == written.score(metric).value, "as if its light were written as black"
        assert found.warnings == (f"lights that are not predicted count as dark: {layer}",)
        assert written.score(metric).warnings == ()


@pytest.mark.parametrize("easiest", ["left", "right"])
def test_to_predict_the_easiest_light_only_does_not_pay(
    score: Callable[..., ScoreSheet], easiest: str
) -> None:
    kept = tuple(light for light in LAMPS if light.name == easiest)
    off = tuple(
        replace(light, **{k: tuple(1.5 * x for x in getattr(light, k))})  # pyright: ignore[reportArgumentType]
        for light, k in ((LAMPS[0], "intensity"), (LAMPS[1], "radiance"))
    )
    every, one = score(of_lights(*NAMES, error=0.8), (*off, SKY)), score(of_lights(easiest), kept)
    for metric in ("irradiance.psnr", "light_share.psnr"):
        assert (every.score(metric).value or 0) > (one.score(metric).value or 99) + 3, metric
    for metric in ("light.position", "light.intensity", "light.intensity.channel", "light.chromaticity"):
        assert (every.score(metric).value or 0) < (one.score(metric).value or 0) / 5, metric
    assert sum(one.score(f"light.{m}").value or 0 for m in ("direction", "extent")) >= 90


def test_of_a_light_that_is_predicted_no_layer_may_be_missing(score: Callable[..., ScoreSheet]) -> None:
    lost = score(of_lights("left"), LAMPS).score("irradiance.psnr")
    assert lost.status == "failed"
    assert "test_001: expected irradiance.right in views/test_001.exr" in lost.reason
    assert "irradiance.sky" not in lost.reason, "what was not written is not said to be there"
    none = score(of_lights(), LAMPS).score("irradiance.psnr")
    assert (none.status, none.warnings) == ("not provided", ())

    def gap(view: View, layers: Layers) -> Layers:
        return {k: v for k, v in layers.items() if k != "irradiance.left" or view.name != "test_001"}

    lost = score(gap).score("irradiance.psnr")
    assert lost.status == "failed"
    assert "test_001: expected irradiance.left in views/test_001.exr" in lost.reason


def test_parts_of_lights_add_up(score: Callable[..., ScoreSheet]) -> None:
    def totals(view: View, layers: Layers) -> Layers:
        return {part: sum(layers[f"{part}.{n}"] for n in NAMES) for part in PARTS}  # pyright: ignore

    whole, parts = score(totals), score()
    for part in PARTS:
        assert (whole.score(f"{part}.psnr").value or 0) > 120
        assert parts.score(f"{part}.psnr").value == math.inf
    assert whole.score("light_share.psnr").status == "not provided"
    half = score(lambda v, x: {k: a for k, a in x.items() if k.startswith("direct.specular")})
    assert half.score("direct.specular.psnr").value == math.inf
    assert half.score("light_share.psnr").status == "not provided", "three parts of each light are missing"


def test_a_bracket_sees_in_the_dark(score: Callable[..., ScoreSheet], scene: Path) -> None:
    exposure = open_truth(scene / "truth").exposure

    def lifted(view: View, layers: Layers) -> Layers:
        dark = layers["radiance"] * exposure < 0.05
        return layers | {
            "radiance": np.where(dark, layers["radiance"] * 2, layers["radiance"]).astype(np.float32)
        }

    sheet = score(lifted)
    plain, bracket = sheet.score("novel_view.flip").value, sheet.score("novel_view.flip_hdr").value
    assert plain is not None
    assert bracket is not None
    assert bracket > plain > 0


def test_light_of_a_lamp_that_is_not_there_is_named(score: Callable[..., ScoreSheet]) -> None:
    ghost = PointLight("ghost", (50.0, 50.0, 50.0), (1.0, 1.0, 1.0))
    sheet = score(
        lambda view, layers: layers | {"irradiance.ghost": layers["radiance"]}, (*LAMPS, ghost, SKY)
    )
    warnings = sheet.score("irradiance.psnr").warnings
    assert warnings == ("of lights that the scene has not, and not judged: irradiance.ghost",)
    assert sheet.score("irradiance.psnr").value == math.inf
    assert not sheet.score("light_share.psnr").warnings


OF_GLOSS = ("f0.mae", "f0.rmse", "diffuse.psnr", "specular.psnr", "glossy.iou")
"""Scores of what shines."""


def held_out(scene: Path) -> list[Layers]:
    truth = open_truth(scene / "truth")
    return [with_derived(truth.layers(v)) for v in truth.views if v.split == "test"]


def test_f0_is_judged_where_something_shines(score: Callable[..., ScoreSheet]) -> None:
    def change(view: View, layers: Layers) -> Layers:
        off = layers["f0"] + np.array((0.1, 0.2, 0.0))
        return layers | {"f0": np.where(layers["metallic"][..., None] > 0, off, 9).astype(np.float32)}

    sheet = score(change)
    assert sheet.score("f0.mae").value == pytest.approx(0.1, abs=1e-6), "mean over channels"
    assert sheet.score("f0.rmse").value == pytest.approx(math.sqrt(0.05 / 3), abs=1e-6)


def test_a_lobe_is_the_sum_of_its_parts(score: Callable[..., ScoreSheet]) -> None:
    def lobes(view: View, layers: Layers) -> Layers:
        return {k: v for k, v in with_sums(layers).items() if k in LOBES}

    def halves(view: View, layers: Layers) -> Layers:
        return {k: v for k, v in with_sums(layers).items() if k in PARTS}

    for change in (lobes, halves, lambda view, layers: layers):
        sheet = score(change)
        assert [sheet.score(f"{lobe}.psnr").value for lobe in LOBES] == [math.inf, math.inf]
    one = score(only("direct.diffuse.left", "direct.diffuse.right", "direct.diffuse.sky"))
    assert one.score("direct.diffuse.psnr").status == "scored"
    assert one.score("diffuse.psnr").reason == "no view has diffuse", "without the indirect part"


def test_what_is_written_counts_before_any_sum(score: Callable[..., ScoreSheet]) -> None:
    def change(view: View, layers: Layers) -> Layers:
        return layers | {"specular": np.zeros_like(layers["radiance"])}

    sheet = score(change)
    assert sheet.score("direct.specular.psnr").value == math.inf
    assert (sheet.score("specular.psnr").value or 99) < 60


@pytest.mark.parametrize("lobe", LOBES)
def test_light_of_a_lobe_is_compared_as_displayed(
    score: Callable[..., ScoreSheet], scene: Path, lobe: str
) -> None:
    exposure = open_truth(scene / "truth").exposure
    black = score(lambda view, layers: {lobe: np.zeros_like(layers["radiance"])}, None)
    squares = []
    for true in held_out(scene):
        shown = srgb_encode(true[lobe][true["object_id"] > 0].astype(float) * exposure)
        squares.append(np.mean(shown**2))
    assert black.score(f"{lobe}.psnr").value == pytest.approx(-10 * math.log10(np.mean(squares)), abs=1e-4)
    assert black.score(f"{lobe}.psnr").noise_ceiling is None


def test_a_region_is_judged_by_its_overlap(score: Callable[..., ScoreSheet], scene: Path) -> None:
    views = held_out(scene)
    shares = [true["glossy"].sum() / (true["object_id"] > 0).sum() for true in views]
    whole = score(lambda view, layers: {"glossy": np.full_like(layers["metallic"], 0.51)}, None)
    found = whole.score("glossy.iou")
    assert found.value == pytest.approx(np.mean(shares)), "what nobody sees does not count"
    assert found.breakdown["recall"] == 1
    assert found.breakdown["precision"] == pytest.approx(np.mean(shares))
    none = score(lambda view, layers: {"glossy": np.full_like(layers["metallic"], 0.5)}, None)
    assert none.score("glossy.iou").value == 0
    assert set(none.score("glossy.iou").breakdown) <= {"recall", "interior", "boundary"}

    def half(view: View, layers: Layers) -> Layers:
        marked = layers["glossy"].copy()
        marked.reshape(-1)[np.flatnonzero(marked)[::2]] = 0.2
        return {"glossy": marked}

    kept = [(n - n // 2 - n % 2) / n for n in (int(true["glossy"].sum()) for true in views)]
    assert score(half, None).score("glossy.iou").value == pytest.approx(np.mean(kept))


def test_regions_of_gloss_have_borders_and_insides(score: Callable[..., ScoreSheet], scene: Path) -> None:
    rows = slice(0, 12)
    truth = open_truth(scene / "truth")
    folder = scene.parent / "with-pure"
    shutil.copytree(scene, folder)
    for view in truth.views:
        layers = truth.layers(view)
        layers["pure"] = np.ones_like(layers["metallic"])
        layers["pure"][rows] = 0
        write_layers(folder / "truth" / "views" / f"{view.name}.exr", layers)
    write_manifest(folder / "truth", manifest_of(truth))
    for view in truth.views:
        true = truth.layers(view)
        marked, f0 = glossy_in(true), true["f0"].copy()
        marked[rows], f0[rows] = 0, f0[rows] + 0.2
        write_view(folder / "p", view.name, {"glossy": marked, "f0": f0})
    finish_predictions(folder / "p", Predictions("t", truth.track, truth.scene))
    sheet = ge.score_predictions(folder / "p", folder)
    assert [sheet.score("glossy.iou").breakdown[part] for part in ("interior", "boundary")] == [1, 0]
    parts = sheet.score("f0.mae").breakdown
    assert (parts["interior"], parts["boundary"]) == pytest.approx((0, 0.2), abs=1e-6)


def test_a_breakdown_has_the_names_that_its_metric_declares(scene: Path, tmp_path: Path) -> None:
    """Those of relighting and composition are held in another scene."""
    truth, folder = open_truth(scene / "truth"), tmp_path / "multilight" / "tiny-0000"
    shutil.copytree(scene, folder)
    for view in truth.views:
        true = truth.layers(view)
        pure = (np.arange(true["metallic"].shape[1]) % 2 == 0) & np.ones(true["metallic"].shape, bool)
        known = true | {"pure": pure.astype(np.float32), "shading.var": true["shading"] * np.float32(1e-6)}
        write_layers(folder / "truth" / "views" / f"{view.name}.exr", known)
        wrong = {k: v * np.float32(0.9) for k, v in true.items() if k not in EXACT}
        write_view(tmp_path / "p", view.name, wrong | {"glossy": glossy_in(true)})
    write_manifest(folder / "truth", manifest_of(truth))
    write_rgb(tmp_path / "p" / "sky.exr", read_rgb(scene / "truth" / "sky.exr"))
    finish_predictions(tmp_path / "p", Predictions("t", truth.track, truth.scene), (*LAMPS, SKY))
    found = {s.metric: set(s.breakdown) for s in ge.score_predictions(tmp_path / "p", folder).scores}
    assert found == {metric: set(ge.find_metric(metric).breakdown) for metric in found}
    some = {"shading.psnr", "glossy.iou", "light_off.psnr", "environment.psnr", "albedo.leakage"}
    assert some <= found.keys()


@pytest.mark.parametrize("shining", ["nowhere", "test_001"])
def test_where_nothing_shines_there_is_nothing_to_take_apart(
    write_tiny: Callable[..., Path], tmp_path: Path, shining: str
) -> None:
    folder = write_tiny(tmp_path, track="multilight")
    truth = open_truth(folder / "truth")
    for view in truth.views:
        layers = enriched(truth.layers(view))
        if view.name != shining:
            layers |= {"f0": layers["f0"] * 0, "roughness": np.ones_like(layers["roughness"])}
        write_layers(folder / "truth" / "views" / f"{view.name}.exr", layers)
        write_view(tmp_path / "p", view.name, {k: layers["radiance"] for k in ("f0", *LOBES)})
    write_manifest(folder / "truth", manifest_of(truth))
    finish_predictions(tmp_path / "p", Predictions("t", truth.track, truth.scene))
    sheet = ge.score_predictions(tmp_path / "p", folder)
    asked = {s.metric: s.expected for s in sheet.scores if s.metric in OF_GLOSS}
    assert asked == ({} if shining == "nowhere" else dict.fromkeys(OF_GLOSS, 1))
    assert sheet.score("direct.diffuse.psnr").expected == 2


def lost(values: np.ndarray) -> np.ndarray | None:
    return None


def cut(values: np.ndarray) -> np.ndarray:
    return values[:-1]


def spoilt(values: np.ndarray) -> np.ndarray:
    values = values.copy()
    values[20] = np.nan  # of the floor, which shines: elsewhere f0 may be anything
    return values


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lost, "expected {0} in views/test_003.exr"),
        (cut, "of shape"),
        (spoilt, "expected finite values in {0}"),
    ],
)
@pytest.mark.parametrize("layer", ["f0", "glossy", "diffuse", "specular"])
def test_a_fault_in_one_view_is_a_failed_score(
    score: Callable[..., ScoreSheet], layer: str, spoil: Callable[..., np.ndarray | None], words: str
) -> None:
    def change(view: View, layers: Layers) -> Layers:
        whole = with_sums(layers)[layer]
        values = spoil(whole) if view.name == "test_003" else whole
        return {"alpha": layers["roughness"]} if values is None else {layer: values}

    sheet = score(change, None)
    for metric in (name for name in OF_GLOSS if name.startswith(layer)):
        found = sheet.score(metric)
        assert (found.status, found.value, found.scored, found.expected) == ("failed", None, 1, 2)
        assert words.format(layer) in found.reason


@pytest.mark.parametrize("metric", OF_GLOSS)
def test_what_shines_need_not_be_told(score: Callable[..., ScoreSheet], metric: str) -> None:
    found = score(only("radiance"), None).score(metric)
    assert (found.status, found.reason) == ("not provided", f"no view has {metric.partition('.')[0]}")


@pytest.mark.parametrize("views", ["all", "one"])
def test_a_sum_fails_with_a_part_that_cannot_be_used(
    scene: Path, score: Callable[..., ScoreSheet], tmp_path: Path, views: str
) -> None:
    parts = [f"{part}.{name}" for part in PARTS for name in NAMES]
    score(only("radiance", *parts))
    files = sorted((tmp_path / "predicted-0").glob("views/*.exr"))
    for path in files if views == "all" else [p for p in files if p.stem == "test_003"]:
        rewrite(path, {}, without=("direct.diffuse.right.B",))
    index = {"method": "t", "track": "multilight", "scene": "tiny-0000"}
    (tmp_path / "predicted-0" / "predictions.json").write_text(json.dumps(index))
    sheet = ge.score_predictions(tmp_path / "predicted-0", scene)
    failed = {s.metric: s.reason for s in sheet.scores if s.status == "failed"}
    of_shares = {"light_share.psnr", "light_off.psnr", "light_off.better"}
    assert failed.keys() == {"direct.diffuse.psnr", "diffuse.psnr", *of_shares}
    for sum_of, metric in (("direct.diffuse", "direct.diffuse.psnr"), ("diffuse", "diffuse.psnr")):
        assert f"expected all parts of {sum_of}, got one that cannot be used" in failed[metric]
        assert "expected channels direct.diffuse.right.R, direct.diffuse.right.G" in failed[metric]
    for metric in ("indirect.diffuse.psnr", "specular.psnr"):
        assert sheet.score(metric).value == math.inf
