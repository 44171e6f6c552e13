# SPDX-License-Identifier: Apache-2.0
"""Scene folders: what they hold, what rendering says on its way, and what it refuses."""

from pathlib import Path

import numpy as np
import pytest

from graycard import (
    TRACKS,
    Camera,
    OutputError,
    RenderError,
    View,
    capture_folders,
    look_at,
    open_capture,
    open_truth,
)
from graycard.io import read_layers, read_manifest, to_builtins
from graycard.layers import find_fault
from graycard.synth import (
    SceneSpec,
    all_families,
    render_scene,
)
from tiny_tables import TABLE, TINY


@pytest.mark.parametrize("track", TRACKS)
def test_folders_open_and_hold_every_layer(rendered: dict[str, Path], track: str) -> None:
    folder = rendered[track]
    capture, truth = open_capture(folder / "capture"), open_truth(folder / "truth")
    assert capture.views == truth.views
    assert capture.light_on_camera == (track == "dark")
    estimates = {"", ".var", ".half_a", ".half_b"}
    names = {f"radiance{end}" for end in estimates} | {
        "base_color",
        "normal",
        "depth",
        "object_id",
        "pure",
        "position",
    }
    names |= {"distance", "roughness", "alpha", "metallic", "diffuse_reflectance", "f0"}
    if track == "tabletop":
        names |= {f"counterfactual.radiance{end}" for end in estimates}
        names |= {f"counterfactual.{name}" for name in ("normal", "f0", "roughness")}
    for view in truth.views:
        layers = truth.layers(view)
        assert layers.keys() == names
        for name, values in layers.items():
            assert find_fault(name, values, 16, 20) is None
        assert layers["radiance"].min() >= 0
        assert layers["radiance.var"].min() >= 0
        assert layers["radiance.var"].max() > 0


@pytest.mark.parametrize("track", TRACKS)
def test_normals_are_unit_and_face_the_camera(rendered: dict[str, Path], track: str) -> None:
    truth = open_truth(rendered[track] / "truth")
    for view in truth.views:
        layers = truth.layers(view)
        seen = layers["object_id"] > 0
        np.testing.assert_allclose(np.linalg.norm(layers["normal"][seen], axis=-1), 1, atol=1e-5)
        assert (layers["normal"][~seen] == 0).all()
        assert ((layers["normal"] * view.camera.rays()).sum(-1)[seen] <= 1e-6).all()
        assert (np.isfinite(layers["depth"]) == seen).all()


@pytest.mark.parametrize("track", TRACKS)
def test_photographs_are_of_training_views_only(rendered: dict[str, Path], track: str) -> None:
    capture = open_capture(rendered[track] / "capture")
    truth = open_truth(rendered[track] / "truth")
    for view in capture.train:
        assert np.array_equal(capture.photograph(view), truth.layers(view)["radiance"])
    files = {p.stem for p in (rendered[track] / "capture").rglob("*.exr")}
    assert files == {v.name for v in capture.train}


@pytest.mark.parametrize("track", TRACKS)
def test_exposure_brings_the_99th_percentile_to_white(rendered: dict[str, Path], track: str) -> None:
    capture = open_capture(rendered[track] / "capture")
    photographs = [capture.photograph(v) for v in capture.train]
    assert capture.exposure * np.percentile(photographs, 99) == pytest.approx(1)


def test_the_capture_tells_nothing_of_the_scene(rendered: dict[str, Path]) -> None:
    for folder in rendered.values():
        manifest = read_manifest(folder / "capture", "graycard-capture")
        assert not manifest.seeds
        assert not manifest.settings
        assert manifest.generator.keys() == {"name", "version"}


def test_the_truth_tells_how_it_was_made(rendered: dict[str, Path]) -> None:
    manifest = read_manifest(rendered["dark"] / "truth", "graycard-truth")
    assert manifest.seeds == {"scene": 0}
    assert manifest.settings["family"] == "corridor"
    assert manifest.settings["render"] == to_builtins(TINY)
    assert manifest.settings["knobs"]["light_offset"] == 0.25
    assert manifest.generator["variant"] == "scalar_rgb"


def test_target_masks_hold_the_target_where_it_is_seen(rendered: dict[str, Path]) -> None:
    folder = rendered["tabletop"]
    capture, truth = open_capture(folder / "capture"), open_truth(folder / "truth")
    assert capture.target == truth.target
    seen = 0
    for view in capture.train:
        mask = read_layers(folder / "capture" / "masks" / "target" / f"{view.name}.exr")["object_id"]
        ids = truth.layers(view)["object_id"]
        assert np.array_equal(mask, np.where(ids == capture.target, ids, 0))
        seen += int((mask > 0).sum())
    assert seen > 10


def test_the_counterfactual_differs_only_where_the_target_plays_a_part(rendered: dict[str, Path]) -> None:
    truth = open_truth(rendered["tabletop"] / "truth")
    for view in truth.views:
        layers = truth.layers(view)
        same = (layers["radiance"] == layers["counterfactual.radiance"]).all(-1)
        background = layers["object_id"] == 0
        assert same.mean() > 0.05
        assert not same[layers["object_id"] == truth.target].any()
        assert background.sum() == 0 or same[background].mean() > 0.7


def test_lights_are_those_of_the_scene(rendered: dict[str, Path]) -> None:
    for track, folder in rendered.items():
        truth = open_truth(folder / "truth")
        family = all_families()[truth.scene.rpartition("-")[0]]
        scene = family().build(0, TINY)
        assert truth.lights() == scene.lights, track
        assert (folder / "truth" / "environment.exr").is_file() == (scene.sky is not None)
        emitters = {o.name for o in truth.objects if o.emits}
        assert emitters == {x.name for x in truth.lights() if hasattr(x, "radiance")}


def test_the_diameter_spans_cameras_and_what_they_see(rendered: dict[str, Path]) -> None:
    truth = open_truth(rendered["dark"] / "truth")
    assert 5 < truth.diameter < np.linalg.norm((7.0, 2.6, 3.4))


def test_every_base_color_of_an_emitter_is_black(rendered: dict[str, Path]) -> None:
    for folder in rendered.values():
        truth = open_truth(folder / "truth")
        for view in truth.views:
            layers = truth.layers(view)
            lamp = np.isin(layers["object_id"], list(truth.emitter_ids()))
            assert (layers["base_color"][lamp] == 0).all()


def test_the_chart_shows_its_measured_colors() -> None:
    """A camera in front of the studio's chart sees each patch in its place."""
    from graycard.synth import Quad, Scene, use_renderer
    from graycard.synth._spectra import chart_patches
    from graycard.synth.families._studio import _chart
    from graycard.synth.layers._views import surface_layers
    from graycard.synth.renderer._mitsuba import load_scene

    use_renderer(variant="scalar_rgb")
    chart = _chart()
    assert isinstance(chart.geometry, Quad)
    centre = np.array(chart.geometry.center)
    camera = Camera.from_fov(96, 64, 36, look_at(centre + np.array([1.0, 0, 0]), centre))
    scene = Scene((chart,), (), (View("train_000", "train", camera),))
    color = surface_layers(load_scene(scene, camera), scene, camera)["base_color"]
    for number, reflectance in enumerate(chart_patches().values()):
        row, column = divmod(number, 6)
        across, up = (column + 0.5) / 3 - 1, 1 - (row + 0.5) / 2
        point = centre + across * np.array(chart.geometry.half_u) + up * np.array(chart.geometry.half_v)
        x, y = camera.project(point)[0]
        np.testing.assert_allclose(color[int(y), int(x)], reflectance, atol=1e-6)


def test_an_output_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("x")
    with pytest.raises(OutputError, match="expected an output folder that can be written to"):
        render_scene(TABLE, TINY, tmp_path / "out")


def test_a_black_scene_is_refused(tmp_path: Path, no_llvm: str) -> None:
    spec = SceneSpec("tabletop", "glossy-table", 0, {"lamp": 0.0, "daylight": 0.0})
    with pytest.raises(RenderError, match="expected a scene with light in it"):
        render_scene(spec, TINY, tmp_path)
    assert capture_folders(tmp_path) == []


@pytest.mark.usefixtures("rendered")
def test_progress_never_goes_back_and_ends_at_one(told: dict[str, list[tuple[float, str]]]) -> None:
    for heard in told.values():
        shares = [share for share, _ in heard]
        assert shares == sorted(shares)
        assert shares[-1] == 1
    assert "picture 3 of 7, test_002" in [doing for _, doing in told["tabletop"]]
