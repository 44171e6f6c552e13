# SPDX-License-Identifier: Apache-2.0
"""Scene folders: what they hold, and that they are whole or not there, whatever happens in between."""

import json
import os
import shutil
import signal
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graycard import (
    TRACKS,
    Camera,
    DatasetError,
    OutputError,
    RenderError,
    View,
    capture_folders,
    look_at,
    open_capture,
    open_truth,
)
from graycard.io import read_layers, read_manifest, sha256, to_builtins, writable_folder, write_json
from graycard.io._lock import file_lock
from graycard.layers import find_fault
from graycard.synth import (
    GENERATOR_VERSION,
    CaptureSettings,
    RenderSettings,
    SceneSpec,
    all_families,
    find_llvm,
    find_scene,
    render_scene,
    scene_name,
)
from graycard.synth.dataset._identity import identity
from graycard.synth.dataset._store import Place, reopen
from graycard.synth.families._family import count
from graycard.synth.families._tables import GlossyTable
from graycard.synth.verify._subject import Rebuilt, rebuild

TINY = RenderSettings(20, 16, 3, 1, 4, 3)
TABLE = SceneSpec("tabletop", "glossy-table", 0)
TABLE_RENDERINGS = 4 + 3
"""Views, and the held-out one under each change of the two lights: nothing is a sum in ``scalar_rgb``."""
KEPT = {"train_000": 0, "test_002": 2, "train_003": 3}
"""Pictures that are kept of a rendering that is killed as it begins these views."""
AMONG_RELIT = "test_002 without-room"
"""The last moment to kill at: all views are kept, and a held-out one under the first change of lights."""
HIDDEN = {"DRJIT_LIBLLVM_PATH": "/nowhere/libLLVM.so"}

RunPython = Callable[..., subprocess.CompletedProcess[str]]

RENDER = """
import os, signal, sys, json
import graycard.synth as synth
from graycard.io import from_builtins
spec, settings, out, threads, kill_at = json.loads(sys.argv[1])
def progress(done, doing):
    if kill_at and kill_at in doing:
        os.kill(os.getpid(), signal.SIGKILL)
spec, settings = from_builtins(synth.SceneSpec, spec), from_builtins(synth.RenderSettings, settings)
print(synth.render_scene(spec, settings, out, progress, threads))
print("mitsuba" in sys.modules, "colour" in sys.modules)
"""


@pytest.fixture(scope="session")
def in_process(run_python: RunPython) -> RunPython:
    """``in_process(out, spec, threads, kill_at, hide)`` renders in a process of its own."""

    def run(
        out: Path, spec: SceneSpec = TABLE, threads: int | None = None, kill_at: str = "", hide: bool = True
    ) -> subprocess.CompletedProcess[str]:
        request = json.dumps([to_builtins(spec), to_builtins(TINY), str(out), threads, kill_at])
        return run_python(RENDER, request, **(HIDDEN if hide else {}))

    return run


def bits(folder: Path) -> dict[str, str]:
    """Hash of each file, hidden ones as well."""
    return {str(p.relative_to(folder)): sha256(p) for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="session")
def told() -> dict[str, list[tuple[float, str]]]:
    """Progress that the rendering of each track has told of."""
    return {track: [] for track in TRACKS}


@pytest.fixture(scope="session")
def rendered(
    tmp_path_factory: pytest.TempPathFactory, told: dict[str, list[tuple[float, str]]]
) -> dict[str, Path]:
    """One tiny scene a track, not to be changed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DRJIT_LIBLLVM_PATH", HIDDEN["DRJIT_LIBLLVM_PATH"])
        out = tmp_path_factory.mktemp("rendered")
        specs = [SceneSpec("dark", "corridor", 0), TABLE, SceneSpec("multilight", "studio", 0)]
        found = {}
        for spec in specs:
            heard = told[spec.track]
            found[spec.track] = render_scene(
                spec, TINY, out, lambda done, doing, heard=heard: heard.append((done, doing)), threads=2
            )
        return found


@pytest.fixture
def table(rendered: dict[str, Path], tmp_path: Path, no_llvm: str) -> Path:
    """A copy of the tabletop scene in a dataset of its own."""
    target = tmp_path / "dataset" / "tabletop" / rendered["tabletop"].name
    shutil.copytree(rendered["tabletop"], target)
    return target


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


def test_a_second_call_finds_the_scene_and_imports_no_renderer(table: Path, in_process: RunPython) -> None:
    before = bits(table)
    stamps = {p: p.stat().st_mtime_ns for p in table.rglob("*")}
    done = in_process(table.parent.parent)
    assert done.stdout.split() == [str(table), "False", "False"]
    assert bits(table) == before
    assert {p: p.stat().st_mtime_ns for p in table.rglob("*")} == stamps


@pytest.mark.parametrize("threads", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_another_process_gives_the_same_bits(
    rendered: dict[str, Path], tmp_path: Path, threads: int, in_process: RunPython
) -> None:
    """One thread where the first had two is the harder case."""
    done = in_process(tmp_path, threads=threads)
    assert done.returncode == 0, done.stderr
    assert bits(tmp_path / "tabletop") == bits(rendered["tabletop"].parent)


@pytest.mark.slow
def test_llvm_gives_the_same_bits_with_one_and_two_threads(tmp_path: Path, in_process: RunPython) -> None:
    """Whole folders; ``test_synth_relighting.py`` has pictures alone."""
    if not find_llvm().usable:
        pytest.skip("no LLVM library here")
    spec = SceneSpec("multilight", "studio", 3)
    for threads in (1, 2):
        done = in_process(tmp_path / str(threads), spec, threads, hide=False)
        assert done.returncode == 0, done.stderr
    assert bits(tmp_path / "1") == bits(tmp_path / "2")


@pytest.mark.parametrize("kill_at", [AMONG_RELIT, *(pytest.param(at, marks=pytest.mark.slow) for at in KEPT)])
def test_a_killed_run_goes_on_and_ends_in_the_same_bits(
    rendered: dict[str, Path], tmp_path: Path, kill_at: str, no_llvm: str, in_process: RunPython
) -> None:
    killed = in_process(tmp_path, kill_at=kill_at)
    assert killed.returncode == -signal.SIGKILL
    assert capture_folders(tmp_path) == []
    assert find_scene(TABLE, TINY, tmp_path) is None
    truth = tmp_path / "tabletop" / ".glossy-table-0000.partial" / "truth" / "scene" / "truth"
    kept = {p: p.stat().st_mtime_ns for p in truth.rglob("views/*.exr")}
    assert len(kept) == (KEPT | {AMONG_RELIT: 5})[kill_at]
    heard: list[str] = []
    folder = render_scene(TABLE, TINY, tmp_path, lambda done, doing: heard.append(doing))
    assert len([h for h in heard if "_00" in h]) == TABLE_RENDERINGS - len(kept)
    assert bits(folder.parent) == bits(rendered["tabletop"].parent)


def test_a_broken_view_of_a_killed_run_is_made_anew(rendered: dict[str, Path], table: Path) -> None:
    place = in_the_making(table)
    views = place.partial / "truth" / "views"
    broken = views / "train_000.exr"
    broken.write_bytes(broken.read_bytes()[:500])
    (views / ".test_002.exr.x7f3.partial").write_bytes(b"half an im")
    heard: list[str] = []
    render_scene(TABLE, TINY, table.parent.parent, lambda done, doing: heard.append(doing))
    assert sum("_00" in h for h in heard) == 2
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def in_the_making(table: Path, forgets: str = "") -> Place:
    """Make a whole scene one in the making, without a view, and stamped by code that lacks a knob."""
    place = Place(table.parent.parent, "tabletop", table.name)
    manifest = read_manifest(table / "truth", "graycard-truth")
    stamp = to_builtins(identity(TABLE, TINY)) | {"variant": manifest.generator["variant"]}
    stamp["knobs"].pop(forgets, None)
    reopen(place, stamp, {"truth/views/test_002.exr": "gone"})
    return place


def test_leftovers_of_another_spec_are_not_used(
    rendered: dict[str, Path], tmp_path: Path, no_llvm: str
) -> None:
    place = Place(tmp_path, "tabletop", scene_name(TABLE))
    views = place.partial / "truth" / "views"
    write_json(place.stamp, {"generator": 0, "variant": "scalar_rgb"})
    shutil.copy(rendered["dark"] / "truth" / "views" / "train_000.exr", writable_folder(views))
    folder = render_scene(TABLE, TINY, tmp_path)
    assert bits(folder.parent) == bits(rendered["tabletop"].parent)


DAMAGE = [
    "truth/views/test_002.exr",
    "truth/views/train_000.exr",
    "truth/relighting/without-lamp/views/test_002.exr",
    "truth/relighting/recoloured-lamp/environment.exr",
    "truth/relighting/recoloured-lamp/lights.json",
    "truth/lights.json",
    "truth/environment.exr",
    "truth/truth.json",
    "truth/manifest.json",
    "capture/capture.json",
    "capture/manifest.json",
    "capture/photographs/train_000.exr",
    "capture/masks/target/train_003.exr",
]


def in_ci(name: str, how: str) -> bool:
    """Tell if CI has time: all files but manifests are judged by their hash, whatever happened to them."""
    if name == "truth/manifest.json" and how == "cut":
        return False  # all is rendered anew, as without one
    return how == "changed" or name == DAMAGE[0] or name.endswith("manifest.json")


@pytest.mark.parametrize(
    ("name", "how"),
    [
        pytest.param(name, how, marks=() if in_ci(name, how) else pytest.mark.slow)
        for how in ("missing", "cut", "changed")
        for name in DAMAGE
    ],
)
def test_damage_is_mended_to_the_same_bits(
    rendered: dict[str, Path], table: Path, name: str, how: str
) -> None:
    path = table / name
    data = path.read_bytes()
    match how:
        case "missing":
            path.unlink()
        case "cut":
            path.write_bytes(data[: len(data) // 2])
        case "changed":
            # in a manifest, a digit of a hash: it stays JSON
            at = data.rindex(b'"') - 5 if path.name == "manifest.json" else len(data) // 2
            path.write_bytes(data[:at] + (b"0" if data[at : at + 1] != b"0" else b"1") + data[at + 1 :])
    assert find_scene(TABLE, TINY, table.parent.parent) is None
    heard: list[str] = []
    render_scene(TABLE, TINY, table.parent.parent, lambda done, doing: heard.append(doing))
    assert bits(table.parent) == bits(rendered["tabletop"].parent)
    made = sum("_00" in h for h in heard)
    if name == "truth/manifest.json":
        assert made == TABLE_RENDERINGS if how != "changed" else made <= 1
    else:
        assert made == int("/views/" in name)


def test_a_run_cut_off_between_seal_and_name_goes_on(
    rendered: dict[str, Path], tmp_path: Path, no_llvm: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(place: Place) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("graycard.synth.dataset._render.promote", interrupted)
        with pytest.raises(KeyboardInterrupt):
            render_scene(TABLE, TINY, tmp_path)
    assert capture_folders(tmp_path) == []
    folder = render_scene(TABLE, TINY, tmp_path)
    assert bits(folder.parent) == bits(rendered["tabletop"].parent)


@pytest.mark.parametrize(
    ("call", "complaint"),
    [("os.replace", "expected to rename .* to"), ("shutil.rmtree", "expected to remove")],
)
def test_a_disk_that_refuses_is_named(
    table: Path, monkeypatch: pytest.MonkeyPatch, call: str, complaint: str
) -> None:
    (table / "capture" / "capture.json").unlink()
    Place(table.parent.parent, "tabletop", table.name).work.mkdir()

    real = {"os.replace": os.replace, "shutil.rmtree": shutil.rmtree}[call]

    def refuse(path: Path, *others: Path) -> None:
        if Path(path).is_dir():
            raise PermissionError(13, "Permission denied")
        real(path, *others)

    monkeypatch.setattr(f"graycard.synth.dataset._store.{call}", refuse)
    with pytest.raises(OutputError, match=complaint):
        render_scene(TABLE, TINY, table.parent.parent)


def test_a_mend_uses_the_renderer_of_the_other_views(
    rendered: dict[str, Path], table: Path, in_process: RunPython, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH")
    if not find_llvm().usable:
        pytest.skip("no LLVM library here")
    (table / "truth/views/test_002.exr").unlink()
    done = in_process(table.parent.parent, hide=False)
    assert done.returncode == 0, done.stderr
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def test_views_of_a_renderer_that_is_not_here_are_made_anew(rendered: dict[str, Path], table: Path) -> None:
    manifest = json.loads((table / "truth/manifest.json").read_text())
    manifest["generator"]["variant"] = "llvm_ad_rgb"
    (table / "truth/manifest.json").write_text(json.dumps(manifest))
    (table / "truth/views/test_002.exr").unlink()
    heard: list[str] = []
    render_scene(TABLE, TINY, table.parent.parent, lambda done, doing: heard.append(doing))
    assert sum("_00" in h for h in heard) == TABLE_RENDERINGS
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def test_a_scene_that_lost_its_capture_gets_it_back(rendered: dict[str, Path], table: Path) -> None:
    shutil.rmtree(table / "capture")
    render_scene(TABLE, TINY, table.parent.parent)
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def test_a_mend_that_is_killed_goes_on(rendered: dict[str, Path], table: Path, in_process: RunPython) -> None:
    (table / "truth/views/test_002.exr").unlink()
    killed = in_process(table.parent.parent, kill_at="test_002")
    assert killed.returncode == -signal.SIGKILL
    assert not table.exists()
    render_scene(TABLE, TINY, table.parent.parent)
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


@pytest.mark.parametrize(
    ("settings", "difference"),
    [
        (RenderSettings(24, 16, 3, 1, 4, 3), r"render.width: expected 24, got 20"),
        (RenderSettings(20, 16, 3, 1, 64, 3), r"render.samples: expected 64, got 4"),
        (RenderSettings(20, 16, 4, 1, 4, 3), r"render.train_views: expected 4, got 3"),
    ],
)
def test_a_scene_of_other_settings_is_left_alone(
    table: Path, settings: RenderSettings, difference: str
) -> None:
    before = bits(table)
    with pytest.raises(DatasetError, match=f"{difference}.*Choose another output folder"):
        render_scene(TABLE, settings, table.parent.parent)
    assert bits(table) == before


@dataclass(frozen=True, slots=True)
class LaterTable(GlossyTable):
    """The family after it has gained a knob."""

    cartons: int = count(3, 0, 9)


@dataclass(frozen=True, slots=True)
class LaterSettings(RenderSettings):
    """Settings after they have gained one."""

    haze: float = 0.0


LATER = LaterSettings(20, 16, 3, 1, 4, 3)


@pytest.fixture
def later(monkeypatch: pytest.MonkeyPatch) -> None:
    """A version of graycard whose glossy tables have one more knob."""
    families = all_families() | {"glossy-table": LaterTable}
    monkeypatch.setattr("graycard.synth.families._catalogue._FAMILIES", tuple(families.values()))


@pytest.mark.usefixtures("later")
def test_a_scene_of_before_a_knob_and_a_setting_were_added_is_this_very_scene(table: Path) -> None:
    before = bits(table)
    assert scene_name(TABLE) == table.name
    assert find_scene(TABLE, LATER, table.parent.parent) == table
    assert render_scene(TABLE, LATER, table.parent.parent) == table
    assert bits(table) == before


@pytest.mark.usefixtures("later")
def test_a_scene_of_before_is_none_with_another_value_of_what_was_added(table: Path) -> None:
    with pytest.raises(DatasetError, match=r"render.haze: expected 0.5, got 0.0\).*Choose another output"):
        find_scene(TABLE, replace(LATER, haze=0.5), table.parent.parent)
    changed = replace(TABLE, knobs={"cartons": 5})
    shutil.move(table, table.with_name(scene_name(changed)))
    with pytest.raises(DatasetError, match=r"\(knobs.cartons: expected 5, got 3\)"):
        find_scene(changed, LATER, table.parent.parent)


def change_manifest(scene: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    path = scene / "truth" / "manifest.json"
    manifest = json.loads(path.read_text())
    change(manifest["settings"])
    path.write_text(json.dumps(manifest))


def test_what_a_manifest_of_before_does_not_name_had_its_default(table: Path) -> None:
    def forget(settings: dict[str, Any]) -> None:
        del settings["knobs"]["roughness"], settings["render"]["capture"]["bits"]

    change_manifest(table, forget)
    assert find_scene(TABLE, TINY, table.parent.parent) == table
    noisy = replace(TINY, capture=CaptureSettings(bits=8))
    with pytest.raises(DatasetError, match=r"\(render.capture.bits: expected 8, got 0\)"):
        find_scene(TABLE, noisy, table.parent.parent)


@pytest.mark.parametrize(
    ("part", "difference"), [("knobs", r"knobs.cartons: .*with 3"), ("render", r"render.cartons: .*with 3")]
)
def test_a_scene_with_a_knob_that_is_gone_is_refused(table: Path, part: str, difference: str) -> None:
    change_manifest(table, lambda settings: settings[part].update(cartons=3))
    with pytest.raises(DatasetError, match=rf"\({difference}\)\. Choose another output folder"):
        find_scene(TABLE, TINY, table.parent.parent)


def test_a_damaged_scene_of_before_is_mended_with_the_pictures_that_it_has(
    rendered: dict[str, Path], table: Path
) -> None:
    change_manifest(table, lambda settings: settings["knobs"].pop("roughness"))
    (table / "truth/views/test_002.exr").unlink()
    heard: list[str] = []
    render_scene(TABLE, TINY, table.parent.parent, lambda done, doing: heard.append(doing))
    assert sum("_00" in h for h in heard) == 1
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


def test_a_scene_in_the_making_of_before_goes_on(rendered: dict[str, Path], table: Path) -> None:
    """Cut off before a knob was added, and taken up again after."""
    in_the_making(table, forgets="roughness")
    heard: list[str] = []
    render_scene(TABLE, TINY, table.parent.parent, lambda done, doing: heard.append(doing))
    assert sum("_00" in h for h in heard) == 1
    assert bits(table.parent) == bits(rendered["tabletop"].parent)


@pytest.mark.usefixtures("later")
def test_a_scene_of_before_is_verified_as_this_very_scene(table: Path) -> None:
    rebuilt = rebuild(read_manifest(table / "truth", "graycard-truth"))
    assert isinstance(rebuilt, Rebuilt)
    assert scene_name(rebuilt.spec) == table.name
    assert rebuilt.scene.views == open_truth(table / "truth").views


@pytest.mark.parametrize(
    ("part", "change", "difference"),
    [
        ("seeds", {"scene": 7}, "seed: expected 0, got 7"),
        ("generator", {"generator": 0}, f"generator: expected {GENERATOR_VERSION}, got 0"),
        ("settings", {"knobs": {"roughness": 0.5}}, "knobs.roughness: expected 0.2, got 0.5"),
    ],
)
def test_a_scene_of_another_spec_is_left_alone(
    table: Path, part: str, change: dict[str, Any], difference: str
) -> None:
    path = table / "truth" / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest[part] |= change
    path.write_text(json.dumps(manifest))
    with pytest.raises(DatasetError, match=difference):
        render_scene(TABLE, TINY, table.parent.parent)


@pytest.mark.parametrize("part", ["capture", "truth"])
def test_a_newer_format_is_left_alone(table: Path, part: str) -> None:
    path = table / part / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format_version": 99}))
    with pytest.raises(DatasetError, match="got version 99"):
        render_scene(TABLE, TINY, table.parent.parent)


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    thesis = tmp_path / "tabletop" / "glossy-table-0000" / "thesis.tex"
    thesis.parent.mkdir(parents=True)
    thesis.write_text("years of work")
    with pytest.raises(DatasetError, match=r"got thesis.tex in it. Choose another"):
        render_scene(TABLE, TINY, tmp_path)
    assert thesis.read_text() == "years of work"


def test_a_file_in_the_place_of_the_scene_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "tabletop" / "glossy-table-0000"
    path.parent.mkdir()
    path.write_text("x")
    with pytest.raises(DatasetError, match="Choose another"):
        render_scene(TABLE, TINY, tmp_path)


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


def test_two_processes_make_a_scene_once(tmp_path: Path, in_process: RunPython) -> None:
    """The second waits for the lock, then finds the scene whole: its files are not written again."""
    results: list[subprocess.CompletedProcess[str]] = []
    workers = [threading.Thread(target=lambda: results.append(in_process(tmp_path))) for _ in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert [r.returncode for r in results] == [0, 0], results
    assert sorted(p.name for p in (tmp_path / "tabletop").iterdir()) == ["glossy-table-0000"]


def test_the_lock_is_held_by_one_and_leaves_nothing(tmp_path: Path) -> None:
    order: list[str] = []
    inside, waiting = threading.Event(), threading.Event()

    def second() -> None:
        inside.wait(10)
        with file_lock(tmp_path / "lock", lambda who: waiting.set()):
            order.append("second")

    thread = threading.Thread(target=second)
    thread.start()
    with file_lock(tmp_path / "lock", lambda who: order.append("waited for nothing")):
        inside.set()
        assert waiting.wait(10)
        order.append("first")
    thread.join()
    assert order == ["first", "second"]
    assert list(tmp_path.iterdir()) == []
