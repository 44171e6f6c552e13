# SPDX-License-Identifier: Apache-2.0
"""Training of graycard's own network: which scenes it sees, three steps on tiny ones, errors of priors."""

from pathlib import Path

import numpy as np
import pytest

from graycard import GraycardError, MethodError
from graycard.benchmarks import training
from graycard.benchmarks.training import TRAINING, VALIDATION, TrainSettings, ViewSettings
from graycard.cli import main
from graycard.cli._priors import TrainPriorCommand
from graycard.io import from_builtins, read_json, sha256, silent
from graycard.methods import Ask
from graycard.methods.priors import Override, PriorSpec, weights_of
from graycard.methods.priors._own import load_own
from graycard.methods.priors._spec import OWN_WEIGHTS
from graycard.synth import all_families, family_of, scene_name

RECORD = Path(training.__file__).with_name("own.json")
TINY, SEEDS = ViewSettings(16, 3), (100_001, 100_002)


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two scenes to train on and one for the curves, of 16 pixels."""
    folder = tmp_path_factory.mktemp("training")
    training.render_views([*SEEDS, VALIDATION.start], TINY, folder, silent)
    return folder


def fitted(views: Path, out: Path, seconds: float = float("inf"), **settings: int) -> training.TrainRecord:
    shown = training.read_views(SEEDS, views), training.read_views([VALIDATION.start], views)
    chosen = TrainSettings(**{"steps": 3, "batch": 2, "look_every": 2, **settings}, bf16=False)
    return training.train(*shown, chosen, out, silent, seconds)


@pytest.mark.parametrize("seed", [0, 999, 1000, 2999, 99_999, 110_000])
def test_seeds_of_judges_and_of_tuning_train_no_network(seed: int, tmp_path: Path, capsys):
    with pytest.raises(ValueError, match=f"expected seeds of 100000 to 109999, got {seed}. Seeds below 1000"):
        training.check_seeds([100_000, seed], TRAINING)
    command = ["train-prior", "--out", str(tmp_path), "--scenes", "1", "--first-seed", str(seed)]
    assert main(command) == 2
    assert f"got {seed}. Seeds below 1000 judge" in capsys.readouterr().err.replace("\n", " ")
    assert list(tmp_path.iterdir()) == []


def test_ranges_of_seeds_are_apart_from_all_others():
    assert TRAINING.start > 2999
    assert not set(TRAINING) & set(VALIDATION)


def test_tracks_take_turns_and_every_family_comes():
    specs = [training.training_scene(seed) for seed in range(100_000, 100_030)]
    assert {spec.family for spec in specs} == set(all_families())
    assert [spec.track for spec in specs[:3]] == [spec.track for spec in specs[3:6]]
    for spec in specs:
        family_of(spec)  # its knobs are in their ranges, or this raises
    drawn = [name for spec in specs for name in spec.knobs]
    assert {"light_offset", "roughness", "lights", "material", "lamp"} <= set(drawn)
    assert specs[4] == training.training_scene(100_004)


def test_views_are_rendered_once(views: Path):
    file = next(views.glob("*100001*"))
    before = file.stat().st_mtime_ns
    training.render_views(SEEDS, TINY, views, silent)
    assert file.stat().st_mtime_ns == before
    (scene,) = training.read_views([SEEDS[0]], views).values()
    assert scene["image"].shape == (3, 16, 16, 3)
    seen = np.isfinite(scene["depth"])
    assert seen.any()
    normals = scene["normal"].astype(np.float32)
    np.testing.assert_allclose(np.linalg.norm(normals[seen], axis=-1), 1, atol=2e-3)
    assert (normals[seen][:, 2] < 0.5).all()  # towards the camera, but for wide angles
    with pytest.raises(GraycardError, match="expected views of seed 100003 in .*, got none"):
        training.read_views([100_003], views)


def test_three_steps_give_weights_that_answer(views: Path, tmp_path: Path):
    record = fitted(views, tmp_path)
    assert [look.step for look in record.looks] == [2, 3]
    assert record.views == (6, 3)
    assert all(np.isfinite(look.loss) for look in record.looks)
    weights = tmp_path / "own.safetensors"
    assert record.weights == sha256(weights)
    assert from_builtins(training.TrainRecord, read_json(tmp_path / "own.json")) == record
    assert load_own("depth", weights).kind == "depth"
    spec = PriorSpec("oracle", overrides={"depth": Override("pretrained", path=str(weights))})
    assert weights_of(spec, (Ask("depth"),)) == [record.weights]


def test_a_training_that_was_cut_off_ends_as_it_would_have(views: Path, tmp_path: Path):
    whole = fitted(views, tmp_path / "whole")
    for step in (1, 2):
        cut = fitted(views, tmp_path / "cut", seconds=0)
        assert cut.last is not None
        assert cut.last.step == step
        assert cut.weights == sha256(tmp_path / "cut" / "own.safetensors") != whole.weights
    resumed = fitted(views, tmp_path / "cut")
    assert resumed.weights == whole.weights
    assert (resumed.looks, resumed.last) == (whole.looks, whole.looks[-1])
    with pytest.raises(GraycardError, match="expected .* to be free or to hold a training of these settings"):
        fitted(views, tmp_path / "cut", seed=1)


def test_errors_are_what_they_say():
    seen = np.ones((4, 5), bool)
    seen[0, 0] = False
    up, tilted = np.zeros((4, 5, 3)), np.zeros((4, 5, 3))
    up[..., 2] = 1
    tilted[..., 1:] = np.sin(np.radians(10)), np.cos(np.radians(10))
    assert training.errors_of("normal", tilted, up, seen) == pytest.approx((10,))
    assert training.errors_of("normal", 0 * up, up, seen) == pytest.approx((90,))
    depth = np.random.default_rng(0).uniform(1, 4, (4, 5))
    told = np.where(seen, 3 * depth + 2, np.inf)  # of another scale and offset; nothing at one pixel
    assert training.errors_of("depth", told, depth, seen) == pytest.approx((0, 0), abs=1e-9)
    assert training.errors_of("depth", -depth, depth, seen)[1] == pytest.approx(2)
    assert training.errors_of("depth", np.ones((4, 5)), depth, seen)[1] == 1
    paint = np.random.default_rng(1).uniform(0.1, 0.5, (4, 5, 3))
    assert training.errors_of("base_color", paint * [1, 2, 0.5], paint, seen) == pytest.approx((0,), abs=1e-9)
    assert training.errors_of("roughness", depth + 0.25, depth, seen) == pytest.approx((0.25,))


def test_no_constant_is_better_than_the_best():
    rng = np.random.default_rng(3)
    seen = rng.random((9, 9)) < 0.7
    normals = rng.normal((0, 0, 2), 1, (9, 9, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    normals[seen & (normals[..., 0] > 0)] = 0, 1, 0  # a table, as most of a view is

    def chord(constant: np.ndarray) -> float:
        return float(np.linalg.norm(constant - normals, axis=-1)[seen].mean())

    best = training.best_constant("normal", normals, seen)
    assert np.ptp(best, axis=(0, 1)).max() == 0
    assert np.linalg.norm(best[0, 0]) == pytest.approx(1)
    others = best[0, 0] + rng.normal(0, 0.05, (50, 3))
    assert chord(best) <= min(chord(other / np.linalg.norm(other)) for other in others) + 1e-4
    rough = rng.random((9, 9))
    assert training.best_constant("roughness", rough, seen)[0, 0] == np.median(rough[seen])


def test_errors_grow_with_the_severity_of_the_oracle(tiny_scenes: dict[str, Path]):
    sources = ("flat", "constant", "oracle:0", "oracle:2", "oracle:5", "pretrained:own")
    found = training.measure_priors([tiny_scenes["tabletop"]], sources, 2, silent)
    rows = {row.source: row for row in found if row.shown == "photograph"}
    assert list(rows) == list(sources)
    assert {row.shown for row in found} == {"photograph", "base_color"}
    assert rows["oracle:0"].errors["normal"][0] < 0.1
    assert rows["oracle:0"].errors["depth"][0] < 0.01
    for kind in ("normal", "depth", "base_color"):
        errors = [rows[source].errors[kind][0] for source in ("oracle:0", "oracle:2", "oracle:5")]
        assert errors == sorted(errors)
    for source in ("flat", "constant"):
        assert rows[source].errors["depth"][1] == 1
    assert rows["pretrained:own"].errors["depth"][1] < 1
    assert rows["flat"].views == 2


def test_the_command_measures_a_dataset(tiny_scenes: dict[str, Path], tmp_path: Path, capsys):
    out = tmp_path / "errors.json"
    command = ["prior-errors", str(tiny_scenes["dark"].parents[1]), "--views", "1", "--json", str(out)]
    assert main([*command, "--priors", "flat", "oracle:1"]) == 0
    assert "prior-errors: 2 sources on 3 scenes" in capsys.readouterr().out
    assert {row["source"] for row in read_json(out)["result"]} == {"flat", "oracle:1"}
    assert main([*command, "--priors", "none"]) == 2
    assert "expected sources of priors that answer something, got none" in capsys.readouterr().err
    assert main([*command[:2], "--views", "0"]) == 2
    with pytest.raises(MethodError):
        training.check_sources(["none"])


def test_the_curves_are_drawn(views: Path, tmp_path: Path):
    drawn = training.training_plot(fitted(views, tmp_path))
    assert drawn.startswith("<?xml")
    for words in ("stroke-dasharray", "loss of training views", "normals: mean angle, degrees", "multilight"):
        assert words in drawn


def test_the_record_is_that_of_the_weights_that_come_along():
    record = from_builtins(training.TrainRecord, read_json(RECORD))
    assert record.weights == sha256(OWN_WEIGHTS)
    assert record.last is not None
    assert set(record.last.errors) == set(record.constant) == {"dark", "multilight", "tabletop"}
    specs = [training.training_scene(seed) for seed in range(100_000, 100_000 + len(record.training))]
    assert record.training == tuple(f"{spec.track}/{scene_name(spec)}" for spec in specs)
    assert len(record.training) == TrainPriorCommand(Path()).scenes  # as `make prior` has it
    assert record.settings.steps == TrainPriorCommand(Path()).steps
