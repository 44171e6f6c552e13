# SPDX-License-Identifier: Apache-2.0
"""Adam on surfels, schedules, faults, and fits that are killed and go on."""

import importlib.util
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import torch
from safetensors.torch import load_file

from graycard import Camera, MethodError, look_at, methods
from graycard.io import silent
from graycard.methods import splat
from graycard.methods.splat.raster import _stages

PROGRAM = Path(__file__).with_name("fit_checks.py")
_spec = importlib.util.spec_from_file_location("fit_checks", PROGRAM)
assert _spec is not None
assert _spec.loader is not None
fit_checks = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(fit_checks)


def some_parameters(count: int = 5) -> splat.Parameters:
    random = np.random.default_rng(0)
    surfels = splat.surfels_from_points(
        random.normal(size=(count, 3)), random.normal(size=(count, 3)), np.zeros((count, 0)), 0.4
    )
    return splat.parameters_of(surfels, {"albedo": torch.full((count, 3), 0.5)}, {"light": torch.ones(2, 2)})


def far_from_zero(values: Mapping[str, torch.Tensor], step: int) -> splat.LossResult:
    """A sum that every parameter is in, each step with another weight."""
    return splat.LossResult(
        sum(((v * (step + 1)).sin().sum() for v in values.values()), start=torch.zeros(()))
    )


def test_surfels_come_back_from_their_parameters():
    random = np.random.default_rng(1)
    surfels = splat.surfels_from_points(
        random.normal(size=(9, 3)), random.normal(size=(9, 3)), np.zeros((9, 0)), 0.3
    )
    found = splat.surfels_of(splat.parameters_of(surfels).surfels, torch.ones(9, 4))
    for name in ("centres", "rotations", "scales", "opacities"):
        torch.testing.assert_close(getattr(found, name), getattr(surfels, name))
    assert found.features.shape == (9, 4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: replace(p, surfels={"centres": torch.zeros(2, 3)}), "got none of log_scales, rotations"),
        (lambda p: replace(p, surfels={**p.surfels, "x": torch.zeros(4)}), "one row a surfel in every"),
        (lambda p: replace(p, shared={"albedo": torch.zeros(1)}), "each name once, got albedo"),
    ],
)
def test_parameters_without_sense(change, message: str):
    with pytest.raises(ValueError, match=message):
        change(some_parameters())


def test_the_extent_is_that_of_the_cameras():
    cameras = [
        Camera.from_fov(4, 4, 50, look_at(np.array([x, 0.0, 0]), np.array([x, 1.0, 0]))) for x in (0, 1, 2)
    ]
    assert splat.scene_extent(cameras) == pytest.approx(1.1)
    with pytest.raises(ValueError, match="at least one camera"):
        splat.scene_extent([])


def test_rates_decay_exponentially_within_their_windows():
    rate = splat.LearningRateSchedule(1e-2, 1e-4, ((0.0, 0.25), (0.5, 1.0)))
    assert rate.at(0) == pytest.approx(1e-2)
    assert rate.at(0.5) == pytest.approx(1e-3)
    assert rate.at(0.25) == rate.at(0.49) == rate.at(1.0) == 0
    assert rate.times(10).at(0.5) == pytest.approx(1e-2)
    assert splat.LearningRateSchedule(0.3).at(0.9) == 0.3


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((0.0, None, ((0, 1),)), "positive rates"),
        ((1.0, -1.0, ((0, 1),)), "positive rates"),
        ((1.0, None, ((0.5, 0.5),)), "windows within 0 to 1"),
        ((1.0, None, ((0.5, 1.5),)), "windows within 0 to 1"),
    ],
)
def test_rates_without_sense(values, message: str):
    with pytest.raises(ValueError, match=message):
        splat.LearningRateSchedule(*values)


def test_steps_are_those_of_the_plain_adam():
    """Against ``torch.optim.Adam``, each parameter with its own decaying rate, one of them not moving."""
    rates = {
        splat.CENTRES: splat.LearningRateSchedule(1e-2, 1e-3),
        "albedo": splat.LearningRateSchedule(5e-2),
        "light": splat.LearningRateSchedule(3e-2, None, ((0.0, 0.5),)),
    }
    plan, state = splat.TrainConfig(6, rates, 1.0), splat.initial_state(some_parameters(), 0)
    plain = {
        name: values.clone().requires_grad_(name in rates) for name, values in some_parameters().all.items()
    }
    groups = [{"params": [plain[name]], "name": name} for name in rates]
    optimiser = torch.optim.Adam(groups, eps=1e-15, foreach=False)
    for step in range(6):
        state = splat.train_step(state, plan, far_from_zero)
        optimiser.zero_grad()
        far_from_zero(plain, step).loss.backward()
        for group in optimiser.param_groups:
            group["lr"] = rates[group["name"]].at(step / 6)
            if group["lr"] == 0:
                group["params"][0].grad = None
        optimiser.step()
    for name, values in state.parameters.all.items():
        torch.testing.assert_close(values, plain[name].detach(), rtol=1e-5, atol=1e-6)
    assert torch.equal(state.parameters.surfels[splat.LOGITS], some_parameters().surfels[splat.LOGITS])
    assert float(state.moments["light"].steps) == 3


def test_the_layout_of_memory_does_not_count():
    """Harmonics are joined for drawing: the gradients of their parts are slices of that of the whole."""
    random = torch.Generator().manual_seed(0)
    whole, gradient = (torch.randn(5, 4, 3, generator=random) for _ in range(2))
    rate = {"detail": splat.LearningRateSchedule(1e-2)}
    for part, slope in ((whole[:, 1:], gradient[:, 1:]), (whole.mT, gradient.mT)):
        moved = []
        for values, towards in ((part.clone(), slope), (part, slope.contiguous())):
            parameters = replace(some_parameters(), shared={"detail": values})
            state = splat.initial_state(parameters, 0)
            moved.append(splat.adam_step(state, {"detail": towards}, rate, 0.0).parameters.shared["detail"])
        step = (part - 1e-2 * slope.sign()).contiguous()
        for found in moved:
            torch.testing.assert_close(found, step, rtol=0, atol=1e-6)


def test_survivors_of_pruning_move_as_if_nothing_had_happened():
    rates = {"albedo": splat.LearningRateSchedule(5e-2), splat.CENTRES: splat.LearningRateSchedule(1e-2)}
    plan = splat.TrainConfig(4, rates, 1.0)
    kept = torch.tensor([True, False, True, True, False])
    whole = splat.initial_state(some_parameters(), 0)
    part = splat.initial_state(some_parameters().take(kept), 0)
    for _ in range(2):
        whole, part = (splat.train_step(state, plan, far_from_zero) for state in (whole, part))
    whole = splat.keep(whole, kept)
    for _ in range(2):
        whole, part = (splat.train_step(state, plan, far_from_zero) for state in (whole, part))
    for name, values in whole.parameters.all.items():
        assert torch.equal(values, part.parameters.all[name]), name


def test_the_screen_remembers_per_half_an_image():
    state = splat.initial_state(some_parameters(3), 0)
    gradient = torch.tensor([[3e-6, 0.0], [0, 4e-6], [0, 0]])
    radius = torch.tensor([0.2, 0.1, 0.9])
    coarse = splat.watch_screen(state.screen, gradient, radius, (100, 50))
    torch.testing.assert_close(coarse.gradient, torch.tensor([1.5e-4, 1e-4, 0]))
    fine = splat.watch_screen(state.screen, gradient / 2, radius, (200, 100))
    torch.testing.assert_close(fine.gradient, coarse.gradient)
    assert coarse.views.tolist() == [1, 1, 0]
    torch.testing.assert_close(coarse.radius, torch.tensor([0.2, 0.1, 0.0]))  # the third was not seen


def nan_at(name: str, at: int):
    def look(values: Mapping[str, torch.Tensor], step: int) -> splat.LossResult:
        loss = far_from_zero(values, step).loss
        poison = values[name].flatten()[4] - values[name].flatten()[4].detach()
        return splat.LossResult(
            loss + (poison.sqrt() if step == at else 0)
        )  # the root's slope at 0 is infinite

    return look


@pytest.mark.parametrize("name", ["albedo", splat.CENTRES])
def test_a_gradient_that_is_not_finite_is_named(name: str):
    plan = splat.TrainConfig(9, {name: splat.LearningRateSchedule(1e-3)}, 1.0)
    message = f"expected finite gradients, got one of '{name}' that is not at step 3 \\(row 1\\)"
    with pytest.raises(MethodError, match=message):
        splat.train(splat.initial_state(some_parameters(), 0), plan, nan_at(name, 3), silent)


def test_a_loss_that_is_not_finite_is_named():
    def look(values: Mapping[str, torch.Tensor], step: int) -> splat.LossResult:
        return splat.LossResult(values["albedo"].sum() / (0.0 if step == 2 else 1.0))

    plan = splat.TrainConfig(9, {"albedo": splat.LearningRateSchedule(1e-3)}, 1.0)
    with pytest.raises(MethodError, match="expected a finite loss, got inf at step 2"):
        splat.train(splat.initial_state(some_parameters(), 0), plan, look, silent)


def test_a_fit_that_does_not_fit_into_memory_says_so(monkeypatch: pytest.MonkeyPatch):
    """Not at the step that would end the process, but before."""
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=1000))
    monkeypatch.setattr(_stages, "UNCHECKED", 0)
    with pytest.raises(MethodError, match=r"GiB of memory to draw 12 surfels, got .*: draw fewer"):
        splat.train(fit_checks.start(), fit_checks.plan(None), fit_checks.objective, silent)


@pytest.mark.parametrize("name", [splat.CENTRES, splat.LOG_SCALES, splat.ROTATIONS, splat.LOGITS])
def test_a_fit_of_what_is_no_number_is_refused(name: str):
    """By the tensor that holds it, before it is drawn."""
    start = fit_checks.start()
    start.parameters.surfels[name].view(12, -1)[4, 0] = float("nan")
    of = {splat.LOG_SCALES: "scales", splat.LOGITS: "opacities"}.get(name, name)
    with pytest.raises(ValueError, match=f"expected {of} to be finite, got .*nan.* at surfel 4"):
        splat.train(start, fit_checks.plan(None), fit_checks.objective, silent)


def test_large_gradients_are_no_fault():
    """Their sum overflows, they do not."""
    large = {"albedo": torch.full((5, 3), 1e38)}
    state = splat.initial_state(some_parameters(), 0)
    assert splat.adam_step(state, large, {"albedo": splat.LearningRateSchedule(1e-3)}, 0.0).step == 1


def run(out: Path, checkpoint: Path | None, stop: int = -1) -> subprocess.Popen[str]:
    command = [sys.executable, str(PROGRAM), str(out), str(checkpoint or "-"), str(stop)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def test_a_killed_fit_goes_on_to_the_same_bits(tmp_path: Path):
    """Killed twice by SIGKILL, between savings; surfels were split, pruned and reset meanwhile."""
    undisturbed, resumed = tmp_path / "whole.safetensors", tmp_path / "resumed.safetensors"
    with run(undisturbed, None) as whole:
        for stop in (13, 30):
            with run(resumed, tmp_path / "saved", stop) as process:
                assert process.stdout is not None
                assert process.stdout.readline() == "here\n"
                process.send_signal(signal.SIGKILL)
            assert process.returncode == -signal.SIGKILL
            assert not resumed.exists()
        with run(resumed, tmp_path / "saved") as process:
            pass
        assert process.returncode == 0
    assert whole.returncode == 0
    expected, found = load_file(undisturbed), load_file(resumed)
    assert expected.keys() == found.keys()
    assert all(values.numpy().tobytes() == found[name].numpy().tobytes() for name, values in expected.items())
    last = splat.load_state(splat.Checkpoint(resumed, 1, ""))
    assert last is not None
    assert last.step == fit_checks.STEPS
    assert len(last.parameters) > 12
    assert float(last.moments[splat.LOGITS].steps) == 32  # its rate has a gap of a fifth


def test_a_fit_without_end_is_not_begun_anew(tmp_path: Path):
    """A finished fit that is asked for again is read, not run."""
    plan = fit_checks.plan(tmp_path / "saved")
    first = splat.train(fit_checks.start(), plan, fit_checks.objective, silent)

    def refuse(values: Mapping[str, torch.Tensor], step: int) -> splat.LossResult:
        raise AssertionError("this step is done")

    again = splat.train(fit_checks.start(), plan, refuse, silent)
    for name, values in first.parameters.all.items():
        assert torch.equal(values, again.parameters.all[name]), name


def test_a_fit_that_stops_early_is_saved_there_and_goes_on(tmp_path: Path):
    """Between two savings, and to the same bits."""
    checkpoint = splat.Checkpoint(tmp_path / "saved", 1000, "")
    whole = splat.TrainConfig(6, {"albedo": splat.LearningRateSchedule(5e-2, 1e-2)}, 1.0)
    plan = replace(whole, checkpoint=checkpoint)

    def fit(plan: splat.TrainConfig) -> splat.FitState:
        return splat.train(splat.initial_state(some_parameters(), 0), plan, far_from_zero, silent)

    assert fit(replace(plan, until=4)).step == 4
    saved = splat.load_state(checkpoint)
    assert saved is not None
    assert saved.step == 4
    for name, values in fit(whole).parameters.all.items():
        assert torch.equal(values, fit(plan).parameters.all[name]), name


def test_progress_counts_steps_from_where_a_fit_went_on(tmp_path: Path):
    rates = {"albedo": splat.LearningRateSchedule(5e-2, 1e-2)}
    plan = splat.TrainConfig(1000, rates, 1.0, checkpoint=splat.Checkpoint(tmp_path / "saved", 1000, ""))
    for until, expected in ((1, ["step 1 of 1,000"]), (3, ["step 2 of 1,000", "step 3 of 1,000"])):
        told: list[str] = []
        splat.train(
            splat.initial_state(some_parameters(), 0),
            replace(plan, until=until),
            far_from_zero,
            lambda done, doing, told=told: told.append(doing),
        )
        assert told == [f"fitting, {words}, 5 surfels" for words in expected]


def test_fits_that_depend_on_the_same_share_a_folder(tmp_path: Path):
    """A step of one is not done by another, and its time counts; who depends on other things begins anew."""
    mine = splat.Checkpoint(tmp_path / "stages", 1000, "mine", shared=True)
    plan = splat.TrainConfig(6, {"albedo": splat.LearningRateSchedule(5e-2, 1e-2)}, 1.0, checkpoint=mine)
    steps: list[float] = []

    def fit(checkpoint: splat.Checkpoint) -> splat.FitState:
        def count(done: float, doing: str) -> None:
            steps.append(done)

        state = splat.initial_state(some_parameters(), 0)
        return splat.train(state, replace(plan, checkpoint=checkpoint), far_from_zero, count)

    with methods.resumed_time() as nothing:
        first = fit(mine)
    with methods.resumed_time() as found:
        second = fit(mine)
    assert len(steps) == 6
    assert nothing.seconds == 0 < found.seconds
    for name, values in first.parameters.all.items():
        assert torch.equal(values, second.parameters.all[name]), name
    fit(replace(mine, identity="yours"))
    fit(mine.beside("later"))
    fit(mine.beside("later", [torch.ones(1)]))
    fit(mine.beside("later", chosen="otherwise"))
    assert len(steps) == 5 * 6
    assert len(list(mine.path.iterdir())) == 5
    assert found.peak_mib > 1
    mine.file.write_bytes(b"")  # what is damaged is no reason for others to fail
    fit(mine)
    assert len(steps) == 6 * 6
    assert splat.load_state(mine) is not None


def test_surfels_go_by_what_was_seen_of_them_before_new_ones_come():
    rules = splat.DensityRules(
        start=0.0, until=1.0, every=0.1, reset_every=0.2, largest=None, largest_on_screen=0.3
    )
    plan = splat.TrainConfig(10, {"albedo": splat.LearningRateSchedule(1e-3)}, 1.0, rules)
    state = splat.initial_state(some_parameters(), 0)
    radius = torch.tensor([0.1, 0.4, 0.2, 0.1, 0.5])
    state = replace(state, step=4, screen=replace(state.screen, radius=radius))
    assert len(splat.train_step(state, plan, far_from_zero).parameters) == 3


def test_surfels_that_cannot_be_where_they_are_go_when_others_do():
    rules = splat.DensityRules(start=0.0, until=1.0, every=0.2, reset_every=1.0, largest=None)

    def misplaced(surfels: Mapping[str, torch.Tensor]) -> torch.Tensor:
        return surfels["albedo"][:, 0] > 0.7

    rates = {"albedo": splat.LearningRateSchedule(1e-4)}
    plan = splat.TrainConfig(10, rates, 1.0, rules, misplaced=misplaced)
    parameters = some_parameters()
    parameters.surfels["albedo"][[1, 3], 0] = 0.8  # pyright: ignore[reportIndexIssue]
    state = splat.initial_state(parameters, 0)
    left = {
        step: splat.train_step(replace(state, step=step), plan, far_from_zero).parameters.surfels["albedo"]
        for step in (0, 1)
    }
    assert len(left[0]) == 5  # after one step nothing comes or goes
    assert len(left[1]) == 3
    assert (left[1][:, 0] < 0.7).all()


def test_every_view_once_in_a_round_in_an_order_of_the_seed():
    orders = {
        (seed, first): [splat.view_at(first + step, 9, seed) for step in range(9)]
        for seed in (0, 1)
        for first in (0, 9)
    }
    assert all(sorted(order) == list(range(9)) for order in orders.values())
    assert len({tuple(order) for order in orders.values()}) == 4
    for step in (3, 12):  # asked for by turns
        for seed in (0, 1):
            assert splat.view_at(step, 9, seed) == orders[seed, step - step % 9][step % 9]


def test_another_fit_and_a_damaged_file_are_refused(tmp_path: Path):
    mine = splat.Checkpoint(tmp_path / "saved", 1, "mine")
    assert splat.load_state(mine) is None
    splat.save_state(mine, fit_checks.start())
    with pytest.raises(MethodError, match="got one of others. Delete it to begin anew"):
        splat.load_state(replace(mine, identity="yours"))
    mine.path.write_bytes(mine.path.read_bytes()[:-9])
    with pytest.raises(MethodError, match="the saved fit in .* cannot be read.*Delete it"):
        splat.load_state(mine)
    splat.save_surfels(mine.path, splat.surfels_of(fit_checks.start().parameters.surfels))
    with pytest.raises(MethodError, match="graycard-surfels"):
        splat.load_state(mine)


def test_plans_without_sense(tmp_path: Path):
    with pytest.raises(ValueError, match="1 or more steps"):
        splat.TrainConfig(0, {}, 1.0)
    with pytest.raises(ValueError, match="checkpoint every 1 or more"):
        splat.Checkpoint(tmp_path, 0, "")
