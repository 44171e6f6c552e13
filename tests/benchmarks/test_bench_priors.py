# SPDX-License-Identifier: Apache-2.0
"""A method that asks a prior, from the suite's file to the run record."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import DatasetError, MethodError, RecordError, open_truth
from graycard.benchmarks import FitSpec, Suite, SuiteMethod, fit_scene, load_suite
from graycard.benchmarks._introduction import introduction_of
from graycard.benchmarks._jobs import run_fit
from graycard.benchmarks._run_record import method_record
from graycard.benchmarks.planning._plan import plan_fits
from graycard.cli import main
from graycard.io import from_builtins, read_layers, silent, to_builtins
from graycard.methods.priors import Override, PriorSpec, told_exactly
from graycard.processes import landlock_version
from graycard.records import Job
from graycard.synth import RenderSettings, SceneSpec

ASKER = """
from graycard.methods import Ask, NoSettings
from graycard.methods._lookup import Lookup

class Twice:
    summary = "Asks for depth with the photograph, and again with what it takes for the albedo"
    needs = ()
    asks = (Ask("depth", ("photograph", "base_color")), Ask("base_color", optional=True))
    settings_type = NoSettings
    def fit(self, capture, priors, settings, seed, progress):
        images = {}
        for view in capture.views:
            image = 0.2 if view.split == "test" else capture.photograph(view) * capture.exposure
            image = image + 0 * view.camera.rays()
            paint = priors.base_color(image, view) if "base_color" in priors.kinds else image
            images[view.camera.digest] = {"depth": priors.depth(paint, view)}
        return Lookup("twice", images)
    def load(self, folder): ...
"""


@pytest.fixture
def asker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    (tmp_path / "asking_method.py").write_text(ASKER)
    monkeypatch.syspath_prepend(tmp_path)
    yield "asking_method:Twice"
    sys.modules.pop("asking_method", None)


def depths(folder: Path, scene: Path) -> tuple[np.ndarray, np.ndarray]:
    """Predicted and true depth of the first view."""
    truth = open_truth(scene / "truth")
    view = truth.views[0]
    found = read_layers(folder / "views" / f"{view.name}.exr")["depth"]
    return found, truth.layers(view)["depth"]


def test_an_oracle_answers_and_the_method_never_sees_the_truth(
    asker: str, tiny_scenes: dict[str, Path], tmp_path: Path
):
    scene = tiny_scenes["dark"]
    fit_scene(FitSpec(asker, {}, 0, scene, priors=PriorSpec("oracle")), tmp_path / "exact", silent)
    found, true = depths(tmp_path / "exact", scene)
    np.testing.assert_allclose(found, true, rtol=1e-6)
    fit_scene(FitSpec(asker, {}, 0, scene, priors=PriorSpec("oracle", 3)), tmp_path / "wrong", silent)
    found, true = depths(tmp_path / "wrong", scene)
    assert not np.allclose(found, true, rtol=1e-2)


def test_truth_that_a_scene_has_not_is_met_before_the_fit(
    asker: str, tiny_scenes: dict[str, Path], tmp_path: Path
):
    method = Path(tmp_path / "asking_method.py")
    method.write_text(ASKER.replace('Ask("base_color", optional=True)', 'Ask("roughness")'))
    spec = FitSpec(asker, {}, 0, tiny_scenes["dark"], priors=PriorSpec("oracle"))
    with pytest.raises(DatasetError, match="expected the truth of .* to have roughness, got none"):
        fit_scene(spec, tmp_path / "out", silent)
    assert not (tmp_path / "out").exists()


def planned(scene: Path, *rows: SuiteMethod) -> list:
    spec = SceneSpec("dark", "corridor", 1000)
    suite = Suite("s", 1, "S", RenderSettings(), (spec,), tuple(rows))
    return plan_fits(suite, [introduction_of(row) for row in rows], [(spec, scene)], {}, scene / "run", 1)


def test_a_job_is_addressed_by_its_priors_too(asker: str, tiny_scenes: dict[str, Path], tmp_path: Path):
    changed = Override(errors={"kappa": 0.3})
    weights = tmp_path / "weights"
    weights.mkdir()
    (weights / "depth.pt").write_bytes(b"1")
    pretrained = PriorSpec(
        "classical", overrides={"depth": Override("pretrained", path=str(weights / "depth.pt"))}
    )
    specs = [
        PriorSpec("oracle"),
        PriorSpec("oracle", 1),
        PriorSpec("oracle", 1, seed=1),
        PriorSpec("oracle", 1, overrides={"depth": changed}),
        PriorSpec("classical"),
        pretrained,
    ]
    rows = [SuiteMethod(asker, label=f"row {n}", priors=spec) for n, spec in enumerate(specs)]
    jobs = planned(tiny_scenes["dark"], *rows)
    assert len({job.job_hash for job in jobs}) == len(specs)
    assert [job.job.priors["source"] for job in jobs] == ["oracle"] * 4 + ["classical"] * 2
    assert from_builtins(Job, to_builtins(jobs[3].job)) == jobs[3].job
    (weights / "depth.pt").write_bytes(b"22")
    assert planned(tiny_scenes["dark"], rows[5])[0].job_hash != jobs[5].job_hash


def test_only_jobs_that_are_told_the_truth_depend_on_it(asker: str, make_scene: Callable[..., Path]):
    scene = make_scene()
    rows = [SuiteMethod(asker, label=s, priors=PriorSpec(s)) for s in ("oracle", "classical")]
    rows.append(SuiteMethod("gray"))
    before = [job.job_hash for job in planned(scene, *rows)]
    manifest = scene / "truth" / "manifest.json"
    manifest.write_text(manifest.read_text() + "\n")
    after = [job.job_hash for job in planned(scene, *rows)]
    assert [a == b for a, b in zip(before, after, strict=True)] == [False, True, True]
    assert planned(scene, rows[2])[0].job.priors == {}


def test_a_job_hands_its_priors_on(asker: str, make_scene: Callable[..., Path]):
    scene = make_scene()
    (job,) = planned(scene, SuiteMethod(asker, priors=PriorSpec("oracle")))
    assert run_fit(job).reason == ""
    found, true = depths(job.folder / "predictions", scene)
    np.testing.assert_allclose(found, true, rtol=1e-6)


def test_a_row_says_its_priors_and_wrong_ones_are_met_before_any_work(asker: str):
    asks = SuiteMethod(asker, priors=PriorSpec("oracle", 2))
    record = method_record(asks, introduction_of(asks))
    assert record.summary.endswith("(priors: oracle, severity 2)")
    with pytest.raises(MethodError, match="gives depth, got 'none'"):
        introduction_of(SuiteMethod(asker))
    with pytest.raises(MethodError, match="expected no priors for a method that asks for none"):
        introduction_of(SuiteMethod("gray", priors=PriorSpec("oracle")))


DEPTH, COLOR = "depth (exact prior)", "base_color (exact prior)"
EXACT_AND_NOT = [
    (PriorSpec("oracle"), (DEPTH, COLOR)),
    (PriorSpec("oracle", 1), ()),
    (PriorSpec("classical"), ()),
    (PriorSpec("oracle", overrides={"depth": Override(errors={"kappa": 0.3})}), (COLOR,)),
    (PriorSpec("oracle", 2, overrides={"depth": Override(severity=0)}), (DEPTH,)),
    (PriorSpec("classical", overrides={"depth": Override("oracle")}), (DEPTH,)),
]


@pytest.mark.parametrize(("spec", "sees"), EXACT_AND_NOT, ids=str)
def test_a_row_that_is_told_truth_as_it_is_does_not_compete(
    asker: str, spec: PriorSpec, sees: tuple[str, ...]
):
    row = SuiteMethod(asker, priors=spec)
    assert method_record(row, introduction_of(row)).sees == sees


def test_normals_that_are_slopes_of_a_true_depth_are_told_exactly():
    slopes = {"normal": Override(algorithm="slopes-of-depth")}
    assert told_exactly(PriorSpec("oracle", 0, overrides=slopes), ["depth", "normal"]) == ("depth", "normal")
    assert told_exactly(PriorSpec("oracle", 3, overrides=slopes), ["depth", "normal"]) == ()
    assert told_exactly(PriorSpec(), ["depth"]) == ()


SUITE = """
name = "mine"
version = 1
title = "Mine"
[render]
samples = 64
[[scenes]]
track = "dark"
family = "corridor"
seed = 1000
[[methods]]
name = "gray"
[methods.priors]
source = "oracle"
severity = {severity}
overrides = {{ depth = {{ severity = 4, errors = {{ kappa = 0.3 }} }} }}
"""


def test_a_suite_names_priors(tmp_path: Path):
    path = tmp_path / "mine.toml"
    path.write_text(SUITE.format(severity=2))
    (method,) = load_suite(str(path)).methods
    assert method.priors == PriorSpec(
        "oracle", 2, overrides={"depth": Override(severity=4, errors={"kappa": 0.3})}
    )
    path.write_text(SUITE.format(severity=7))
    with pytest.raises(RecordError, match="expected a severity of 0 to 5, got 7"):
        load_suite(str(path))


def test_priors_on_the_command_line(
    asker: str, tiny_scenes: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    scene, out = tiny_scenes["dark"], tmp_path / "predictions"
    fit = ["fit", asker, str(scene), "--out", str(out)]
    assert main([*fit, "--priors", "oracle:0"]) == 0
    found, true = depths(out, scene)
    np.testing.assert_allclose(found, true, rtol=1e-6)
    capsys.readouterr()
    assert main(fit) == 2
    assert "expected a source of priors that gives depth, got 'none'" in " ".join(
        capsys.readouterr().err.split()
    )
    assert main(["methods", asker]) == 0
    assert "asks a prior for: depth of photograph, base_color" in capsys.readouterr().out


class Writes(torch.nn.Module):
    """Answers with depth, and writes a file on the way."""

    def __init__(self, path: str) -> None:
        super().__init__()
        self.path = path

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        written = torch.from_file(self.path, True, 16)  # a map that is shared with the file
        written.fill_(7.0)
        return image.mean(1, True) + written.mean()


@pytest.mark.filterwarnings("ignore:.*torch.jit.* is deprecated:DeprecationWarning")
@pytest.mark.skipif(not landlock_version(), reason="this kernel has no Landlock")
def test_a_program_in_weights_runs_confined(asker: str, tiny_scenes: dict[str, Path], tmp_path: Path):
    weights, target = tmp_path / "weights", tmp_path / "target"
    weights.mkdir()
    target.write_bytes(b"0" * 64)
    torch.jit.script(Writes(str(target))).save(str(weights / "depth.pt"))
    spec = FitSpec(asker, {}, 0, tiny_scenes["dark"], priors=PriorSpec("pretrained", path=str(weights)))
    with pytest.raises(MethodError, match="the network failed: "):
        fit_scene(spec, tmp_path / "out", silent)
    assert target.read_bytes() == b"0" * 64
    torch.jit.load(str(weights / "depth.pt"))(torch.ones(1, 3, 4, 4))
    assert target.read_bytes() != b"0" * 64, "it does so where nothing holds it"
