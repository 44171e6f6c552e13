# SPDX-License-Identifier: Apache-2.0
"""``2dgs`` and ``2dgs-oracle`` on a tiny scene, behind the contract."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import graycard
from graycard import (
    Camera,
    GraycardError,
    MethodError,
    look_at,
    methods,
    open_capture,
    open_truth,
    srgb_encode,
)
from graycard.io import code_hash, reached_code, silent
from graycard.layers import find_fault
from graycard.methods import splat
from graycard.methods.surfels import SurfelScene
from sparse_points import with_points

QUICK = {"iterations": 60, "surfels": 400, "degree": 1, "fill": 0.0}
"""The sparse points alone: there are many of them here."""


def oracle(scene: Path) -> methods.Priors:
    truth = open_truth(scene / "truth", check=False)
    return methods.Priors("oracle", {v.name: truth.layers(v) for v in truth.views}, truth.lights())


def fitted(name: str, scene: Path, seed: int = 0, **settings: object) -> SurfelScene:
    method = methods.load_method(name)
    changes = methods.settings_of(method, QUICK | settings)
    found = method.fit(with_points(scene), oracle(scene), changes, seed, silent)
    assert isinstance(found, SurfelScene)
    return found


def display_psnr(scene: Path, found: methods.Decomposition, split: str) -> float:
    truth = open_truth(scene / "truth", check=False)
    errors = []
    for view in truth.views:
        if view.split == split:
            layers = truth.layers(view)
            drawn = found.render(view.camera, ["radiance"])["radiance"]
            shown = [srgb_encode(image * truth.exposure) for image in (drawn, layers["radiance"])]
            errors.append(((shown[0] - shown[1]) ** 2)[layers["object_id"] > 0].mean())
    return float(-10 * np.log10(np.mean(errors)))


@pytest.fixture
def scene(make_scene: Callable[..., Path]) -> Path:
    return make_scene(train=5, test=2)


@pytest.mark.parametrize("name", ["2dgs", "2dgs-oracle"])
def test_each_follows_the_contract(name: str, scene: Path):
    found = fitted(name, scene)
    assert isinstance(methods.load_method(name), methods.Method)
    assert isinstance(found, methods.Decomposition)
    assert not isinstance(found, methods.Relightable | methods.Removable)
    assert found.lights() is None
    for view in open_capture(scene / "capture", check=False).views:
        layers = found.render(view.camera, sorted(found.provides))
        assert layers.keys() == {"radiance", "normal", "depth"}
        for layer, values in layers.items():
            assert find_fault(layer, values, view.camera.height, view.camera.width) is None
            assert values.dtype == np.float32
        np.testing.assert_allclose(np.linalg.norm(layers["normal"], axis=-1), 1, atol=1e-5)
        assert layers["radiance"].min() >= 0
    with pytest.raises(MethodError, match="expected layers out of"):
        found.render(open_truth(scene / "truth", check=False).views[0].camera, ["albedo"])


def test_a_fit_sees_the_scene(scene: Path):
    """Far better than the mean colour, on views that it was not shown too; near the true surfaces."""
    gray = methods.load_method("gray")
    flat = gray.fit(with_points(scene), methods.Priors(), methods.settings_of(gray, {}), 0, silent)
    found = fitted("2dgs", scene, iterations=200)
    for split in ("train", "test"):
        assert display_psnr(scene, found, split) > 6 + display_psnr(scene, flat, split)
    truth = open_truth(scene / "truth", check=False)
    view = next(v for v in truth.views if v.split == "test")
    layers, drawn = truth.layers(view), found.render(view.camera, ["depth", "normal"])
    seen = layers["object_id"] > 0
    assert np.median(np.abs(drawn["depth"][seen] / layers["depth"][seen] - 1)) < 0.05
    angles = [
        np.degrees(np.arccos(np.clip((normal * layers["normal"])[seen].sum(-1), -1, 1)))
        for normal in (drawn["normal"], -view.camera.rays())
    ]
    assert np.median(angles[0]) < 0.8 * np.median(angles[1])  # than if all faced the camera


def test_a_fit_begins_where_stereo_finds_depth(scene: Path):
    """Surfels, as many as asked for, lie on a grid of the photographs, near the true surfaces."""
    start = fitted("2dgs", scene, iterations=1, fill=0.8)
    assert 250 < len(start.parameters) <= 400
    truth = open_truth(scene / "truth", check=False)
    for view in truth.views:
        layers, drawn = truth.layers(view), start.render(view.camera, ["depth"])["depth"]
        seen = (layers["object_id"] > 0) & np.isfinite(drawn)
        assert seen.sum() > 0.7 * (layers["object_id"] > 0).sum()
        assert np.median(np.abs(drawn[seen] / layers["depth"][seen] - 1)) < 0.2


def test_the_oracle_begins_on_the_surface_and_stays_if_frozen(scene: Path):
    free = fitted("2dgs-oracle", scene).parameters
    frozen = fitted("2dgs-oracle", scene, frozen=True).parameters
    start = fitted("2dgs-oracle", scene, frozen=True, iterations=1).parameters
    for name in splat.GEOMETRY:
        assert torch.equal(frozen.surfels[name], start.surfels[name])
        assert not torch.equal(free.surfels[name], start.surfels[name])
    assert not torch.equal(frozen.surfels["coefficients"], start.surfels["coefficients"])
    assert len(free) == len(start) == 400
    truth = open_truth(scene / "truth", check=False)
    for view in truth.views:
        if view.split == "train":
            layers = truth.layers(view)
            drawn = fitted_depth(scene, frozen, view.camera)
            inside = (layers["object_id"] > 0) & np.isfinite(drawn)
            assert np.median(np.abs(drawn[inside] / layers["depth"][inside] - 1)) < 0.01


def fitted_depth(scene: Path, parameters: splat.Parameters, camera: Camera) -> np.ndarray:
    return SurfelScene(parameters, "2dgs-oracle", 1.0).render(camera, ["depth"])["depth"]


def test_equal_seeds_give_equal_bits_and_a_save_renders_the_same(scene: Path, tmp_path: Path):
    first, again, other = (fitted("2dgs", scene, seed) for seed in (0, 0, 1))
    camera = open_capture(scene / "capture", check=False).test[0].camera
    layers = sorted(first.provides)
    pictures = [found.render(camera, layers) for found in (first, again, other)]
    assert all(np.array_equal(pictures[0][name], pictures[1][name]) for name in layers)
    assert not np.array_equal(pictures[0]["radiance"], pictures[2]["radiance"])
    first.save(tmp_path / "saved")
    back = methods.load_method("2dgs").load(tmp_path / "saved")
    assert all(np.array_equal(back.render(camera, layers)[name], pictures[0][name]) for name in layers)
    assert (tmp_path / "saved" / "surfels.ply").is_file()
    with pytest.raises(MethodError, match="expected a decomposition by '2dgs-oracle'"):
        methods.load_method("2dgs-oracle").load(tmp_path / "saved")


def test_a_fit_goes_on_from_its_checkpoint(scene: Path, tmp_path: Path):
    class KilledError(Exception):
        pass

    def kill(done: float, doing: str) -> None:
        if done > 0.7:
            raise KilledError

    path = str(tmp_path / "fit.safetensors")
    method = methods.load_method("2dgs")
    settings = methods.settings_of(method, QUICK | {"checkpoint": path})
    with pytest.raises(KilledError):
        method.fit(with_points(scene), methods.Priors(), settings, 0, kill)
    whole, resumed = fitted("2dgs", scene), fitted("2dgs", scene, checkpoint=path)
    for name, values in whole.parameters.all.items():
        assert torch.equal(values, resumed.parameters.all[name]), name
    with pytest.raises(MethodError, match="got one of others"):
        fitted("2dgs", scene, seed=1, checkpoint=path)


def test_nothing_is_behind_the_last_surfel(scene: Path):
    """A pixel without surfels has the sky, no depth, and a normal to the camera."""
    found = fitted("2dgs", scene, iterations=2)
    parameters = found.parameters.take(torch.arange(0))
    empty = replace(found, parameters=parameters)
    camera = Camera.from_fov(8, 6, 50, look_at(np.array([0, -3.0, 1]), np.zeros(3)))
    layers = empty.render(camera, ["depth", "normal", "radiance"])
    assert np.isposinf(layers["depth"]).all()
    np.testing.assert_allclose((layers["normal"] * camera.rays()).sum(-1), -1, atol=1e-6)
    assert np.isfinite(layers["radiance"]).all()


def test_what_cannot_be_fitted_says_why(scene: Path):
    method = methods.load_method("2dgs")
    bare = open_capture(scene / "capture")
    with pytest.raises(MethodError, match="sparse points in the capture of tiny-0000, got 0"):
        method.fit(bare, methods.Priors(), methods.settings_of(method, {}), 0, silent)
    capture = with_points(scene)
    one = replace(capture, views=tuple(replace(v, camera=capture.views[0].camera) for v in capture.views))
    with pytest.raises(MethodError, match="different places in tiny-0000, got all from one"):
        method.fit(one, methods.Priors(), methods.settings_of(method, {}), 0, silent)
    oracle_method = methods.load_method("2dgs-oracle")
    with pytest.raises(MethodError, match="prior for layer 'depth'"):
        oracle_method.fit(capture, methods.Priors(), methods.settings_of(oracle_method, {}), 0, silent)


def test_surfaces_that_nobody_sees_are_no_start(scene: Path):
    method, priors = methods.load_method("2dgs-oracle"), oracle(scene)
    empty = {
        name: {**layers, "depth": np.full_like(layers["depth"], np.inf)}
        for name, layers in priors.layers.items()
    }
    with pytest.raises(MethodError, match="views that see surfaces, got 0 pixels"):
        method.fit(
            with_points(scene), replace(priors, layers=empty), methods.settings_of(method, {}), 0, silent
        )


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"iterations": 0}, "1 or more iterations"),
        ({"surfels": 1}, "2 or more surfels"),
        ({"fill": 1.5}, r"share of surfels in \[0, 1\] to begin by stereo"),
        ({"degree": 4}, "a degree of 0 to 3, got 4"),
        ({"ssim_share": 1.5}, r"share of SSIM in \[0, 1\]"),
        ({"normal_weight": -1.0}, "finite weights, and starts, of 0 or more"),
        ({"cover_weight": float("inf")}, "finite weights, and starts, of 0 or more"),
    ],
)
def test_bad_settings(settings: dict[str, object], message: str):
    with pytest.raises(GraycardError, match=message):
        methods.settings_of(methods.load_method("2dgs"), settings)


def test_a_change_of_the_engine_is_a_change_of_the_method():
    """The fit depends on the engine, too, which is no module of the method's own."""
    roots = (methods.BUILT_IN["2dgs"], "graycard:open_capture", "graycard.methods:write_predictions")
    assert methods.fingerprint("2dgs") == f"graycard {graycard.__version__} {code_hash(roots)}"
    reached = reached_code([methods.BUILT_IN["2dgs"]])
    engine = {"_surfels", "_rasterize", "raster._cpu", "raster._backward", "ops._losses", "fit._densify"}
    assert {f"graycard.methods.splat.{name}" for name in engine} <= reached.keys()
