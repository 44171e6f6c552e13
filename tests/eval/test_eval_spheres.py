# SPDX-License-Identifier: Apache-2.0
"""Spheres under an environment against closed forms, and what an environment scores."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import cosine

import graycard.eval as ge
from graycard import EnvironmentLight, Light, PointLight, PredictionError, Predictions, luminance, open_truth
from graycard.dataset import manifest_of
from graycard.eval.lights._spheres import (
    ALPHA,
    exposure_for,
    render_spheres,
    scale_invariant_rmse,
    sphere_normals,
)
from graycard.eval.metrics._environment import compare_colours, compare_scale_invariant, compare_spheres
from graycard.io import read_rgb, write_manifest, write_rgb
from graycard.lights import write_lights
from graycard.predictions import clear_predictions, finish_predictions, write_environment
from graycard.records import Score

RNG = np.random.default_rng(8)
SKY = EnvironmentLight("sky", "sky.exr")


def environment(radiance: Callable[[np.ndarray], np.ndarray], height: int = 64) -> np.ndarray:
    """A gray environment of a function of unit directions ``(H, W, 3)``."""
    t = np.pi * (np.arange(height) + 0.5) / height
    p = np.pi * (np.arange(2 * height) + 0.5) / height
    t, p = np.meshgrid(t, p, indexing="ij")
    w = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    return np.repeat(radiance(w)[..., None], 3, axis=-1)


def test_under_even_light_a_sphere_is_even() -> None:
    spheres = render_spheres(np.full((16, 32, 3), (2.0, 1.0, 0.5)))
    assert spheres["mirror"] == pytest.approx(np.full_like(spheres["mirror"], 1) * (2, 1, 0.5))
    assert spheres["diffuse"] == pytest.approx(np.full_like(spheres["diffuse"], 1) * (2, 1, 0.5), rel=0.01)
    cosine, glossy = -sphere_normals()[:, 1], spheres["glossy"][:, 1]
    for facing, kept in ((1.0, 0.9158), (0.9, 0.9074), (0.7, 0.8853), (0.5, 0.8573)):
        pixel = np.abs(cosine - facing).argmin()
        assert glossy[pixel] == pytest.approx(kept, abs=0.005), "scipy.integrate.dblquad of D V cos"


def test_light_from_above_falls_on_top() -> None:
    spheres, normals = render_spheres(environment(lambda w: (w[..., 2] > 0) * 1.0)), sphere_normals()
    expected = (1 + normals[:, 2]) / 2
    assert spheres["diffuse"][:, 0] == pytest.approx(expected, abs=0.01), "a half-space of light"
    mirrored = 2 * (normals @ (0, -1, 0))[:, None] * normals - (0, -1, 0)
    sharp = np.abs(mirrored[:, 2]) > 0.1
    assert spheres["mirror"][sharp, 0] == pytest.approx((mirrored[sharp, 2] > 0) * 1.0)


@pytest.mark.parametrize("height", [8, 20, 32, 48, 200])
def test_the_size_of_an_image_does_not_matter(height: int) -> None:
    def smooth(w: np.ndarray) -> np.ndarray:
        return 1 + 0.5 * w[..., 0] + 0.3 * w[..., 2]

    spheres, normals = render_spheres(environment(smooth, height)), sphere_normals()
    expected = 1 + 2 / 3 * (0.5 * normals[:, 0] + 0.3 * normals[:, 2])
    assert spheres["diffuse"][:, 0] == pytest.approx(expected, abs=0.03 if height < 32 else 0.01)


def test_a_small_bright_light_is_seen_where_it_is() -> None:
    light = np.array([0.6, -0.64, 0.48])
    spheres, normals = (
        render_spheres(environment(lambda w: np.exp(400 * (w @ light - 1)), 128)),
        sphere_normals(),
    )
    half = light - (0.0, 1.0, 0.0)
    half /= np.linalg.norm(half)
    for name in ("mirror", "glossy"):
        brightest = normals[spheres[name][:, 0].argmax()]
        assert np.degrees(np.arccos(brightest @ half)) < 4, name
    assert normals[spheres["diffuse"][:, 0].argmax()] @ light > 0.99
    away = np.arccos(np.clip(normals @ half, -1, 1))
    ratio = spheres["glossy"][:, 0] / spheres["glossy"][:, 0].max()
    near = (away > np.arctan(ALPHA) * 0.9) & (away < np.arctan(ALPHA) * 1.1)
    assert 0.1 < ratio[near].mean() < 0.5, "D falls to a quarter at tan = alpha"


def test_the_card_is_exposed_as_a_photographer_would() -> None:
    spheres = render_spheres(RNG.uniform(0, 5, (8, 16, 3)))
    shown = exposure_for(spheres["diffuse"]) * spheres["diffuse"]
    assert luminance(shown).mean() == pytest.approx(0.18)
    assert exposure_for(np.zeros((4, 3))) == 1


def test_turned_and_tinted_surroundings_are_worse_and_dimmed_ones_are_not() -> None:
    sky = environment(lambda w: 0.2 + 4 * (w @ (0.6, -0.64, 0.48) > 0.95)) * (1, 0.9, 0.7)
    true = render_spheres(sky)
    values = [
        compare_spheres(render_spheres(other), true).value
        for other in (sky, 3 * sky, np.roll(sky, 3, axis=1), np.roll(sky, 40, axis=1), sky * (0.5, 1, 1))
    ]
    assert values[0] == math.inf
    assert values[1] is not None
    assert values[1] > 100
    assert 100 > (values[2] or 0) > (values[3] or 0) > 5
    assert (values[4] or 99) < 30
    found = compare_spheres(render_spheres(3 * sky), true)
    assert set(found.parts) == {"mirror", "glossy", "diffuse"}


def test_no_light_at_all() -> None:
    true = render_spheres(np.ones((4, 8, 3)))
    with pytest.raises(PredictionError, match="expected an environment that shines, got a black one"):
        compare_spheres(render_spheres(np.zeros((4, 8, 3))), true)


def two_skies() -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    true = np.random.default_rng(31).uniform(0.1, 3, (8, 16, 3))
    return render_spheres(np.roll(true, 1, axis=1) * (1.2, 1, 0.8)), render_spheres(true)


def rmse_of_spheres() -> tuple[np.ndarray, np.ndarray]:
    predicted, true = two_skies()
    k = exposure_for(true["diffuse"])
    each = []
    for name, t in true.items():
        rest = np.linalg.lstsq(predicted[name].reshape(-1, 1), k * t.ravel())[1]
        each.append(np.sqrt(rest.item() / len(t)))
    found = compare_scale_invariant(predicted, true)
    return np.array([*found.parts.values(), found.value]), np.array([*each, np.mean(each)])


def colours_of_spheres() -> tuple[np.ndarray, np.ndarray]:
    predicted, true = two_skies()
    pairs = [zip(predicted[name], true[name], strict=True) for name in true]
    each = [np.mean([np.degrees(np.arccos(1 - cosine(p, t))) for p, t in pair]) for pair in pairs]
    found = compare_colours(predicted, true)
    return np.array([*found.parts.values(), found.value]), np.array([*each, np.mean(each)])


COMPUTED = {"si-RMSE of spheres": rmse_of_spheres, "colour of spheres": colours_of_spheres}


def test_errors_of_spheres_ignore_a_gain_and_see_a_tint() -> None:
    _, true = two_skies()
    dimmed = {name: 0.3 * values for name, values in true.items()}
    tinted = {name: values * (1.5, 1, 1) for name, values in true.items()}
    for compare in (compare_scale_invariant, compare_colours):
        assert compare(true, true).value == 0
        assert compare(dimmed, true).value == pytest.approx(0, abs=1e-6)
        assert compare(tinted, true).value > 0.01
        with pytest.raises(PredictionError, match="expected an environment that shines, got a black one"):
            compare({name: 0 * values for name, values in true.items()}, true)


def test_a_black_pixel_of_a_sphere_is_no_colour() -> None:
    one = {name: np.ones((4, 3)) for name in ("mirror", "glossy", "diffuse")}
    half = {name: np.repeat([[1.0] * 3, [0.0] * 3], 2, axis=0) for name in one}
    assert compare_colours(half, one).value == pytest.approx(45)


def test_spheres_give_what_the_published_functions_gave() -> None:
    """Figures of StyleLight, evaluation/fast_rmse.py, 44eb430, on the pictures of test_eval_originals."""
    rng, errors, turns = np.random.default_rng(20261124), [], []
    for _ in range(3):
        true = rng.uniform(0.05, 0.95, (32, 32, 3)).astype(np.float32)
        off = np.clip(true * [1.3, 1, 0.7] + rng.normal(0, 0.05, true.shape), 0, None).astype(np.float32)
        p, t = (x[4:29, 5:30].reshape(-1, 3).astype(np.float64) for x in (off, true))
        errors.append(scale_invariant_rmse(p, t))
        turns.append(compare_colours({"diffuse": p}, {"diffuse": t}).value)
    assert np.mean(errors) == pytest.approx(0.2460682338, abs=1e-9)
    assert np.mean(turns) == pytest.approx(12.1757108655, abs=1e-6)


@pytest.fixture
def lit(make_scene: Callable[..., Path]) -> Path:
    scene = make_scene(track="multilight")
    write_rgb(scene / "truth" / "sky.exr", RNG.uniform(0.2, 2, (8, 16, 3)))
    write_lights(scene / "truth" / "lights.json", (SKY,))
    write_manifest(scene / "truth", manifest_of(open_truth(scene / "truth", check=False)))
    return scene


def scored(scene: Path, folder: Path, lights: tuple[Light, ...]) -> Score:
    finish_predictions(folder, Predictions("t", "multilight", "tiny-0000"), lights)
    return ge.score_predictions(folder, scene).score("environment.psnr")


def test_several_environments_shine_together(lit: Path, tmp_path: Path) -> None:
    image = read_rgb(lit / "truth" / "sky.exr")
    halves = tuple(
        write_environment(tmp_path / "p", EnvironmentLight(f"half-{i}", ""), image * share)
        for i, share in enumerate((0.25, 0.75))
    )
    assert halves[0].image == "environments/half-0.exr"
    assert (scored(lit, tmp_path / "p", halves).value or 0) > 100
    one = scored(lit, tmp_path / "p", halves[:1])
    assert (one.value or 0) > 100
    assert one.gauge is None
    clear_predictions(tmp_path / "p")
    assert not (tmp_path / "p" / "environments").exists()


def test_lights_without_an_environment(lit: Path, tmp_path: Path) -> None:
    found = scored(lit, tmp_path / "p", (PointLight("a", (0, 0, 1), (1, 1, 1)),))
    assert (found.status, found.reason) == ("not provided", "lights.json has no environment")


@pytest.mark.parametrize(
    ("image", "change", "words"),
    [
        ("none.exr", None, "expected an EXR file at .*none.exr, got none"),
        ("../sky.exr", None, "expected a path that stays in its folder.*got '../sky.exr'"),
        ("sky.exr", np.nan, "expected finite radiance of 0 or more in .*sky.exr"),
        ("sky.exr", -1.0, "expected finite radiance of 0 or more in .*sky.exr"),
        ("sky.exr", 0.0, "expected an environment that shines, got a black one"),
    ],
)
def test_images_that_cannot_be_used(
    lit: Path, tmp_path: Path, image: str, change: float | None, words: str
) -> None:
    if change is not None:
        write_rgb(tmp_path / "p" / image, np.full((4, 8, 3), change))
    found = scored(lit, tmp_path / "p", (replace(SKY, image=image),))
    assert found.status == "failed"
    assert re.search(words, found.reason), found.reason


def test_an_image_that_changed_after_its_hash_was_taken(lit: Path, tmp_path: Path) -> None:
    write_rgb(tmp_path / "p" / "sky.exr", np.ones((4, 8, 3)))
    assert scored(lit, tmp_path / "p", (SKY,)).status == "scored"
    write_rgb(tmp_path / "p" / "sky.exr", np.full((4, 8, 3), 2.0))
    found = ge.score_predictions(tmp_path / "p", lit).score("environment.psnr")
    assert found.status == "failed"
    assert "it changed after" in found.reason
