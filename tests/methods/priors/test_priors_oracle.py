# SPDX-License-Identifier: Apache-2.0
"""The truth, made wrong: exact at severity 0, worse with each severity, and as wrong as it says."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats
from scipy.ndimage import binary_dilation, gaussian_filter

from graycard import Camera, MethodError, View, angles, look_at, methods
from graycard.methods.priors import Override, PriorSpec, make_priors
from graycard.methods.priors._colour import ColorErrors, corrupt_base_color
from graycard.methods.priors._depth import DepthErrors, corrupt_depth
from graycard.methods.priors._draws import blurred, draws_of, log_light, relief, smooth_field
from graycard.methods.priors._inpainting import InpaintingErrors, corrupt_filling
from graycard.methods.priors._mask import LEVELS as MASK_LEVELS
from graycard.methods.priors._mask import MaskErrors, corrupt_mask
from graycard.methods.priors._material import (
    MetallicErrors,
    RoughnessErrors,
    corrupt_metallic,
    corrupt_roughness,
)
from graycard.methods.priors._normal import NormalErrors, corrupt_normal
from graycard.methods.priors._slopes import normals_of

KINDS = ("depth", "normal", "base_color", "roughness", "metallic", "mask", "inpainting")
SIZE = 64
PINNED = (1.2947027968676046, -1.6025725495746892)
EVEN = np.zeros((SIZE, SIZE, 3))
ROOM = np.add.outer(np.linspace(4, 2, SIZE), np.linspace(0, 1, SIZE))


def truths(scene) -> dict[str, Callable[[View], np.ndarray]]:
    """Return answers of a perfect network for a view."""
    radiance = "counterfactual.radiance"
    known: dict[str, Callable[[View], np.ndarray]] = {
        kind: lambda v, kind=kind: scene.truth[v.name][kind] for kind in KINDS[:5]
    }
    known["mask"] = lambda v: scene.truth[v.name]["object_id"] == scene.capture.target

    def filled(view: View) -> np.ndarray:
        layers = scene.truth[view.name]
        hole = (layers["object_id"] == scene.capture.target)[..., None]
        return np.where(hole, layers[radiance], layers["radiance"]) * scene.capture.exposure

    return known | {"inpainting": filled}


@pytest.mark.parametrize("kind", KINDS)
def test_at_severity_0_it_is_the_truth(kind: str, scene, questions):
    told = scene.priors(PriorSpec("oracle", 0, seed=3))
    for view in scene.capture.views:
        answer, true = questions[kind](told, view), truths(scene)[kind](view)
        assert answer.dtype == (bool if kind == "mask" else np.float64)
        np.testing.assert_allclose(answer, true, rtol=1e-6, atol=1e-6)


def wrongness(kind: str, answer: np.ndarray, true: np.ndarray) -> float:
    if kind == "depth":
        seen = np.isfinite(true)
        assert np.array_equal(np.isfinite(answer), seen)
        return float(np.abs(np.log(answer[seen] / true[seen])).mean())
    if kind == "normal":
        seen = np.linalg.norm(true, axis=-1) > 0
        return float(angles(answer, true)[seen].mean())
    if kind == "mask":
        return 1 - float((answer & true).sum() / max((answer | true).sum(), 1))
    return float(np.abs(answer.astype(float) - true).mean())


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "mask"])
def test_errors_grow_with_severity(kind: str, scene, questions):
    """The mean over views and seeds; draws are those of severity 1, only larger."""
    growth = []
    for severity in range(6):
        told = [scene.priors(PriorSpec("oracle", severity, seed)) for seed in range(1000, 1012)]
        cases = [(questions[kind](p, v), truths(scene)[kind](v)) for p in told for v in scene.capture.views]
        growth.append(np.mean([wrongness(kind, *case) for case in cases]))
    assert growth[0] < 1e-5
    assert (np.diff(growth) > 0).all(), growth


def test_errors_of_masks_grow_with_severity():
    """On a picture so wide that the least of them is a pixel; the tiny scene has a tenth of that."""
    x, y = np.mgrid[:256, :256]
    disc = (x - 120) ** 2 + (y - 130) ** 2 < 60**2
    growth = []
    for errors in MASK_LEVELS:
        told = [corrupt_mask(disc, "target", errors, seed, "train_000") for seed in range(1000, 1024)]
        growth.append(np.mean([wrongness("mask", one, disc) for one in told]))
    assert growth[0] == 0
    assert (np.diff(growth) > 0).all(), growth


@pytest.mark.parametrize("kind", KINDS)
def test_answers_depend_on_seed_and_view_and_not_on_the_order(kind: str, scene, questions):
    views, worst = scene.capture.views, PriorSpec("oracle", 5, seed=1000)
    first, second = scene.priors(worst), scene.priors(worst)
    forth = {v.name: questions[kind](first, v) for v in views}
    back = {v.name: questions[kind](second, v) for v in reversed(views)}
    assert all(np.array_equal(forth[name], back[name]) for name in forth)
    others = [scene.priors(PriorSpec("oracle", 5, seed)) for seed in range(1001, 1009)]
    assert any(not np.array_equal(questions[kind](p, views[0]), forth[views[0].name]) for p in others)


def test_light_in_the_image_makes_depth_and_normals_worse(scene):
    """A method that hands in the albedo that it found gets better answers than with the photograph."""
    gaps = {}
    for kappa in (0.0, 0.05, 0.15, 0.3):
        changed = {k: Override(errors={"kappa": kappa}) for k in ("depth", "normal")}
        told = scene.priors(PriorSpec("oracle", 0, overrides=changed))
        for kind in ("depth", "normal"):
            lit, even = (
                wrongness(kind, getattr(told, kind)(image, scene.view), scene.known[kind])
                for image in (scene.photograph, scene.known["base_color"])
            )
            assert even == pytest.approx(0, abs=1e-5)  # degrees, of truth in float32
            gaps.setdefault(kind, []).append(lit)
    for kind, lit in gaps.items():
        assert lit[0] == pytest.approx(0, abs=1e-5)
        assert (np.diff(lit) > 0).all(), kind


def test_light_leaks_into_base_colour_by_a_power():
    """With all of it left in, the base colour is the picture up to its scale; with half of it, its root."""
    random = np.random.default_rng(0)
    paint, light = random.uniform(0.2, 0.4, (12, 12, 3)), random.uniform(0.7, 1.3, (12, 12, 3))
    even = corrupt_base_color(paint, 5 * paint, ColorErrors(leak=1.0), 0, "v")
    np.testing.assert_allclose(even, paint)
    for leak in (0.5, 1.0):
        baked = corrupt_base_color(paint, paint * light, ColorErrors(leak=leak), 0, "v") / paint
        assert np.ptp(np.log(baked) - leak * np.log(light)) < 1e-9


def test_strength_of_light_does_not_matter_and_dark_is_deep():
    spot = np.exp(-(np.add.outer(np.linspace(-3, 3, SIZE) ** 2, np.linspace(-3, 3, SIZE) ** 2)))
    image = np.full((SIZE, SIZE, 3), 0.3) * (0.05 + spot[..., None])
    paint = np.full((SIZE, SIZE, 3), 0.3)
    light = log_light(image, paint)
    np.testing.assert_allclose(log_light(7 * image, paint), light, atol=1e-12)
    depth = corrupt_depth(np.full((SIZE, SIZE), 2.0), light, DepthErrors(kappa=0.3), 0, "v")
    assert depth[SIZE // 2, SIZE // 2] < 2 < depth[SIZE // 2, SIZE // 6]


def test_light_of_a_closed_form():
    """Light is the ratio of picture and paint, whatever the paint; 0 without a surface."""
    random = np.random.default_rng(0)
    paint, light = random.uniform(0.1, 0.9, (8, 9, 3)), random.uniform(0.5, 2, (8, 9, 3))
    paint[0] = 0
    seen = np.log(light[1:]) - np.log(light[1:]).mean()
    np.testing.assert_allclose(log_light(paint * light, paint)[1:], seen, atol=1e-12)
    assert not log_light(paint * light, paint)[0].any()
    assert not log_light(np.zeros((4, 4, 3)), np.zeros((4, 4, 3))).any()


def test_random_fields_have_mean_0_variance_1_and_their_length():
    field = smooth_field(draws_of(1000, "test", "v"), (SIZE, SIZE), 3, length=0.05)
    np.testing.assert_allclose(field.mean(axis=(0, 1)), 0, atol=1e-12)
    np.testing.assert_allclose(field.std(axis=(0, 1)), 1, atol=1e-12)
    across = np.corrcoef(field.reshape(-1, 3).T)
    assert np.abs(across - np.eye(3)).max() < 0.4
    many = [smooth_field(draws_of(s, "t", "v"), (SIZE, SIZE), length=0.05)[..., 0] for s in range(1000, 1040)]
    lag = round(2 * 0.05 * SIZE)  # blurred white noise: correlation exp(-lag² / 4 s²)
    correlation = np.mean([f * np.roll(f, lag, axis=0) for f in many])
    assert correlation == pytest.approx(np.exp(-(lag**2) / (4 * (0.05 * SIZE) ** 2)), abs=0.06)


def test_draws_are_the_same_in_another_process():
    found = draws_of(1000, "depth", "train_000").standard_normal(2)
    np.testing.assert_allclose(found, PINNED, rtol=1e-12)


def test_blur_keeps_what_is_even_and_what_is_unknown():
    image, known = np.full((SIZE, SIZE), 3.0), np.zeros((SIZE, SIZE), bool)
    known[:, :40] = True
    image[:, 40:] = 99
    assert np.allclose(blurred(image, 0.05, known), image)
    random = np.random.default_rng(0).normal(size=(SIZE, SIZE, 2))
    everywhere = np.ones((SIZE, SIZE), bool)
    reference = np.stack([gaussian_filter(c, 0.05 * SIZE, mode="nearest") for c in random.transpose(2, 0, 1)])
    np.testing.assert_allclose(blurred(random, 0.05, everywhere), reference.transpose(1, 2, 0), atol=1e-12)
    assert np.array_equal(blurred(image, 0.05, ~everywhere), image)


def test_scale_differs_from_view_to_view_by_as_much_as_it_says():
    scales = [
        np.log(corrupt_depth(ROOM, EVEN, DepthErrors(scale=0.2), 1000, f"v{n}") / ROOM).mean()
        for n in range(200)
    ]
    assert stats.kstest(scales, stats.norm(0, 0.2).cdf).pvalue > 0.01
    factors = [
        corrupt_base_color(np.full((8, 8, 3), 0.2), np.ones((8, 8, 3)), ColorErrors(gain=0.1), 1000, f"v{n}")
        for n in range(100)
    ]
    logs = np.log(np.array([f[0, 0] for f in factors]) / 0.2).ravel()
    assert stats.kstest(logs, stats.norm(0, 0.1).cdf).pvalue > 0.01


def test_each_error_of_depth_is_what_it_says():
    curved = corrupt_depth(ROOM, EVEN, DepthErrors(curvature=0.2), 1000, "v")
    slope = np.polyfit(np.log(ROOM).ravel(), np.log(curved).ravel(), 1)[0]
    middle = np.median(ROOM)
    np.testing.assert_allclose(np.log(curved / middle), slope * np.log(ROOM / middle), atol=1e-9)
    assert slope != 1
    moved = corrupt_depth(ROOM, EVEN, DepthErrors(offset=0.1), 1000, "v") - ROOM
    assert np.ptp(moved) < 1e-9
    assert moved.mean() != 0
    waved = np.log(corrupt_depth(ROOM, EVEN, DepthErrors(waves=0.1), 1000, "v") / ROOM)
    assert waved.std() == pytest.approx(0.1)
    step = np.where(np.arange(SIZE) < 32, 1.0, 4.0) * np.ones((SIZE, 1))
    soft = corrupt_depth(step, EVEN, DepthErrors(blur=0.03), 1000, "v")
    between = (soft > 1.2) & (soft < 3.4)
    assert not ((step > 1.2) & (step < 3.4)).any()
    assert between.any(axis=0).sum() >= 2  # flying pixels at the edge


def test_an_offset_brings_nothing_behind_the_camera():
    depth = np.full((SIZE, SIZE), 10.0)
    depth[:8] = 0.1
    for number in range(50):
        assert corrupt_depth(depth, EVEN, DepthErrors(offset=3.0), 1000, f"v{number}").min() > 0


def test_sky_stays_sky():
    nothing = np.full((SIZE, SIZE), np.inf)
    assert np.isinf(corrupt_depth(nothing, EVEN, DepthErrors(0.4, 0.2, 0.1, 0.1, 0.3, 0.02), 0, "v")).all()
    half = np.where(np.arange(SIZE)[:, None] < 20, np.inf, ROOM)
    wrong = corrupt_depth(half, EVEN, DepthErrors(0.4, 0.2, 0.1, 0.1, 0.3, 0.02), 0, "v")
    assert np.array_equal(np.isinf(wrong), np.isinf(half))


def test_normals_see_the_relief_that_depth_sees():
    """Independent reference: normals of the surface that the embossed depth draws."""
    camera = Camera.from_fov(SIZE, SIZE, 50, look_at(np.array([1.0, -2, 1.5]), np.zeros(3)))
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE * 2 * np.pi
    light = np.repeat(0.5 * (np.sin(2 * x) * np.cos(y))[..., None], 3, axis=-1)
    flat = np.tile(-camera.forward, (SIZE, SIZE, 1))
    bump = relief(light, 0.03, 0.2)
    embossed = 2.0 * np.exp(-0.02 * bump)
    expected = normals_of(embossed, camera)
    found = corrupt_normal(flat, light, camera, NormalErrors(kappa=0.02), 0, "v")
    inner = (slice(4, -4), slice(4, -4))
    angle, tilt = angles(found, expected)[inner], angles(found, flat)[inner]
    assert tilt.mean() > 3  # there is something to compare
    assert angle.mean() < 0.25 * tilt.mean()


def test_normals_are_turned_as_much_as_they_say_and_flipped_on_request(scene):
    normal, camera = scene.known["normal"].astype(float), scene.view.camera
    seen = np.linalg.norm(normal, axis=-1) > 0
    even = np.zeros_like(normal)
    turns = []
    for number in range(300):
        turned = corrupt_normal(normal, even, camera, NormalErrors(turn=3.0), 1000, f"v{number}")
        matrix = np.linalg.lstsq(normal[seen], turned[seen], rcond=None)[0]
        turns.append(np.degrees(np.arccos(np.clip((np.trace(matrix) - 1) / 2, -1, 1))))
        assert not turned[~seen].any()
    # rotation vectors of variance turn²/3 in each coordinate: the mean square of the angle is turn²
    assert np.mean(np.square(turns)) == pytest.approx(9, rel=0.2)
    flipped = corrupt_normal(normal, even, camera, NormalErrors(flip=1), 0, "v")
    to_camera = camera.world_to_camera[:3, :3]
    np.testing.assert_allclose(flipped @ to_camera.T, (normal @ to_camera.T) * [1, -1, -1], atol=1e-6)


def test_masks_spread_and_tremble_by_pixels_and_miss_views():
    y, x = np.mgrid[0:SIZE, 0:SIZE] + 0.5
    disc = np.hypot(y - 32, x - 32) < 16
    radii = [
        np.sqrt(corrupt_mask(disc, "target", MaskErrors(spread=0.03), 1000, f"v{n}").sum() / np.pi)
        for n in range(200)
    ]
    assert np.std(radii) == pytest.approx(0.03 * SIZE, rel=0.2)
    assert np.mean(radii) == pytest.approx(16, abs=0.5)
    found = [corrupt_mask(disc, "target", MaskErrors(misses=0.2), 1000, f"v{n}").any() for n in range(300)]
    assert stats.binomtest(300 - sum(found), 300, 0.2).pvalue > 0.01
    trembling = corrupt_mask(disc, "target", MaskErrors(tremble=0.03), 1000, "v")
    assert 0 < (trembling != disc).sum() < 0.5 * disc.sum()
    full, empty = np.ones((8, 8), bool), np.zeros((8, 8), bool)
    assert corrupt_mask(full, "glossy", MaskErrors(0.1, 0.1), 0, "v").all()
    assert not corrupt_mask(empty, "glossy", MaskErrors(0.1, 0.1), 0, "v").any()


def test_glossy_is_what_reflects_and_a_target_is_the_one_that_is_named(scene):
    told = scene.priors(PriorSpec("oracle"))
    ids = scene.known["object_id"]
    glossy = told.mask(scene.photograph, scene.view, "glossy")
    assert np.array_equal(glossy, (ids == 1) | (ids == 2))  # roughness 0.2 and 0.45; the sky is none
    assert np.array_equal(told.mask(scene.photograph, scene.view, "target"), ids == 3)


def test_objects_are_taken_for_metal_as_a_whole_and_as_often_as_it_says():
    ids = np.repeat(np.arange(6), 10).reshape(6, 10)
    metallic = (ids == 2).astype(float)
    flips = 0
    for number in range(100):
        wrong = corrupt_metallic(metallic, ids, MetallicErrors(0.3), 1000, f"v{number}")
        assert (np.ptp(wrong, axis=1) == 0).all()
        assert not wrong[0].any()
        flips += int((wrong[1:, 0] != metallic[1:, 0]).sum())
    assert stats.binomtest(flips, 500, 0.3).pvalue > 0.01


def test_roughness_is_off_by_as_much_as_it_says():
    matte = np.full((SIZE, SIZE), 0.5)
    means = [
        corrupt_roughness(matte, RoughnessErrors(bias=0.05), 1000, f"v{n}").mean() - 0.5 for n in range(200)
    ]
    assert stats.kstest(means, stats.norm(0, 0.05).cdf).pvalue > 0.01
    assert corrupt_roughness(matte, RoughnessErrors(waves=0.05), 1000, "v").std() == pytest.approx(0.05)


def test_fillings_are_displaced_by_as_much_as_they_say():
    ramp = np.repeat(np.arange(SIZE, dtype=float)[None, :, None], 3, axis=-1) * np.ones((SIZE, 1, 1))
    moved = corrupt_filling(ramp, InpaintingErrors(warp=0.02), 1000, "v") - ramp
    inner = moved[8:-8, 8:-8, 0]
    assert inner.std() == pytest.approx(0.02 * SIZE, rel=0.35)
    tinted = corrupt_filling(ramp, InpaintingErrors(gain=0.1), 1000, "v")[:, 1:] / ramp[:, 1:]
    assert np.ptp(tinted, axis=(0, 1)).max() < 1e-12
    assert len(np.unique(tinted[0, 0])) == 3


LAYERS = ("diffuse", "f0", "roughness", "glossy", "normal")


@pytest.fixture
def emptied(scene) -> dict[str, np.ndarray]:
    """Return truths of the first view without its target: a floor of which half is polished."""
    rng, shape = np.random.default_rng(1000), scene.known["object_id"].shape
    roughness = np.where(np.arange(shape[1])[None] < shape[1] / 2, 0.1, 0.8) * np.ones(shape)
    normal = np.array([0.0, 0.0, 1.0]) * np.ones((*shape, 3))
    found = {"diffuse": rng.uniform(0, 1, (*shape, 3)), "f0": 0.04 + 0.02 * rng.random((*shape, 3))}
    return found | {"roughness": roughness, "normal": normal}


def about_holes(scene, emptied: dict[str, np.ndarray], severity: int) -> methods.Priors:
    known = scene.known | {f"counterfactual.{name}": values for name, values in emptied.items()}
    asks = (methods.Ask("inpainting", ("radiance", "albedo", *LAYERS)),)
    return make_priors(PriorSpec("oracle", severity), asks, scene.capture, {scene.view.name: known})


def test_holes_in_materials_show_what_is_behind_the_target(scene, emptied: dict[str, np.ndarray]):
    hole = scene.known["object_id"] == scene.capture.target
    exact, wrong = (about_holes(scene, emptied, severity) for severity in (0, 4))
    true = emptied | {"diffuse": scene.capture.exposure * emptied["diffuse"]}
    true["glossy"] = (emptied["roughness"] < 0.5).astype(float)
    for name in LAYERS:
        image = np.where(hole if true[name].ndim == 2 else hole[..., None], 0.5, true[name])
        found, off = (told.inpainting(image, scene.view, hole, name) for told in (exact, wrong))
        np.testing.assert_allclose(found[hole], true[name][hole], rtol=1e-6, atol=1e-9)
        assert np.array_equal(found[~hole], image[~hole])
        if name in ("diffuse", "f0"):
            assert not np.allclose(off[hole], true[name][hole], atol=1e-3)
        if name == "normal":
            np.testing.assert_allclose(np.linalg.norm(off[hole], axis=-1), 1)


def test_materials_go_on_from_what_a_method_has_around_a_hole(scene, emptied: dict[str, np.ndarray]):
    """Its split of a surface into scattered and mirrored light need not be the true one."""
    glossy, hole = emptied["roughness"] < 0.5, np.zeros_like(emptied["roughness"], bool)
    hole[4:8, 3:7] = True
    assert glossy[hole].all()
    told = about_holes(scene, emptied, 0)
    shown = emptied["f0"] + 0.3
    shown[~glossy] = 7.0
    found = told.inpainting(np.where(hole[..., None], 9.0, shown), scene.view, hole, "f0")
    np.testing.assert_allclose(found[hole], shown[hole], atol=1e-5)
    darker = told.inpainting(np.zeros_like(shown), scene.view, hole, "f0")
    assert darker[hole].min() >= 0
    assert darker[hole].max() < 0.03
    ragged = hole | (np.arange(hole.shape[1])[None] > 2)
    for name, off in {"f0": 0.3, "roughness": 0.2, "diffuse": 0.1}.items():
        factor = scene.capture.exposure if name == "diffuse" else 1.0
        true, rows = factor * emptied[name], glossy if emptied[name].ndim == 2 else glossy[..., None]
        shown = np.where(rows, true + off, 7.0)
        # diffuse light is noise here, of which displacements leave nothing
        for severity, most in {
            0: 1e-5,
            2: 1.5 if name == "diffuse" else 0.15,
            4: 3.0 if name == "diffuse" else 0.3,
        }.items():
            answer = about_holes(scene, emptied, severity).inpainting(shown, scene.view, hole, name)
            assert np.abs(answer / shown - 1)[hole].mean() < most, (name, severity)
        answer = told.inpainting(shown, scene.view, ragged, name)
        np.testing.assert_allclose(answer[ragged & ~glossy], true[ragged & ~glossy], atol=1e-6)
    bright = about_holes(scene, emptied, 5).inpainting(emptied["f0"] + 0.9, scene.view, hole, "f0")
    assert bright[hole].max() <= 1
    everywhere = about_holes(scene, emptied | {"roughness": np.full_like(emptied["roughness"], 0.8)}, 0)
    assert np.array_equal(everywhere.inpainting(shown, scene.view, hole, "f0")[hole], emptied["f0"][hole])


def test_a_shadow_next_to_a_hole_does_not_go_on_into_it(scene, emptied: dict[str, np.ndarray]):
    """A method that takes it for dark paint is told what is there without it, as for radiance."""
    hole = np.zeros_like(emptied["roughness"], bool)
    hole[4:8, 3:7] = True
    rim = binary_dilation(hole, iterations=2) & ~hole
    assert (emptied["roughness"] < 0.5)[hole | rim].all()
    true = scene.capture.exposure * emptied["diffuse"]
    shown = np.where(rim[..., None], 0.2, 1.0) * true + 0.1
    found = about_holes(scene, emptied, 0).inpainting(shown, scene.view, hole, "diffuse")
    np.testing.assert_allclose(found[hole], true[hole] + 0.1, atol=1e-6)


def test_all_layers_of_a_view_are_displaced_alike():
    """A painter puts an edge in one place; colours alone are off by a factor."""
    errors = InpaintingErrors(gain=0.1, warp=0.03)
    edge = np.where(np.arange(SIZE)[None] < SIZE / 2, 0.2, 0.8) * np.ones((SIZE, SIZE))
    share = corrupt_filling(edge, errors, 1000, "v", is_colour=False)
    colour = corrupt_filling(np.repeat(edge[..., None], 3, axis=-1), errors, 1000, "v")
    assert not np.allclose(share, edge)
    factors = colour / share[..., None]
    assert np.ptp(factors, axis=(0, 1)).max() < 1e-12
    assert np.ptp(factors[0, 0]) > 1e-3


@pytest.mark.parametrize("severity", [0, 5])
def test_layers_without_a_truth_are_filled_as_the_classical_source_fills_them(severity: int, scene):
    """A method has made these up itself."""
    hole = scene.known["object_id"] == scene.capture.target
    asks = (methods.Ask("inpainting", ("albedo",)),)
    oracle = make_priors(PriorSpec("oracle", severity), asks, scene.capture, {})
    classical = scene.priors(PriorSpec("classical"), asks)
    image = scene.known["base_color"] ** 2
    found = oracle.inpainting(image, scene.view, hole, "albedo")
    assert np.array_equal(found, classical.inpainting(image, scene.view, hole, "albedo"))
    assert np.array_equal(found[~hole], image[~hole])


def test_holes_of_layers_that_were_not_declared_are_refused(scene, emptied: dict[str, np.ndarray]):
    asks = (methods.Ask("inpainting", ("radiance",)),)
    told = make_priors(PriorSpec("oracle"), asks, scene.capture, {scene.view.name: scene.known})
    hole = scene.known["object_id"] == scene.capture.target
    with pytest.raises(MethodError, match="Name it in the method's asks"):
        told.inpainting(emptied["f0"], scene.view, hole, "f0")
    told = about_holes(scene, emptied, 0)
    with pytest.raises(MethodError, match="expected roughness of shape"):
        told.inpainting(emptied["f0"], scene.view, hole, "roughness")


def test_one_kind_may_be_worse_than_the_others(scene):
    spec = PriorSpec("oracle", 0, overrides={"depth": Override(severity=4)})
    told: methods.Priors = scene.priors(spec)
    assert not np.allclose(told.depth(scene.photograph, scene.view), scene.known["depth"])
    np.testing.assert_allclose(told.normal(scene.photograph, scene.view), scene.known["normal"], atol=1e-6)
