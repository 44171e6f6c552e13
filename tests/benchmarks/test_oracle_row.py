# SPDX-License-Identifier: Apache-2.0
"""The row ``truth``, fitted as any method is: the optimum of every metric, changed pictures included."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import graycard.eval as ge
from changed_scene import DESK, EDITED_LIGHTS, EDITS, LAMP, SKY, enrich
from graycard import RectangleLight, SpotLight, methods, open_capture, open_truth
from graycard.benchmarks._changes import changes_for, relighting_of
from graycard.benchmarks._fit import FitSpec, Fitted, fit_scene
from graycard.benchmarks._privileged import priors_for
from graycard.benchmarks.validity._record import _is_declared
from graycard.cli import main
from graycard.dataset import manifest_of, write_index
from graycard.io import silent, write_layers, write_manifest, write_rgb
from graycard.lights import write_lights
from graycard.methods import Changes
from graycard.methods._truth import TrueDecomposition, TruthMethod
from graycard.methods.priors import PriorSpec

Layers = dict[str, np.ndarray]
SPOT = SpotLight("desk", DESK.position, (0.0, 1.0, -0.5), DESK.intensity, 20, 40)
SHEET = RectangleLight("sheet", (1.0, 0.5, 2.0), (0.2, 0, 0), (0, -0.2, 0), (30.0, 20.0, 10.0))
LIGHTS = (LAMP, SPOT, SHEET, SKY)


def with_the_rest(layers: Layers) -> Layers:
    """The layers that the changed tiny scene lacks."""
    base, lit = layers["base_color"], layers["shading"]
    metal = (layers["object_id"] == 1).astype(np.float32)
    more = {
        "albedo": 0.9 * base + 0.02,
        "diffuse_reflectance": base * (1 - 0.5 * metal[..., None]),
        "f0": np.repeat(metal[..., None], 3, axis=-1) * 0.5,
        "metallic": 0.4 * metal,
        "irradiance.lamp": math.pi * lit,
        "indirect.diffuse.lamp": 0.2 * base * lit,
        "indirect.specular.lamp": 0.1 * base * lit,
    }
    mirrored = 0.03 * np.sin(np.arange(base.shape[1]))[None, :, None]
    specular = layers["direct.specular.lamp"] + more["indirect.specular.lamp"]
    more["counterfactual.specular"] = np.maximum(specular - mirrored, 0)
    return layers | {name: values.astype(np.float32) for name, values in more.items()}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory, write_tiny: Callable[..., Path]) -> Path:
    """A tabletop that has the truth for every metric; its ball is a colour chart."""
    folder = enrich(write_tiny(tmp_path_factory.mktemp("oracle"), track="tabletop"))
    truth = open_truth(folder / "truth")
    for view in truth.views:
        write_layers(folder / f"truth/views/{view.name}.exr", with_the_rest(truth.layers(view)))
    objects = tuple(replace(o, name="color chart") if o.id == 2 else o for o in truth.objects)
    write_index(folder / "truth", replace(truth, objects=objects))
    write_rgb(folder / "truth" / SKY.image, np.full((4, 8, 3), 0.7, np.float32))
    write_lights(folder / "truth" / "lights.json", LIGHTS)
    write_manifest(folder / "truth", manifest_of(truth))
    return folder


@pytest.fixture(scope="module")
def fitted(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Fitted, Path, Path]:
    """Return the record of the fit, its predictions, and the saved oracle."""
    folder = tmp_path_factory.mktemp("fitted")
    spec = FitSpec("truth", {}, 0, scene)
    return fit_scene(spec, folder / "p", silent, folder / "saved"), folder / "p", folder / "saved"


def test_it_reaches_the_optimum_of_every_metric(scene: Path, fitted: tuple[Fitted, Path, Path]) -> None:
    sheet = ge.score_predictions(fitted[1], scene)
    missing = {m.id for m in ge.all_metrics()} - {s.metric for s in sheet.scores}
    assert missing == set(ge.unavailable())
    for found in sheet.scores:
        assert (found.status, found.value) == ("scored", found.optimum), (found.metric, found.reason)
        assert found.expected == found.scored > 0


def test_what_it_was_handed_is_on_record(fitted: tuple[Fitted, Path, Path]) -> None:
    handed = fitted[0].access.handed
    assert {"lights", "relighting", "composition"} < set(handed)
    assert fitted[0].access.refused == ()
    assert all(_is_declared(name, set(TruthMethod.needs)) for name in handed)


@pytest.mark.parametrize("method", ["gray", "2dgs-oracle"])
def test_others_are_not_handed_changed_pictures(method: str, scene: Path) -> None:
    capture = open_capture(scene / "capture")
    loaded = methods.load_method(method)
    priors = priors_for(loaded.needs, methods.asks_of(loaded), PriorSpec(), capture, scene)
    assert (priors.relighting, priors.composition) == ((), None)


def test_a_scene_without_changes(tiny_scenes: dict[str, Path], tmp_path: Path) -> None:
    fit_scene(FitSpec("truth", {}, 0, tiny_scenes["dark"]), tmp_path / "p", silent)
    assert not (tmp_path / "p/relighting").exists()
    assert not (tmp_path / "p/composition").exists()


def test_a_saved_oracle_knows_the_changes(
    scene: Path, fitted: tuple[Fitted, Path, Path], tmp_path: Path
) -> None:
    """The images of environments lie elsewhere then."""
    oracle, truth = TruthMethod().load(fitted[2]), open_truth(scene / "truth")
    composition = truth.composition()
    assert composition is not None
    composed = oracle.compose(composition)
    relit = {name: oracle.relight(lights) for name, lights in relighting_of(scene, tmp_path).items()}
    assert list(relit) == [edit.name for edit in EDITS]
    for view in (v for v in truth.views if v.split == "test"):
        pairs = [(relit[edit.name], truth.relit(edit.name, view)) for edit in EDITS]
        for known, true in [*pairs, (composed, truth.composed(view))]:
            assert known is not None
            assert np.array_equal(known.render(view.camera, ["radiance"])["radiance"], true["radiance"])


def test_it_does_not_know_other_changes(
    scene: Path, fitted: tuple[Fitted, Path, Path], tmp_path: Path
) -> None:
    oracle = TruthMethod().load(fitted[2])
    composition = open_truth(scene / "truth").composition()
    assert composition is not None
    elsewhere = composition.donor_to_host + np.eye(4)
    assert oracle.compose(replace(composition, donor_to_host=elsewhere)) is None
    assert oracle.relight((replace(LAMP, intensity=(1.0, 1.0, 1.0)),)) is None
    write_rgb(tmp_path / "other.exr", np.full((2, 4, 3), 0.6, np.float32))
    assert oracle.relight((replace(SKY, image=str(tmp_path / "other.exr")),)) is None
    assert oracle.relight(EDITED_LIGHTS[0]) is not None


def test_what_is_not_known_is_not_written(
    scene: Path, fitted: tuple[Fitted, Path, Path], tmp_path: Path
) -> None:
    capture = open_capture(scene / "capture")
    whole = TruthMethod().load(fitted[2])
    ignorant = TrueDecomposition(whole.known, whole.target)
    changes = Changes({"without-lamp": EDITED_LIGHTS[0]}, open_truth(scene / "truth").composition())
    methods.write_predictions(ignorant, capture, "truth", tmp_path / "p", silent, changes)
    sheet = ge.score_predictions(tmp_path / "p", scene)
    for metric in ("relighting.psnr", "composition.psnr"):
        assert sheet.score(metric).status == "not provided"


def test_who_can_show_no_change_is_asked_for_none(scene: Path, tmp_path: Path) -> None:
    capture = open_capture(scene / "capture")
    gray = methods.load_method("gray")
    found = gray.fit(capture, methods.Priors(), gray.settings_type(), 0, silent)
    assert changes_for(found, capture, scene) == Changes()
    assert changes_for(found, capture, tmp_path / "no truth") == Changes()


def test_the_command_lists_every_part(
    scene: Path, fitted: tuple[Fitted, Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["score", str(fitted[1]), str(scene)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    parts = ", ".join(f"{edit.name} inf" for edit in EDITS)
    for line in (
        f"relighting.psnr {parts}",
        "composition.psnr object inf, around inf",
        "environment.psnr mirror inf, glossy inf, diffuse inf",
        "counterfactual.residual.shadow 0",
    ):
        assert line in shown
    assert "debiased signed" in shown
    assert "counterfactual.residual.*: 0 the object is gone, 1 all of it is still there" in shown
