# SPDX-License-Identifier: Apache-2.0
"""Planted mistakes: which scores change, which stay, and what is said; honest predictions draw no hint."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import graycard.eval as ge
from changed_scene import DESK, LAMP, enrich
from graycard import Light, View, open_truth, srgb_encode
from graycard.dataset import manifest_of
from graycard.io import write_layers, write_manifest
from graycard.records import ScoreSheet

Layers = dict[str, np.ndarray]
Change = Callable[[View, Layers], Mapping[str, np.ndarray] | None]
Predict = Callable[..., Path]
NAMES = ("lamp", "desk")
HANDED_IN = (
    "radiance", "base_color", "normal", "depth", "roughness", "metallic", "counterfactual.radiance",
    "shading",
    *(f"{layer}.{name}" for layer in ("irradiance", "radiance") for name in NAMES),
)  # fmt: skip
RECEIVED = ("shading.psnr", "irradiance.psnr")
ALBEDO = ("albedo.", "light.intensity.channel", *RECEIVED)
"""Metrics that see a factor on albedo, by which light is divided."""
GAINED = ("albedo.psnr.raw", "light.intensity.channel", *RECEIVED)
"""Metrics that one factor on albedo reaches; all others have a gauge."""
VIEWS = ("novel_view.", "training_view.", "light_off.")
"""Metrics of the radiance of a view."""
PIXELS = (
    *VIEWS, "albedo.", "normal.", "depth.", "roughness.", "metallic.", "counterfactual.", *RECEIVED,
    "light_share.psnr", "light_off.",
)  # fmt: skip
"""All that is made of what is handed in as pictures; lights stay where they are."""


@dataclass(frozen=True)
class Fault:
    """A mistake, the scores that it may and must touch (by how their ids begin), and its warning."""

    name: str
    change: Change
    touches: tuple[str, ...]
    beside: str = ""
    """Score that the warning stands beside; empty where there is none to be told."""
    says: str = ""
    lights: tuple[Light, ...] = (LAMP, DESK)

    def __str__(self) -> str:
        return self.name


def of(layer: str, change: Callable[[np.ndarray, View], np.ndarray]) -> Change:
    """Change one layer of every view."""
    return lambda view, layers: layers | {layer: change(layers[layer].astype(float), view)}


def each(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    """Change all layers of every view."""
    return lambda view, layers: {name: change(values) for name, values in layers.items()}


def nothing(view: View, layers: Layers) -> Layers:
    return layers


def to_camera(normals: np.ndarray, view: View) -> np.ndarray:
    return normals @ view.camera.camera_to_world[:3, :3]


def along_the_ray(depth: np.ndarray, view: View) -> np.ndarray:
    return depth / (view.camera.rays() @ view.camera.forward)


def half_right(values: np.ndarray) -> np.ndarray:
    return (values + np.roll(values, 1, axis=1)) / 2


def with_background(view: View, layers: Layers) -> Layers:
    empty = layers["depth"] == np.inf
    return {k: np.where(empty if v.ndim == 2 else empty[..., None], 0.7, v) for k, v in layers.items()}


def mask_inverted(view: View, layers: Layers) -> Layers:
    object_seen = np.abs(layers["radiance"] - layers["counterfactual.radiance"])[..., :1] > 0.25
    return layers | {"counterfactual.radiance": np.where(object_seen, layers["radiance"], 0.3)}


def lamps(**changes: object) -> tuple[Light, ...]:
    return tuple(replace(light, **changes) for light in (LAMP, DESK))  # pyright: ignore[reportArgumentType]


GAIN = (1.5, 0.7, 1.1)
TWICE_LIT = tuple(
    replace(light, intensity=tuple(np.pi * x for x in light.intensity)) for light in (LAMP, DESK)
)
NORMAL, DEPTH, ROUGH = ("normal.",), ("depth.",), ("roughness.",)
FAULTS = (
    Fault("gain of each channel", of("base_color", lambda v, _: v * GAIN), (*ALBEDO,)),
    Fault("sRGB for linear", of("base_color", lambda v, _: srgb_encode(v)), ALBEDO,
          "albedo.psnr.channel", "base_color looks sRGB-encoded"),
    Fault("B, G, R", of("base_color", lambda v, _: v[..., ::-1]), ALBEDO,
          "albedo.psnr.channel", "base_color looks like B, G, R"),
    Fault("albedo divided by π", of("base_color", lambda v, _: v / np.pi), GAINED,
          "albedo.psnr.channel", "base_color looks divided by π"),
    Fault("albedo of 0 to 255", of("base_color", lambda v, _: v * 255), GAINED,
          "albedo.psnr.channel", "base_color looks like 0 to 255"),
    Fault("albedo of 8 bits", of("base_color", lambda v, _: np.round(srgb_encode(v) * 255) / 255),
          ALBEDO, "albedo.psnr.channel", "base_color looks"),
    Fault("normals mirrored in x", of("normal", lambda v, _: v * (-1, 1, 1)), NORMAL,
          "normal.mean_angle", "normal looks mirrored in x: try (-x, y, z)"),
    Fault("normals mirrored in y", of("normal", lambda v, _: v * (1, -1, 1)), NORMAL,
          "normal.mean_angle", "normal looks mirrored in y: try (x, -y, z)"),
    Fault("normals mirrored in z", of("normal", lambda v, _: v * (1, 1, -1)), NORMAL,
          "normal.mean_angle", "normal looks mirrored in z: try (x, y, -z)"),
    Fault("normals turned inward", of("normal", lambda v, _: -v), NORMAL,
          "normal.mean_angle", "normal looks turned inward"),
    Fault("normals of the camera", of("normal", to_camera), NORMAL,
          "normal.mean_angle", "normal looks like camera axes (x right, y down)"),
    Fault("normals of OpenGL's camera", of("normal", lambda v, w: to_camera(v, w) * (1, -1, -1)), NORMAL,
          "normal.mean_angle", "normal looks like camera axes (x right, y up)"),
    Fault("normals as colours", of("normal", lambda v, _: (v + 1) / 2), NORMAL,
          "normal.mean_angle", "normal looks encoded as (n + 1) / 2"),
    Fault("distance for depth", of("depth", along_the_ray), DEPTH,
          "depth.abs_rel", "depth looks like distance along the ray"),
    Fault("millimetres", of("depth", lambda v, _: v * 1000), DEPTH,
          "depth.abs_rel", "depth looks like millimetres"),
    Fault("a world a fifth too large", of("depth", lambda v, _: v * 1.2), DEPTH,
          "depth.abs_rel", "depth looks scaled: times 0.8333"),
    Fault("disparity", of("depth", lambda v, _: 1 / v), DEPTH,
          "depth.abs_rel", "depth looks like 1 / z"),
    Fault("alpha for roughness", of("roughness", lambda v, _: v**2), ROUGH,
          "roughness.mae", "roughness looks like alpha"),
    Fault("metal for glass", of("metallic", lambda v, _: 1 - v), ("metallic.",)),
    Fault("shading doubled", of("shading", lambda v, _: 2 * v), ("shading.psnr",)),
    Fault("irradiance of one light doubled", of("irradiance.desk", lambda v, _: 2 * v), ("irradiance.psnr",)),
    Fault("half the share of one light", of("radiance.lamp", lambda v, _: v / 2),
          ("light_share.psnr", "light_off.")),
    Fault("half a pixel", of("radiance", lambda v, _: half_right(v)), VIEWS,
          "novel_view.psnr", "pictures look moved by 0 pixels down and 0.5 right"),
    Fault("one pixel", of("radiance", lambda v, _: np.roll(v, -1, axis=0)), VIEWS,
          "novel_view.psnr", "pictures look moved by -1 pixels down and 0 right"),
    Fault("mirrored", each(lambda v: v[:, ::-1]), (*PIXELS, "light.intensity.channel"),
          "novel_view.psnr", "pictures look mirrored: left and right"),
    Fault("as displayed", of("radiance", lambda v, _: srgb_encode(v * 0.45)), VIEWS,
          "novel_view.psnr", "radiance looks as displayed"),
    Fault("exposed", of("radiance", lambda v, _: v * 0.45), VIEWS,
          "novel_view.psnr", "radiance looks multiplied by the exposure"),
    Fault("clipped at 1", of("radiance", lambda v, _: np.minimum(v, 1)), VIEWS,
          "novel_view.psnr", "radiance looks clipped at 1"),
    Fault("lights in the wrong frame", nothing,
          ("light.", "irradiance.psnr", "light_share.psnr", "light_off."),
          "light.position", 'positions look like the camera\'s axes: set "frame": "camera"',
          lights=(replace(LAMP, frame="world"),)),
    Fault("lights exchanged", nothing, ("light.intensity", "light.chromaticity"),
          "light.intensity", "intensities look exchanged: lamp has that of desk",
          lights=(replace(LAMP, intensity=DESK.intensity), replace(DESK, intensity=LAMP.intensity))),
    Fault("lights times π", nothing, ("light.intensity",),
          "light.intensity", "intensities look multiplied by π", lights=TWICE_LIT),
    Fault("mask inverted", mask_inverted, ("counterfactual.",),
          "counterfactual.psnr", "counterfactual.radiance keeps the object and changes the rest"),
    Fault("background included", with_background, ()),
)  # fmt: skip


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    folder = enrich(write_tiny(tmp_path_factory.mktemp("faults"), track="tabletop"))
    truth = open_truth(folder / "truth")
    for view in truth.views:
        write_layers(folder / "truth" / "views" / f"{view.name}.exr", lit_apart(truth.layers(view)))
    write_manifest(folder / "truth", manifest_of(truth))
    return folder


def lit_apart(layers: Layers) -> Layers:
    """With a metal whose edge is nowhere in the middle, and the light of each lamp apart."""
    columns = np.arange(layers["depth"].shape[1]) / layers["depth"].shape[1]
    share = {"lamp": 0.3 + 0.5 * columns[:, None], "desk": 0.7 - 0.5 * columns[:, None]}
    apart = {f"radiance.{name}": layers["radiance"] * share[name] for name in NAMES}
    apart |= {f"irradiance.{name}": np.pi * layers["shading"] * share[name] for name in NAMES}
    metal = {"metallic": np.where(columns < 0.3, 1.0, 0.1) * np.ones_like(layers["depth"])}
    return layers | {k: v.astype(np.float32) for k, v in (apart | metal).items()}


@pytest.fixture
def sheet_of(scene: Path, predict: Predict) -> Callable[..., ScoreSheet]:
    truth = open_truth(scene / "truth", check=False)

    def make(change: Change, lights: tuple[Light, ...] = (LAMP, DESK)) -> ScoreSheet:
        def handed_in(view: View, layers: Layers) -> Mapping[str, np.ndarray] | None:
            true = truth.layers(view)
            made = change(view, {name: true[name] for name in HANDED_IN})
            return made and {name: values.astype(np.float32) for name, values in made.items()}

        return ge.score_predictions(predict(scene, handed_in, lights=lights), scene)

    return make


def results(sheet: ScoreSheet) -> dict[str, tuple[str, float]]:
    """Status and value; above 100 dB there is nothing but rounding to float32."""
    values = {s.metric: -1.0 if s.value is None else float(s.value) for s in sheet.scores}
    rounded = {m: min(v, 100.0) if "psnr" in m else round(v, 4) for m, v in values.items()}
    return {s.metric: (s.status, round(rounded[s.metric], 3)) for s in sheet.scores}


def hints(sheet: ScoreSheet) -> list[tuple[str, str]]:
    return [(s.metric, w) for s in sheet.scores for w in s.warnings if " look" in w or " keeps " in w]


@pytest.mark.parametrize("fault", FAULTS, ids=str)
def test_a_fault_touches_its_scores_and_is_named(fault: Fault, sheet_of: Callable[..., ScoreSheet]) -> None:
    before, sheet = results(sheet_of(nothing)), sheet_of(fault.change, fault.lights)
    if len(fault.lights) == 1:
        before = results(sheet_of(nothing, (LAMP,)))
    after = results(sheet)
    touched = {metric for metric in before if before[metric] != after[metric]}
    assert all(metric.startswith(fault.touches) for metric in touched)
    for start in fault.touches:
        judged = [metric for metric in before if metric.startswith(start)]
        assert 4 * len(touched.intersection(judged)) >= len(judged) > 0, start  # a gauge hides a gain
    found = hints(sheet)
    if not fault.beside:
        assert found == []
        return
    assert fault.beside in {metric for metric, _ in found}
    assert any(metric == fault.beside and fault.says in says for metric, says in found), found


def test_a_gain_of_each_channel_leaves_the_gauged_scores(sheet_of: Callable[..., ScoreSheet]) -> None:
    before, after = results(sheet_of(nothing)), results(sheet_of(FAULTS[0].change))
    for metric in ("albedo.psnr.channel", "albedo.ssim", "albedo.leakage", "novel_view.psnr"):
        assert before[metric] == after[metric]
    for metric in ("albedo.psnr.raw", "albedo.psnr.scalar", "albedo.ciede2000", "albedo.lmse"):
        assert before[metric] != after[metric]


def test_views_that_were_exchanged_are_named(sheet_of: Callable[..., ScoreSheet], scene: Path) -> None:
    truth = open_truth(scene / "truth", check=False)
    other = {"test_001": "test_003", "test_003": "test_001"}

    def exchanged(view: View, layers: Layers) -> Layers:
        true = truth.layers(truth.view(other.get(view.name, view.name)))
        return {name: true[name] for name in HANDED_IN}

    found = hints(sheet_of(exchanged))
    assert [metric for metric, _ in found] == ["novel_view.psnr"]
    assert "views look exchanged: test_001 shows test_003, test_003 shows test_001" in found[0][1]


def test_a_missing_view_fails_and_is_named(sheet_of: Callable[..., ScoreSheet]) -> None:
    sheet = sheet_of(lambda view, layers: None if view.name == "test_003" else layers)
    score = sheet.score("novel_view.psnr")
    assert (score.status, score.value) == ("failed", None)
    assert "test_003: expected radiance in views/test_003.exr, got no file" in score.reason


def noisy(view: View, layers: Layers) -> Layers:
    rng = np.random.default_rng(len(view.name))
    return {k: v * rng.uniform(0.85, 1.15, v.shape) for k, v in layers.items()}


def blurred(view: View, layers: Layers) -> Layers:
    finite = {k: np.where(np.isfinite(v), v, 10.0) for k, v in layers.items()}
    return {k: gaussian_filter(v, (1.2, 1.2) + (0,) * (v.ndim - 2)) for k, v in finite.items()}


def gray(view: View, layers: Layers) -> Layers:
    flat = {name: np.full_like(layers[name], 0.18) for name in ("base_color", "radiance", "roughness")}
    return flat | {"normal": -view.camera.rays(), "depth": np.full_like(layers["depth"], 3.0)}


def mean_picture(view: View, layers: Layers) -> Layers:
    """The same for all views, and by chance closest to another one."""
    return layers | {"radiance": np.full_like(layers["radiance"], 0.05 if view.name == "test_001" else 2.0)}


def photograph(view: View, layers: Layers) -> Layers:
    """The picture as albedo, and as the picture without the object."""
    return layers | {"base_color": layers["radiance"] * 0.45, "counterfactual.radiance": layers["radiance"]}


def retinex(view: View, layers: Layers) -> Layers:
    """Illumination taken for a blurred picture."""
    light = gaussian_filter(layers["radiance"], (4, 4, 0))
    return layers | {"base_color": 0.3 * layers["radiance"] / np.maximum(light, 1e-3)}


def baked(view: View, layers: Layers) -> Layers:
    tint = np.linspace(0.3, 1, layers["depth"].shape[1])[:, None]
    return layers | {"base_color": layers["base_color"] * tint, "normal": layers["normal"] + 0.3}


def near(view: View, layers: Layers) -> Layers:
    """Discs of a fit that has only begun: all a little too near."""
    return layers | {"depth": 0.94 * layers["depth"]}


@pytest.mark.parametrize(
    "honest", [nothing, noisy, blurred, gray, mean_picture, photograph, retinex, baked, near]
)
def test_honest_predictions_draw_no_hint(honest: Change, sheet_of: Callable[..., ScoreSheet]) -> None:
    assert hints(sheet_of(honest)) == []


def test_honest_lights_draw_no_hint(sheet_of: Callable[..., ScoreSheet]) -> None:
    near = tuple(
        replace(x, position=tuple(p + 0.1 for p in x.position), intensity=tuple(1.3 * i for i in x.intensity))
        for x in (LAMP, DESK)
    )
    dark = replace(DESK, intensity=(0.0, 0.0, 0.0))
    for lights in (near, near[::-1], (LAMP,), (), (LAMP, dark)):
        assert hints(sheet_of(nothing, lights)) == []


def test_a_faulty_layer_draws_no_hint(sheet_of: Callable[..., ScoreSheet]) -> None:
    sheet = sheet_of(lambda view, layers: {name: values * np.nan for name, values in layers.items()})
    assert hints(sheet) == []
    assert sheet.score("normal.mean_angle").status == "failed"
