# SPDX-License-Identifier: Apache-2.0
"""Fits with the back end ``cuda``: on a device that stands in for a GPU, and on one."""

import gc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from graycard import GraycardError, open_truth, srgb_encode
from graycard.benchmarks import FitSpec, fit_scene
from graycard.dataset import manifest_of
from graycard.io import silent, write_manifest
from graycard.methods.splat.cuda import _rasterize as _cuda
from graycard.methods.splat.cuda._footprints import Kernels
from gsplat_stand_ins import stand_ins
from sparse_points import with_points
from stand_in_gpu import by_inner, stand_in_gpu
from tiny_fits import TRACKS, fitted, pictures

FEW = ("goris",)
"""Those that CI has time for, besides the twenty steps of 2dgs below."""
PAPERS = ("2dgs", "sunfaded", "gsid", "goris")
DRAWN = {"sunfaded": "radiance", "gsid": "radiance", "goris": "radiance"}


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean((one - other) ** 2) + 1e-12))


def truth_of(scene: Path) -> np.ndarray:
    truth = open_truth(scene / "truth", check=False)
    return np.stack([srgb_encode(truth.layers(view)["radiance"] * truth.exposure) for view in truth.views])


@pytest.fixture
def gpu(monkeypatch: pytest.MonkeyPatch) -> Iterator[torch.device]:
    """A device that stands in for a GPU."""
    pytest.importorskip("gsplat", reason="gsplat comes with the extra 'gpu'")
    monkeypatch.setattr(_cuda, "gsplat_kernels", lambda: Kernels(*map(by_inner, stand_ins())))
    with stand_in_gpu() as device:
        yield device


@pytest.mark.parametrize("name", [n if n in FEW else pytest.param(n, marks=pytest.mark.slow) for n in TRACKS])
def test_a_fit_on_a_gpu_goes_as_on_the_cpu(name: str, make_scene: Callable[..., Path], gpu: torch.device):
    """All tensors lie where they should, and pictures differ by what rounding grows to."""
    scene = make_scene(track=TRACKS[name], train=4, test=1)
    changes = {"iterations": 10, "surfels": 150, "fill": 0.0}
    shown = [pictures(fitted(name, scene, backend, **changes), scene) for backend in ("cpu", "cuda")]
    assert psnr(*shown) > 40


def test_twenty_steps_end_within_rounding(make_scene: Callable[..., Path], gpu: torch.device):
    scene = make_scene(train=4, test=1)
    changes = {"iterations": 20, "surfels": 150, "fill": 0.0}
    shown = [pictures(fitted("2dgs", scene, backend, **changes), scene) for backend in ("cpu", "cuda")]
    assert np.abs(shown[0] - shown[1]).max() < 1e-2
    assert psnr(*shown) > 55


def test_a_fit_that_was_cut_off_goes_on_on_a_gpu(
    make_scene: Callable[..., Path], gpu: torch.device, tmp_path: Path
):
    scene, changes = make_scene(train=4, test=1), {"iterations": 10, "surfels": 150, "fill": 0.0}
    whole = pictures(fitted("2dgs", scene, "cuda", **changes, checkpoint=str(tmp_path / "fit")), scene)
    again = pictures(fitted("2dgs", scene, "cuda", **changes, checkpoint=str(tmp_path / "fit")), scene)
    assert np.array_equal(whole, again)
    with pytest.raises(GraycardError, match="hold a fit of these photographs with these settings"):
        fitted("2dgs", scene, "cpu", **changes, checkpoint=str(tmp_path / "fit"))


@pytest.mark.parametrize("name", TRACKS)
def test_without_a_gpu_a_fit_says_so_at_once(
    name: str, make_scene: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(_cuda, "find_spec", lambda name: None)
    with pytest.raises(GraycardError, match=r"pip install 'graycard\[gpu\]'"):
        fitted(name, make_scene(track=TRACKS[name]), "cuda", iterations=2)


def test_an_unknown_back_end_is_refused(make_scene: Callable[..., Path]):
    with pytest.raises(GraycardError, match="backend"):
        fitted("2dgs", make_scene(), "tpu")


def confined_fit(make_scene: Callable[..., Path]) -> FitSpec:
    """A short fit on a GPU, of a scene whose manifest knows its points."""
    scene = make_scene(train=4, test=1)
    capture = with_points(scene)
    write_manifest(scene / "capture", manifest_of(capture))
    settings = {"iterations": 10, "surfels": 150, "fill": 0.0, "backend": "cuda"}
    return FitSpec("2dgs", settings, 0, scene)


def test_a_confined_fit_without_a_gpu_says_so(make_scene: Callable[..., Path], tmp_path: Path):
    if torch.cuda.is_available():
        pytest.skip("needs a machine without a GPU")
    with pytest.raises(GraycardError, match="for the back end 'cuda'"):
        fit_scene(confined_fit(make_scene), tmp_path / "predictions", silent)


def held_memory() -> int:
    """Bytes of the GPU that tensors hold; cuBLAS keeps room to work in, which is not counted."""
    gc.collect()
    torch._C._cuda_clearCublasWorkspaces()
    return torch.cuda.memory_allocated()


@pytest.mark.gpu
def test_a_confined_fit_finds_the_gpu(make_scene: Callable[..., Path], tmp_path: Path):
    fit_scene(confined_fit(make_scene), tmp_path / "predictions", silent)
    assert (tmp_path / "predictions").is_dir()


@pytest.mark.gpu
@pytest.mark.parametrize("name", TRACKS)
def test_a_fit_on_a_real_gpu(name: str, make_scene: Callable[..., Path], record_property: Any):
    """Its pictures are as good as the CPU's, and the GPU's memory is free again."""
    scene = make_scene(track=TRACKS[name], train=5, test=2)
    before, expected = held_memory(), truth_of(scene)
    changes = {"iterations": 200, "surfels": 400, "fill": 0.0}
    scores = {}
    for backend in ("cpu", "cuda"):
        scores[backend] = psnr(pictures(fitted(name, scene, backend, **changes), scene), expected)
        record_property(backend, scores[backend])
    first = psnr(pictures(fitted(name, scene, "cuda", **changes | {"iterations": 2}), scene), expected)
    assert scores["cuda"] > first
    assert abs(scores["cuda"] - scores["cpu"]) < 0.3
    assert held_memory() - before < 2**16
