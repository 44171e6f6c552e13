# SPDX-License-Identifier: Apache-2.0
"""A bench tells in the terminal what is odd about the scores of its rows."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from graycard import Predictions, open_truth
from graycard.benchmarks import load_suite, noisy_scenes
from graycard.cli import main
from graycard.predictions import finish_predictions, write_view
from graycard.records import read_run
from planted_mistakes import MISTAKES, Mistake

LAYERS = ("radiance", "base_color", "normal", "depth")


def plant(mistake: Mistake, scene: Path, folder: Path) -> Path:
    """Write the truth of a scene with a mistake as predictions of other code."""
    truth = open_truth(scene / "truth", check=False)
    made = folder / truth.track / truth.scene
    for view in truth.views:
        layers = {name: values for name, values in truth.layers(view).items() if name in LAYERS}
        write_view(made, view.name, layers | mistake.make(layers, view, truth.exposure))
    finish_predictions(made, Predictions("mine", truth.track, truth.scene))
    return folder


@pytest.mark.usefixtures("here")
def test_scenes_that_are_noisier_than_their_suite_allows_are_named(
    tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    """Files of a scene may be gone, as where it was run on another machine."""
    path, run = suite_of(tracks=("dark",)), tmp_path / "run"
    path.write_text(f"ceilings = {{ dark = 99.0 }}\n{path.read_text()}")
    command = ["bench", str(path), "--out", str(run), "--methods", "gray"]
    assert main([*command, "--dataset", str(tiny_run / "dataset")]) == 0
    suite, record = load_suite(str(path)), read_run(run)
    (scene,) = record.scenes
    ceiling = open_truth(run / scene.folder / "truth", check=False).noise_ceiling
    assert ceiling is not None
    words = f"dark/{scene.scene} has a noise ceiling of {ceiling:.1f} dB, not 99"
    assert noisy_scenes(suite, record, run) == [words]
    assert f"warning: scenes are noisier than their suite allows\n  {words}\n" in capsys.readouterr().out
    gone = replace(record, scenes=(replace(scene, folder="gone"),))
    assert noisy_scenes(suite, gone, run) == []
    assert noisy_scenes(replace(suite, ceilings={"dark": ceiling}), record, run) == []


@pytest.mark.usefixtures("here")
def test_the_six_mistakes_are_named_with_row_and_scene(
    tiny_run: Path, tmp_path: Path, suite_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    (scene,) = (tiny_run / "dataset" / "dark").iterdir()
    rows = {m: f"{m.name}={plant(m, scene, tmp_path / m.name)}" for m in MISTAKES}
    command = ["bench", str(suite_of(tracks=("dark",))), "--out", str(tmp_path / "run"), "--methods", "gray"]
    capsys.readouterr()
    main([*command, "--dataset", str(tiny_run / "dataset"), "--predictions", *rows.values()])
    shown = capsys.readouterr().out
    told = re.findall(r"^warning: (.*)\n  (.*)\n  (.*)$", shown, re.MULTILINE)
    for mistake in MISTAKES:
        found = [(scores, places) for text, scores, places in told if text.startswith(mistake.says)]
        assert found == [(mistake.beside, f"{mistake.name} on dark/{scene.name}")], shown
