# SPDX-License-Identifier: Apache-2.0
"""The speed benchmark of the engine on next to nothing: its records are whole and hang together."""

import json
import math
import sys
from dataclasses import fields, replace
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
import torch

from graycard import Camera, GraycardError
from graycard.benchmarks import speed
from graycard.benchmarks.speed._machine import QUICK, Timing
from graycard.benchmarks.speed.engine import _peers as peers
from graycard.benchmarks.speed.engine._calls import call_both, call_forward, scene_of
from graycard.benchmarks.speed.engine._losses import torch_depth_normal, torch_photometric
from graycard.benchmarks.speed.engine._measure import TINY
from graycard.benchmarks.speed.engine._pairs import count_pairs
from graycard.benchmarks.speed.engine._records import flops_backward, flops_forward
from graycard.benchmarks.speed.engine._scenes import WORKLOADS, Workload, engine_camera, engine_surfels
from graycard.benchmarks.speed.engine._step import measure_steps
from graycard.cli import main
from graycard.io import from_builtins
from graycard.methods import splat


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Files of one quick run by the command line."""
    folder = tmp_path_factory.mktemp("speed")
    files = {"json": folder / "speed.json", "svg": folder / "speed.svg"}
    words = ["speed", "engine", "--quick", "--json", str(files["json"]), "--plot", str(files["svg"])]
    assert main(words) == 0
    return files


@pytest.fixture
def record(run: dict[str, Path]) -> speed.EngineSpeed:
    return from_builtins(speed.EngineSpeed, json.loads(run["json"].read_text()))


def brute_force(surfels: splat.Surfels, camera: Camera) -> int:
    """Weights one by one: each surfel is a feature channel of its own in the specification."""
    double = splat.Surfels(*(getattr(surfels, one.name).double() for one in fields(surfels)))
    each = torch.eye(len(surfels), dtype=torch.float64)
    maps = splat.rasterize_features(double, camera, each, backend="reference")
    return int((maps.features > 0).sum())


def test_scenes_draw_their_numbers_in_one_order():
    """Written out: figures of today and of another day must be of the same cloud."""
    random, workload = np.random.default_rng(0), Workload("", 50, 32, 0.02)
    x, y = random.uniform(-1.2, 1.2, 50), random.uniform(-1.2, 1.2, 50)
    z, turns = random.uniform(1.5, 4, 50), random.normal(size=(50, 4))
    scales = np.exp(random.normal(math.log(0.02), 0.4, (50, 2)))
    surfels = engine_surfels(workload, 2)
    np.testing.assert_allclose(surfels.centres, np.stack([x, y, z], axis=1), rtol=1e-6)
    np.testing.assert_allclose(surfels.rotations, turns / np.linalg.norm(turns, axis=1)[:, None], atol=1e-6)
    np.testing.assert_allclose(surfels.scales, scales, rtol=1e-6)
    np.testing.assert_allclose(surfels.opacities, random.uniform(0.3, 1, 50), rtol=1e-6)
    assert surfels.features.shape == (50, 2)


def test_more_surfels_cover_a_pixel_as_often():
    start = WORKLOADS[0]
    more = start.covering(40_000)
    assert more.surfels * more.scale**2 == pytest.approx(start.surfels * start.scale**2)
    assert (more.size, start.sized(64).size, start.sized(64).surfels) == (start.size, 64, start.surfels)


@pytest.mark.parametrize(
    "workload", [TINY, Workload("deep", 150, 20, 0.5), Workload("small", 80, 45, 0.01)], ids=lambda w: w.name
)
def test_pairs_are_those_of_a_brute_force_count(workload: Workload):
    surfels, camera = engine_surfels(workload), engine_camera(workload)
    if workload.name == "deep":
        limit = (surfels.centres[:, 2:] - 0.1) / 3.4  # nothing reaches behind the camera
        surfels = replace(
            surfels, scales=surfels.scales.minimum(limit), opacities=surfels.opacities * 0 + 0.9
        )
    expected = brute_force(surfels, camera)
    assert expected > 100
    assert count_pairs(surfels, camera) == expected


def test_surfels_that_reach_behind_the_camera_are_not_counted():
    surfels = engine_surfels(Workload("", 5, 16, 3.0))
    with pytest.raises(ValueError, match="expected surfels before the camera, got one"):
        count_pairs(surfels, engine_camera(TINY))


def test_a_run_holds_every_part(record: speed.EngineSpeed):
    assert [peak.threads for peak in record.peaks] == sorted({1, record.threads})
    assert [(cost.workload, cost.channels) for cost in record.engine] == [("tiny", 3)]
    assert {point.along for point in record.scaling} == {"surfels", "pixels", "channels", "threads"}
    assert "reference" in {peer.peer for peer in record.peers}
    assert {loss.loss for loss in record.losses} == {"L1 + SSIM", "depth-normal"}
    assert [(step.workload, step.losses) for step in record.steps] == [
        ("tiny", "photometric"),
        ("tiny", "and geometry"),
    ]
    assert {step.device for step in record.steps} == {"cpu"}
    assert any(reason.startswith("steps of 2dgs on a GPU: expected") for reason in record.left_out)
    for step in record.steps:
        assert list(step.stages) == ["colours", "loss", "gradients", "Adam"]
        assert all(timing.ms > 0 for timing in (step.whole, *step.stages.values()))
    assert [cost.kind for cost in record.tracer] == ["camera", "incoherent"]
    assert {"cpu", "git_commit", "packages"} <= set(record.environment)
    assert {"numba", "torch"} <= set(record.environment["packages"])
    assert record.started.endswith("+00:00")


def test_the_figures_hang_together(record: speed.EngineSpeed):
    cost, peak = record.engine[0], record.peaks[-1]
    surfels, camera = engine_surfels(TINY), engine_camera(TINY)
    assert cost.pairs == brute_force(surfels, camera)
    assert (cost.threads, cost.surfels, cost.size) == (record.threads, 40, 32)
    for lanes, stage, flops in (
        (cost.forward_lanes, "draw", flops_forward(3)),
        (cost.backward_lanes, "draw backward", flops_backward(3)),
    ):
        assert lanes.evaluated >= cost.pairs
        assert lanes.evaluated % 16 == 0
        assert lanes.efficiency == pytest.approx(cost.pairs / lanes.evaluated)
        assert lanes.ns * lanes.evaluated == pytest.approx(1e6 * cost.stages[stage].ms)
        assert lanes.peak_share == pytest.approx(flops / lanes.ns / peak.gflops)
    assert cost.ns_both == pytest.approx(1e6 * cost.both.ms / cost.pairs)
    assert cost.pairs_per_second * cost.ns_both == pytest.approx(1e9)
    assert cost.working_mib > 0


def test_operations_are_those_of_the_textbook_count():
    assert (flops_forward(3), flops_forward(16)) == (45, 71)
    assert (flops_backward(3), flops_backward(16)) == (98, 150)


def test_a_change_in_the_scene_changes_the_count():
    """Else the comparison above would hold for any number."""
    more = replace(TINY, surfels=41)
    assert count_pairs(engine_surfels(more), engine_camera(more)) != count_pairs(
        engine_surfels(TINY), engine_camera(TINY)
    )


def test_tables_have_a_row_for_each_figure(record: speed.EngineSpeed):
    tables = {table.title.split(",")[0]: table for table in speed.engine_tables(record)}
    assert [len(table.heads) == len(row) for table in tables.values() for row in table.rows].count(False) == 0
    rows = {title: len(table.rows) for title, table in tables.items()}
    assert rows["Engine"] == rows["Kernels"] == len(record.engine)
    assert rows["Scaling"] == len(record.scaling)
    assert rows["Peers in the same run"] == len(record.peers)
    assert rows["Losses"] == len(record.losses)
    assert rows["A whole step of 2dgs"] == 2
    assert rows["Tracer beside Mitsuba's ellipsoids"] == 2


def test_parts_that_were_not_measured_have_no_table(record: speed.EngineSpeed):
    bare = replace(record, engine=(), scaling=(), peers=(), losses=(), steps=(), tracer=())
    assert len(speed.engine_tables(bare)) == 1


def test_scaling_is_told_against_proportion(record: speed.EngineSpeed):
    time = Timing(1.0, 1.0, 1, 0, 0.0)
    point = replace(record.scaling[0], along="surfels", value=10, forward=time, both=time)
    less, more = (replace(point, value=n, both=replace(time, ms=ms)) for n, ms in ((20, 0.5), (40, 1.5)))
    one = replace(point, along="threads", value=1)
    two = replace(one, value=2, both=replace(time, ms=0.6))
    tables = speed.engine_tables(replace(record, scaling=(point, less, more, one, two)))
    scaling = next(table for table in tables if table.title.startswith("Scaling"))
    assert [row[-1] for row in scaling.rows] == ["1.00", "0.25", "1.50", "1.00", "1.20"]


def test_times_without_quiet_are_marked(record: speed.EngineSpeed):
    quiet = Timing(1.0, 1.0, 3, 0, 0.0)
    loss = replace(record.losses[0], ours=quiet, torch=quiet)
    peaks = tuple(replace(peak, timing=quiet) for peak in record.peaks)
    empty = dict.fromkeys(("engine", "scaling", "peers", "steps", "tracer"), ())
    calm = replace(record, peaks=peaks, losses=(loss,), **empty)
    assert speed.disturbed_note(calm) == ""
    loud = replace(calm, losses=(replace(loss, ours=replace(quiet, counted=0, rejected=2, others=1.0)),))
    assert speed.disturbed_note(loud).startswith(f"1 of {len(peaks) + 2} times (marked ~)")
    assert speed.engine_tables(loud)[-1].rows[0][3:5] == ("~1", "1")


def test_the_picture_shows_stages_and_growth(run: dict[str, Path], record: speed.EngineSpeed):
    picture = Xml.fromstring(run["svg"].read_text())
    words = [element.text or "" for element in picture.iter("{http://www.w3.org/2000/svg}text")]
    assert set(record.engine[0].stages) <= set(words)
    assert "tiny, C = 3" in words
    assert {f"ms by {axis}, logarithmic" for axis in ("surfels", "pixels", "channels")} <= set(words)
    lines = [element for element in picture.iter() if element.get("id", "").startswith("line ")]
    assert len(lines) == 9
    assert all(len(list(line)) == 1 for line in lines), "each is drawn"
    assert not any("nan" in str(value) for element in picture.iter() for value in element.attrib.values())


def test_a_picture_of_a_part(record: speed.EngineSpeed):
    odd = {**record.environment, "cpu": "<AMD & sons>"}
    bare = speed.engine_plot(replace(record, engine=(), scaling=(), environment=odd))
    assert "&lt;AMD &amp; sons&gt;" in bare
    assert 'id="line ' not in bare
    assert speed.engine_plot(record) == speed.engine_plot(record), "equal runs give equal pictures"


def test_a_picture_needs_matplotlib(
    record: speed.EngineSpeed, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr("graycard.plotting._figure.find_spec", lambda name: None)
    with pytest.raises(GraycardError, match=r"expected matplotlib .*, got none. .* 'graycard\[figures\]'"):
        speed.engine_plot(record)
    assert main(["speed", "engine", "--plot", "a.svg"]) == 2
    assert "expected matplotlib" in capsys.readouterr().err


def test_peers_draw_the_same_picture():
    scene = scene_of(TINY, 3)
    ours = call_forward(scene)
    for make in (peers._reference, peers._gsplat):
        peer = make(scene)
        if isinstance(peer, str):
            continue
        theirs = call_forward(scene, peer.draw)
        assert (theirs.features - ours.features).abs().max() < 5e-3, peer.name
        assert (theirs.alpha - ours.alpha).abs().max() < 5e-3, peer.name


STAND_IN = """
import torch

class GaussRenderer:
    def __init__(self, white_bkgd):
        assert not white_bkgd

    def render(self, camera, means2D, cov2d, color, opacity, depths):
        rows, columns = torch.meshgrid(
            torch.arange(camera.image_height), torch.arange(camera.image_width), indexing="ij")
        pixels = torch.stack([columns, rows], dim=-1).to("cuda")
        away = pixels[..., None, :] - means2D
        order = depths.argsort()
        power = torch.einsum("hwni,nij,hwnj->hwn", away, cov2d.inverse(), away)
        alpha = (torch.exp(-0.5 * power) * opacity[:, 0]).clip(max=0.99)[..., order]
        before = torch.cat([torch.ones_like(alpha[..., :1]), 1 - alpha[..., :-1]], dim=-1).cumprod(dim=-1)
        weights = alpha * before
        tiles = weights.reshape(64, 64, -1)  # one, as the images here have
        return {"render": tiles @ color[order], "alpha": tiles.sum(dim=-1, keepdim=True)}
"""
"""Draws as torch-splatting does, by its names, one tile."""


@pytest.fixture
def torch_splatting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "gaussian_splatting").mkdir()
    (tmp_path / "gaussian_splatting" / "__init__.py").touch()
    (tmp_path / "gaussian_splatting" / "gauss_render.py").write_text(STAND_IN)
    (tmp_path / "einops.py").touch()  # which torch-splatting imports
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("gaussian_splatting", "gaussian_splatting.gauss_render"):
        monkeypatch.delitem(sys.modules, name, raising=False)


@pytest.mark.usefixtures("torch_splatting")
def test_torch_splatting_draws_nearly_the_same_picture():
    """Discs that are large to a pixel, seen from the front, are what its Gaussians are."""
    workload = Workload("", 12, 64, 0.25)
    scene = scene_of(workload, 3)
    surfels = replace(scene.surfels, rotations=torch.tensor([[1.0, 0, 0, 0]]).repeat(12, 1).requires_grad_())
    scene = replace(scene, surfels=surfels)
    peer = peers._torch_splatting(scene)
    assert isinstance(peer, peers.Peer)
    ours, theirs = call_forward(scene), call_forward(scene, peer.draw)
    assert ours.alpha.mean() > 0.2
    assert (theirs.features - ours.features).abs().mean() < 0.004
    assert (theirs.alpha - ours.alpha).abs().mean() < 0.004
    assert all(bool(torch.isfinite(one).all()) for one in call_both(scene, peer.draw))


@pytest.mark.usefixtures("torch_splatting")
def test_what_torch_splatting_cannot_do_is_said(monkeypatch: pytest.MonkeyPatch):
    assert peers._torch_splatting(scene_of(WORKLOADS[0], 4)) == "torch-splatting draws 3 channels only"
    assert "images of whole tiles of 64 pixels only" in str(peers._torch_splatting(scene_of(TINY, 3)))
    monkeypatch.setattr(peers, "TORCH_SPLATTING_MIB", 1)
    assert "torch-splatting would need" in str(peers._torch_splatting(scene_of(WORKLOADS[0], 3)))


@pytest.mark.gpu
def test_cuda_is_timed_where_it_is():
    scene = scene_of(TINY, 3)
    peer = peers._cuda(scene)
    assert isinstance(peer, peers.Peer), peer
    assert peer.scene is not None
    ours, theirs = call_forward(scene), call_forward(peer.scene, peer.draw)
    assert (theirs.features.cpu() - ours.features).abs().max() < 5e-3


@pytest.mark.gpu
def test_steps_are_timed_on_a_gpu():
    costs = measure_steps(TINY, QUICK, "cuda")
    assert {cost.device for cost in costs} == {torch.cuda.get_device_name()}
    assert all(timing.ms > 0 for cost in costs for timing in (cost.whole, *cost.stages.values()))


def test_peers_that_cannot_run_are_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    monkeypatch.setattr(peers, "REFERENCE_MIB", 0)
    costs, left_out = peers.measure_peers((TINY,), (3,), QUICK)
    assert costs == []
    assert left_out[0].startswith("tiny, 3 channels: the reference would need")
    assert "gsplat is not installed: pip install" in left_out[1]
    assert "torch-splatting is not on PYTHONPATH" in left_out[2]
    assert "the back end cuda cannot run: expected" in left_out[3]


def test_the_losses_in_torch_are_the_same_losses():
    random, camera = torch.Generator().manual_seed(0), engine_camera(Workload("", 0, 24, 1.0))
    image, target = (torch.rand(24, 24, 3, generator=random) for _ in range(2))
    torch.testing.assert_close(
        splat.photometric_map(image, target), torch_photometric(image, target), atol=1e-5, rtol=0
    )
    depth, alpha = 2 + torch.rand(24, 24, generator=random), torch.rand(24, 24, generator=random)
    expected = torch_depth_normal(depth, image, alpha, camera)
    torch.testing.assert_close(
        splat.depth_normal_map(depth, image, alpha, camera), expected, atol=1e-4, rtol=0
    )


def test_a_plan_of_some_parts_and_workloads():
    plan = speed.speed_plan(("losses",), ("A", "S"), repetitions=2)
    assert plan.parts == ("losses",)
    assert [w.name for w in plan.workloads] == ["A"]
    assert [w.name for w in plan.peers] == ["S", "A"]
    assert [w.name for w in plan.traced] == ["A"]
    assert plan.patience.repetitions == 2
    assert speed.speed_plan() == speed.SpeedPlan()
    assert speed.speed_plan(quick=True) == speed.QUICK_PLAN


def test_workloads_that_do_not_exist_are_named(capsys: pytest.CaptureFixture[str]):
    assert main(["speed", "engine", "--workloads", "F"]) == 2
    assert "expected a workload that exists, got 'F'" in capsys.readouterr().err


def test_a_picture_of_another_kind_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["speed", "engine", "--quick", "--plot", str(tmp_path / "speed.png")]) == 2
    assert "a name that ends in .svg" in capsys.readouterr().err


@pytest.mark.parametrize("options", [["truth", "--quick"], ["score", "--parts", "step"]])
def test_options_of_the_engine_are_not_for_others(options: list[str], capsys: pytest.CaptureFixture[str]):
    assert main(["speed", *options]) == 2
    assert f"expected no {options[1]} with `graycard speed {options[0]}`" in capsys.readouterr().err
