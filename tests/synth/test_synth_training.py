# SPDX-License-Identifier: Apache-2.0
"""Training views of which no more is rendered than methods, gauges and priors need, from fewer paths."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fault_planting import failures, reseal
from graycard import Camera, DatasetError, Truth, View, open_truth
from graycard.colour import display_variance
from graycard.io import read_json, read_layers, write_json, write_layers
from graycard.synth import RenderSettings, SceneSpec, _spec, render_scene
from graycard.synth._spec import DIRECTIONS, TRAINING_DIRECTIONS
from graycard.synth.verify import verify_dataset
from graycard.synth.verify._run import _chosen

ALL = RenderSettings(24, 20, train_views=3, test_views=1, samples=64)
NEEDED = replace(ALL, training_layers="needed")
NOISY = replace(NEEDED, training_samples=16)
SPECS = {
    "dark": SceneSpec("dark", "corridor", 1000),
    "tabletop": SceneSpec("tabletop", "glossy-table", 1000),
}
SPLIT = ("direct.", "indirect.", "irradiance.", "visibility.", "effect.")
WITHOUT_TARGET = {f"counterfactual.{name}" for name in ("radiance", "diffuse", "normal", "f0", "roughness")}
OF_DEPTH = {"distance", "position"}


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


@pytest.fixture(params=["tabletop", pytest.param("dark", marks=pytest.mark.slow)])
def truths(request: pytest.FixtureRequest, rendered: Callable[[str], dict[str, Truth]]) -> dict[str, Truth]:
    """Those of one track."""
    return rendered(request.param)


def of_split(truth: Truth, split: str) -> list[View]:
    return [view for view in truth.views if view.split == split]


def file_of(truth: Truth, view: View) -> Path:
    assert truth.root is not None
    return truth.root / "views" / f"{view.name}.exr"


def copied(truth: Truth, to: Path) -> Path:
    """Return a copy of a scene's folder in another dataset."""
    assert truth.root is not None
    scene = truth.root.parent
    return Path(shutil.copytree(scene, to / scene.parent.name / scene.name))


def differing(one: Truth, other: Truth, view: View) -> set[str]:
    """Layers of a view in ``other`` whose bits are not those of ``one``."""
    before, after = one.layers(view), other.layers(view)
    return {name for name, values in after.items() if not np.array_equal(before[name], values, True)}


def test_training_views_hold_what_is_needed_with_the_same_bits(truths: dict[str, Truth]) -> None:
    for view in of_split(truths["all"], "train"):
        held = truths["needed"].layers(view).keys()
        assert not [name for name in held if name.startswith(SPLIT)]
        assert {"radiance", "radiance.var", "base_color", "normal", "depth", "pure"} <= held
        assert not [name for name in held if name.endswith((".half_a", ".half_b"))]
        assert {name for name in held if name.startswith("counterfactual.")} <= WITHOUT_TARGET
        assert differing(truths["all"], truths["needed"], view) <= {"albedo", *OF_DEPTH}
        albedo = [truths[name].layers(view)["albedo"] for name in ("all", "needed")]
        assert np.abs(albedo[0] - albedo[1]).mean() < 5e-3


def test_what_follows_from_depth_is_in_no_file_and_is_read(truths: dict[str, Truth]) -> None:
    for view in of_split(truths["all"], "train"):
        assert not OF_DEPTH & read_layers(file_of(truths["needed"], view)).keys()
        before, after = (truths[name].layers(view) for name in ("all", "needed"))
        for name in OF_DEPTH:
            np.testing.assert_allclose(after[name], before[name], atol=1e-5)


def test_files_are_small(truths: dict[str, Truth]) -> None:
    for split, share in (("train", 0.3), ("test", 0.9)):
        before, after = (
            sum(file_of(truths[name], view).stat().st_size for view in of_split(truths[name], split))
            for name in ("all", "needed")
        )
        assert after < share * before


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


def test_such_scenes_are_verified(truths: dict[str, Truth], monkeypatch: pytest.MonkeyPatch) -> None:
    """Each albedo is held against one from as many directions: noise of others is not symmetric."""
    from graycard.synth.verify import _second_rendering

    root, asked, albedo_of = truths["noisy"].root, [], _second_rendering.directional_albedo

    def albedo(loaded: Any, camera: Camera, seed: int, samples: int) -> dict[str, np.ndarray]:
        asked.append(samples)
        return albedo_of(loaded, camera, seed, samples)

    monkeypatch.setattr(_second_rendering, "directional_albedo", albedo)
    assert root is not None
    verdict = verify_dataset(root.parents[2], views=2)
    assert [check for check in verdict.checks if check.status == "failed"] == []
    made = {check.name for check in verdict.checks if check.status == "passed"}
    assert {"radiance again: variance", "lights again: level"} <= made
    assert asked == [TRAINING_DIRECTIONS, DIRECTIONS], "of a training view, and of a held-out one"


def test_scenes_that_are_traced_in_bands_are_verified(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Noise is that of pictures at once, of which verify renders some again."""
    from graycard.synth.renderer import _wavefront

    for module in (_spec, _wavefront):
        monkeypatch.setattr(module, "MOST_PATHS", 24 * 16 * 7)
    root = render_scene(SPECS["tabletop"], NOISY, tmp_path)
    assert read_json(root / "truth" / "manifest.json")["settings"]["bands"] == 1
    verdict = verify_dataset(tmp_path, views=2)
    assert [check for check in verdict.checks if check.status == "failed"] == []


@pytest.mark.parametrize(
    ("split", "views", "chosen"), [([2, 5], 3, [0, 5, 7]), ([0, 3], 3, [0, 4, 7]), ([], 2, [0, 7])]
)
def test_a_view_with_its_light_told_apart_is_rendered_again(
    split: list[int], views: int, chosen: list[int]
) -> None:
    assert _chosen(range(8), split, views) == chosen


def plant(scene: Path, name: str, change: Callable[[dict[str, np.ndarray], View], None]) -> None:
    path, truth = scene / "truth" / "views" / f"{name}.exr", open_truth(scene / "truth", check=False)
    layers = read_layers(path)
    change(layers, truth.view(name))
    write_layers(path, layers)


def test_faults_of_training_views_are_found(
    rendered: Callable[[str], dict[str, Truth]], tmp_path: Path
) -> None:
    """Each view has one of its own."""

    def ray_distance_as_z(layers: dict[str, np.ndarray], view: View) -> None:
        layers["depth"] = layers["depth"] / (view.camera.rays() @ view.camera.forward)

    def variance_of_an_image(layers: dict[str, np.ndarray], view: View) -> None:
        layers["radiance.var"] = layers["radiance.var"] * 8

    def another_paint(layers: dict[str, np.ndarray], view: View) -> None:
        layers["radiance"] = layers["radiance"] * (1 + 0.9 * (-1) ** np.arange(20)[:, None, None])

    scene = copied(rendered("dark")["noisy"], tmp_path)
    names = [view.name for view in of_split(rendered("dark")["noisy"], "train")]
    for name, change in zip(names, (ray_distance_as_z, variance_of_an_image, another_paint), strict=True):
        plant(scene, name, change)
    reseal(scene)
    found = failures(scene, 4)
    assert {"position again", "radiance again: variance", "radiance again: pattern"} <= found.keys()
    assert {"noise ceiling of photographs", "photograph is the radiance"} <= found.keys()


def test_a_layer_without_the_target_that_is_lost_is_missed(
    rendered: Callable[[str], dict[str, Truth]], tmp_path: Path
) -> None:
    def drop_diffuse(layers: dict[str, np.ndarray], view: View) -> None:
        del layers["counterfactual.diffuse"]

    scene = copied(rendered("tabletop")["needed"], tmp_path)
    for view in rendered("tabletop")["needed"].views:
        plant(scene, view.name, drop_diffuse)
    reseal(scene)
    reasons = failures(scene, 0)["layers present"]
    assert len(reasons) == 4
    assert all("missing are counterfactual.diffuse" in reason for reason in reasons)


def test_what_follows_from_depth_is_missed_where_all_layers_are_kept(
    rendered: Callable[[str], dict[str, Truth]], tmp_path: Path
) -> None:
    def drop_position(layers: dict[str, np.ndarray], view: View) -> None:
        del layers["distance"], layers["position"]

    scene = copied(rendered("dark")["all"], tmp_path)
    plant(scene, rendered("dark")["all"].views[0].name, drop_position)
    reseal(scene)
    assert "missing are distance, position" in failures(scene, 0)["layers present"][0]


def test_scenes_of_other_layers_are_not_taken_for_these(
    rendered: Callable[[str], dict[str, Truth]], tmp_path: Path
) -> None:
    """Scenes before version 2 name none; those with all layers never do."""
    scene = copied(rendered("dark")["needed"], tmp_path)
    path = scene / "truth" / "manifest.json"
    manifest = read_json(path)
    assert manifest["settings"].pop("needed_layers") == 2
    write_json(path, manifest)
    with pytest.raises(DatasetError, match="needed_layers: expected 2, got None"):
        render_scene(SPECS["dark"], NEEDED, tmp_path)
    root = rendered("dark")["all"].root
    assert root is not None
    assert "needed_layers" not in read_json(root / "manifest.json")["settings"]


def test_scenes_of_other_bands_are_not_taken_for_these(
    rendered: Callable[[str], dict[str, Truth]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pictures that are traced at once name none."""
    scene = copied(rendered("dark")["needed"], tmp_path)
    path = scene / "truth" / "manifest.json"
    manifest = read_json(path)
    assert "bands" not in manifest["settings"]
    monkeypatch.setattr(_spec, "MOST_PATHS", 1)
    with pytest.raises(DatasetError, match="bands: expected 1, got None"):
        render_scene(SPECS["dark"], NEEDED, tmp_path)
    manifest["settings"]["bands"] = 1
    write_json(path, manifest)
    render_scene(SPECS["dark"], NEEDED, tmp_path)
    monkeypatch.undo()
    with pytest.raises(DatasetError, match="bands: expected none, got 1"):
        render_scene(SPECS["dark"], NEEDED, tmp_path)


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
