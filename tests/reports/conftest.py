# SPDX-License-Identifier: Apache-2.0
"""A whole run folder on disk, made by hand: the tiny scenes, noisy predictions, invented scores."""

import math
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, sync_playwright

from graycard import EnvironmentLight, Light, Predictions, open_truth
from graycard.io import sha256, write_json
from graycard.predictions import finish_predictions, write_view
from graycard.records import (
    Cost,
    Job,
    JobResult,
    MethodRecord,
    MetricRecord,
    RunRecord,
    SceneRecord,
    Score,
    ScoreSheet,
)
from graycard.reports import write_report
from opened import opened
from report_pages import CHROMIUM

HOSTILE = "<script>window.broken = 1</script>"
METHODS = (
    MethodRecord("truth", "The truth itself, to show what is possible.", ("radiance", "lights")),
    MethodRecord("gray", "Every surface is gray.", ()),
    MethodRecord("retinex", "Reflectance changes in steps, light smoothly.", ()),
    MethodRecord(HOSTILE, 'Says "nothing" & <b>fails</b>.', ()),
)
METRICS = (
    MetricRecord(
        "novel_view.psnr", "Novel view PSNR", "novel_view", "dB", True, math.inf,
        "10·log10(1 / MSE), srgb(L·exposure) <mask>", True, 0.3,
    ),
    MetricRecord("novel_view.ssim", "Novel view SSIM", "novel_view", "1", True, 1.0, "mean", False, 0.01),
    MetricRecord(
        "counterfactual.psnr", "Removal PSNR", "counterfactual", "dB", True, math.inf, "as above", True, 0.3
    ),
    MetricRecord(
        "albedo.psnr.channel", "Albedo PSNR", "albedo", "dB", True, math.inf, "s_c·base_color", True, 0.3
    ),
    MetricRecord(
        "normal.mean_angle", "Normal error, mean", "normal", "°", False, 0.0, "atan2(|p×t|, p·t)", True, 0.5
    ),
    MetricRecord(
        "light.position", "Light position error", "light", "% of the scene's diameter", False, 0.0,
        "100·|p - t| / diameter", True, 1.0,
    ),
)  # fmt: skip
QUALITY = {"truth": 0.0, "gray": 0.12, "retinex": 0.05, HOSTILE: 0.3}
GAUGE = (2.0, 1.0, 0.5)


def predicted_layers(true: dict[str, np.ndarray], quality: float, seed: int) -> dict[str, np.ndarray]:
    """Noisy layers; the base colour is off by the gauge that the score states."""
    noise = np.random.default_rng(seed)
    names = ("radiance", "base_color", "normal", "depth", "counterfactual.radiance")
    found = {n: true[n] * (1 + quality * noise.normal(size=true[n].shape)) for n in names if n in true}
    found["base_color"] = found["base_color"] / (np.array(GAUGE) if quality else 1)
    return found


def scene_metrics(track: str) -> list[MetricRecord]:
    return [m for m in METRICS if m.group != "counterfactual" or track == "tabletop"]


def make_score(metric: MetricRecord, quality: float, views: list[str], status: str = "scored") -> Score:
    perfect = metric.optimum if quality == 0 else None
    value = perfect if perfect is not None else {"dB": -20 * math.log10(quality), "1": 1 - quality}.get(
        metric.unit, 100 * quality
    )  # fmt: skip
    scored = status == "scored"
    return Score(
        metric.id,
        "graycard-0",
        status,  # pyright: ignore[reportArgumentType]
        value if scored else None,
        metric.unit,
        metric.higher_is_better,
        metric.optimum,
        per_view={v: value + i for i, v in enumerate(views)} if scored else {},
        noise_ceiling=48.5 if scored and metric.id == "novel_view.psnr" else None,
        gauge=GAUGE if quality and metric.group == "albedo" else None,
        expected=len(views),
        scored=len(views) if scored else 0,
        reason="" if scored else {"failed": "expected light, got <none>"}.get(status, "no lights.json"),
        warnings=("1 of 2 lights has no partner",) if quality == 0.12 and metric.group == "light" else (),
    )


def write_job(run: Path, scene: SceneRecord, method: str, seed: int) -> JobResult:
    """The predictions of one job, and its hand-made scores."""
    truth = open_truth(run / scene.folder / "truth", check=False)
    quality = QUALITY[method]
    slug = {HOSTILE: "hostile"}.get(method, method)
    folder = f"jobs/{scene.track}/{scene.scene}/{slug}-{seed}"
    test = [v for v in truth.views if v.split == "test"]
    for i, view in enumerate(test):
        layers = predicted_layers(truth.layers(view), quality, 10 * seed + i)
        if method == "gray":
            del layers["normal"]
        write_view(run / folder / "predictions", view.name, layers)
    lights = None if method == "retinex" else tuple(move(light, quality) for light in truth.lights())
    finish_predictions(run / folder / "predictions", Predictions(method, scene.track, scene.scene), lights)
    silent = {"gray": "normal", "retinex": "light"}.get(method, "")
    views = [v.name for v in test]
    scores = tuple(
        make_score(m, quality, views, "not provided" if m.group == silent else "scored")
        for m in scene_metrics(scene.track)
    )
    sheet = ScoreSheet(scene.track, scene.scene, method, "ab" * 32, scene.truth_sha256, scores)
    job = Job(scene.track, scene.scene, method, seed, {})
    return JobResult(job, "0123456789ab", folder, "done", sheet=sheet, cost=Cost(12.5, 345.6))


def move(light: Light, quality: float) -> Light:
    if isinstance(light, EnvironmentLight):
        return light
    position = np.array(light.position) + quality * np.array([2.0, -3.0, 1.0])
    return replace(light, position=tuple(float(x) for x in position))


def fail(result: JobResult, reason: str) -> JobResult:
    return replace(result, status="failed", reason=reason, sheet=None, cost=None)


def write_run(run: Path, scenes: dict[str, Path], seeds: tuple[int, ...] = (0,)) -> RunRecord:
    """A run of four methods on the given scenes; the hostile one fails on the dark track."""
    records = tuple(
        SceneRecord(
            track, folder.name, "tiny", 0, f"dataset/{track}/{folder.name}",
            sha256(folder / "truth" / "manifest.json"), "A ball on a floor, a small red one beside it",
        )
        for track, folder in scenes.items()
    )  # fmt: skip
    for scene, folder in zip(records, scenes.values(), strict=True):
        shutil.copytree(folder, run / scene.folder)
    results = [write_job(run, s, m.name, seed) for s in records for m in METHODS for seed in seeds]
    reason = "expected the worker to come back, got its death <exit code -9>"
    results = [fail(r, reason) if r.job.method == HOSTILE and r.job.track == "dark" else r for r in results]
    environment: dict[str, Any] = {
        "packages": {"graycard": "0.1.0", "mitsuba": "3.9.1", "torch": None},
        "git_commit": "0123abc+",
        "cpu": "An & Example <CPU>",
        "cores": 2,
        "renderer": [{"name": "mitsuba", "variant": "llvm_ad_rgb"}],
    }
    record = RunRecord(
        "smoke",
        3,
        records,
        METHODS,
        METRICS,
        tuple(results),
        environment,
        "2026-11-21T09:47:14+00:00",
        3725.4,
    )
    write_json(run / "run.json", record)
    return record


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A headless browser for the tests of one module."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def make_run(tmp_path: Path, tiny_scenes: dict[str, Path]) -> Callable[..., tuple[Path, RunRecord]]:
    """``make_run(seeds=(0,))`` writes a run of its own and gives its folder and record."""

    def make(**options: Any) -> tuple[Path, RunRecord]:
        return tmp_path / "run", write_run(tmp_path / "run", tiny_scenes, **options)

    return make


@pytest.fixture(scope="session")
def tiny_run(tmp_path_factory: pytest.TempPathFactory, tiny_scenes: dict[str, Path]) -> Path:
    """A run folder with three tracks and four methods, shared and not to be changed."""
    run = tmp_path_factory.mktemp("run")
    write_run(run, tiny_scenes)
    return run


@pytest.fixture(scope="session")
def report_path(tiny_run: Path) -> Path:
    """The path of the page of the shared run."""
    return write_report(tiny_run)


@pytest.fixture
def heard() -> list[str]:
    """Messages of the console and requests to other hosts, of which a page makes none."""
    return []


@pytest.fixture(scope="session")
def tiny_page(report_path: Path) -> str:
    """The HTML text of the shared run, with closed parts as data."""
    return report_path.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def tiny_report(tiny_page: str) -> str:
    """The same with all parts opened."""
    return opened(tiny_page)
