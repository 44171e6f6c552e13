# SPDX-License-Identifier: Apache-2.0
"""Measure the back end ``cuda`` on a GPU, in short tables.

Run ``PYTHONPATH=src:tests python tests/helpers/gpu_check.py PART [FOLDER]``.

``engine`` times drawing on the clouds of ``graycard speed engine``, ``profile`` shows where a step of 2dgs
spends time, ``large`` fits a scene in closed form at 512 and 800 pixels, and ``scenes`` fits rendered scenes
``FOLDER/<track>/<scene>`` on the CPU and on the GPU. ``one FOLDER/<track>/<scene> METHOD STEPS SURFELS`` fits
one scene on the GPU. A case that fails says so, and the next one follows.
"""

import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from graycard import MethodError, methods, open_capture, open_truth, srgb_encode
from graycard.benchmarks.speed._machine import Patience, time_calls
from graycard.benchmarks.speed.engine._calls import memory_of, scene_of, time_both
from graycard.benchmarks.speed.engine._scenes import PAPER_SIZED, WORKLOADS, Workload
from graycard.benchmarks.speed.engine._step import LOSSES, _fit, measure_steps
from graycard.io import silent
from graycard.methods.priors import PriorSpec, make_priors
from graycard.methods.splat import device_of, on_device, rasterize, state_on, train_step
from graycard.tiny import write_tiny_scene
from sparse_points import with_points

PATIENCE = Patience(3, 0.1, 2.0)
Row = Iterable[object]


def say(*words: object) -> None:
    """Write a line at once."""
    sys.stdout.write(" ".join(map(str, words)) + "\n")
    sys.stdout.flush()


def tried(name: str, make: Callable[[], Row]) -> None:
    """Write the row that a case gives, or why it gives none."""
    try:
        row = make()
    except Exception as error:
        traceback.print_exc()
        row = ("FAILED", type(error).__name__, str(error).splitlines()[0][:100])
    say(f"| {name} |", *(f"{cell} |" for cell in row))


def engine() -> None:
    """Time drawing and whole steps, forward and backward, with the memory at their peak."""
    say("cloud | surfels | px | features ms f | f+b | MiB | all maps ms f | f+b | MiB")
    for cloud in (*WORKLOADS, PAPER_SIZED):
        tried(cloud.name, lambda cloud=cloud: _drawn(cloud))
    say("cloud | losses | on | ms of each stage | whole ms")
    for cloud in (WORKLOADS[3], PAPER_SIZED):
        tried(f"step, {cloud.name}", lambda cloud=cloud: _steps(cloud))


def _drawn(cloud: Workload) -> Row:
    scene = scene_of(cloud, 3).on("cuda")

    def maps(surfels: Any, camera: Any) -> Any:
        drawn = rasterize(surfels, camera)
        seen = drawn.depth.mean() + drawn.distortion.mean() + drawn.normal.mean()
        return replace(drawn, alpha=drawn.alpha + 0 * seen)  # pairs that are summed up have all the gradients

    cells: list[object] = [cloud.surfels, cloud.size]
    for draw in ((), (maps,)):
        forward, both = time_both(scene, PATIENCE, *draw)
        cells += [f"{forward.ms:.2f}", f"{both.ms:.2f}", f"{memory_of(scene, *draw):.0f}"]
    return cells


def _steps(cloud: Workload) -> Row:
    costs = measure_steps(cloud, PATIENCE, "cuda")
    cells: list[object] = [costs[0].device]
    for cost in costs:
        stages = " ".join(f"{name} {timing.ms:.1f}" for name, timing in cost.stages.items())
        cells += [cost.losses, stages, f"{cost.whole.ms:.1f}"]
    return cells


def profile() -> None:
    """Profile some steps of each cloud."""
    for cloud in (Workload("small", 5_000, 112, 0.03), WORKLOADS[3], PAPER_SIZED):
        tried(f"profile, {cloud.name}", lambda cloud=cloud: _profiled(cloud))


def _profiled(cloud: Workload, steps: int = 5) -> Row:
    settings = LOSSES["and geometry"]
    device = device_of("cuda")
    state, plan, objective = _fit(cloud, settings)
    state, objective = state_on(state, device), on_device(objective, device)

    def step() -> None:
        train_step(state, plan, objective)
        torch.cuda.synchronize()

    for _ in range(3):
        step()
    torch.cuda.reset_peak_memory_stats()
    whole = time_calls(step, PATIENCE)
    activities = [torch.profiler.ProfilerActivity.CPU, torch.profiler.ProfilerActivity.CUDA]
    with torch.profiler.profile(activities=activities) as found:
        for _ in range(steps):
            step()
    averages = found.key_averages()
    for order in ("self_device_time_total", "self_cpu_time_total"):
        say(averages.table(sort_by=order, row_limit=22, max_name_column_width=60))
    on_gpu = [event for event in averages if event.device_type.name == "CUDA"]
    device_ms = sum(event.self_device_time_total for event in on_gpu) / 1e3 / steps
    calls = sum(event.count for event in averages if event.key == "cudaLaunchKernel") / steps
    peak = torch.cuda.max_memory_allocated() / 2**20
    spent = f"{whole.ms:.1f} ms a step", f"{device_ms:.1f} ms on the GPU"
    return *spent, f"{calls:.0f} launches", f"{peak:.0f} MiB"


def large() -> None:
    """Fit a scene in closed form at 512 pixels with 60,000 surfels, and at 800 with 200,000."""
    say("case | steps | s | ms a step | surfels | PSNR of training views | peak MiB of the GPU")
    for name, size, count, steps in (
        ("2dgs", 512, 60_000, 300),
        ("2dgs", 800, 200_000, 300),
        ("sunfaded", 512, 60_000, 300),
    ):
        tried(f"{name}, {size} px", lambda a=(name, size, count, steps): _large(*a))


def _large(name: str, size: int, count: int, steps: int) -> Row:
    scene = write_tiny_scene(Path(tempfile.mkdtemp()), train=6, test=1, size=(size, size))
    capture = with_points(scene, spacing=max(1, round((6 * size**2 / count) ** 0.5)))
    chosen = methods.settings_of(
        methods.load_method(name),
        {"iterations": steps, "surfels": count, "fill": 0.0, "backend": "cuda"},
    )
    torch.cuda.reset_peak_memory_stats()
    moments: list[float] = []
    found = methods.load_method(name).fit(
        capture, methods.Priors(), chosen, 0, lambda done, doing: moments.append(time.perf_counter())
    )
    seconds = moments[-1] - moments[len(moments) // 10]
    each = 1e3 * seconds / (len(moments) - 1 - len(moments) // 10)
    peak = torch.cuda.max_memory_allocated() / 2**20
    surfels = len(found.parameters)  # pyright: ignore[reportAttributeAccessIssue]
    good = f"{_psnr(found, scene, 'train'):.2f}"
    return steps, f"{seconds:.1f}", f"{each:.1f}", surfels, good, f"{peak:.0f}"


def _psnr(found: methods.Decomposition, scene: Path, split: str) -> float:
    truth = open_truth(scene / "truth", check=False)
    errors = []
    for view in (view for view in truth.views if view.split == split):
        drawn = found.render(view.camera, ["radiance"])["radiance"]
        shown = [srgb_encode(image * truth.exposure) for image in (drawn, truth.layers(view)["radiance"])]
        errors.append(((shown[0] - shown[1]) ** 2).mean())
    return float(-10 * np.log10(np.mean(errors)))


METHODS = {"dark": ("2dgs", "sunfaded"), "multilight": ("gsid",), "tabletop": ("goris",)}
BUDGET = {"2dgs": 600, "sunfaded": 600, "gsid": 400, "goris": 400}


def scenes(folder: str) -> None:
    """Fit rendered scenes on both: PSNR of training and held-out views, and time."""
    say("method | scene | back end | s | PSNR of training views | of held-out views")
    for backend in ("cuda", "cpu"):
        for track, names in METHODS.items():
            for scene in sorted(Path(folder).glob(f"{track}/*")):
                for name in names:
                    case = f"{name}, {scene.name}, {backend}"
                    tried(case, lambda a=(name, scene, backend): _fitted(*a))


def one(scene: str, method: str, steps: str, surfels: str) -> None:
    """Fit one rendered scene on the GPU by any number of steps and surfels."""
    say("case | s | PSNR of training views | of held-out views | peak MiB of the GPU")
    budget = {"iterations": int(steps), "surfels": int(surfels)}

    def row() -> Row:
        cells = _fitted(method, Path(scene), "cuda", budget)
        return *cells, f"{torch.cuda.max_memory_allocated() / 2**20:.0f}"

    tried(f"{method}, {Path(scene).name}, {steps} steps, {surfels} surfels", row)


def _fitted(name: str, scene: Path, backend: str, budget: dict[str, int] | None = None) -> Row:
    method, capture = methods.load_method(name), open_capture(scene / "capture", check=False)
    truth = open_truth(scene / "truth", check=False)
    asks = methods.asks_of(method)
    known = {view.name: truth.layers(view) for view in truth.views if view.split == "train"} if asks else {}
    spec = PriorSpec("oracle", 1)
    priors = make_priors(spec, asks, capture, known, truth.lights()) if asks else methods.Priors()
    size = budget or {"iterations": BUDGET[name], "surfels": 5000}
    settings = methods.settings_of(method, {**size, "backend": backend})
    start = time.perf_counter()
    found = method.fit(capture, priors, settings, 0, silent)
    seconds = time.perf_counter() - start
    return f"{seconds:.1f}", f"{_psnr(found, scene, 'train'):.2f}", f"{_psnr(found, scene, 'test'):.2f}"


PARTS: dict[str, Callable[..., None]] = {
    "engine": engine,
    "profile": profile,
    "large": large,
    "scenes": scenes,
    "one": one,
}

if __name__ == "__main__":
    part, *given = sys.argv[1:] or [""]
    if part not in PARTS:
        sys.exit(f"expected one of {', '.join(PARTS)}, got {part!r}")
    if not torch.cuda.is_available():
        sys.exit("expected a GPU that PyTorch can use, got none")
    say(f"# {part}: {torch.cuda.get_device_name()}, PyTorch {torch.__version__}")
    try:
        PARTS[part](*given)
    except MethodError as cause:
        sys.exit(str(cause))
