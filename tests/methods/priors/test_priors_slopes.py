# SPDX-License-Identifier: Apache-2.0
"""Normals that are the slopes of the depth that the same oracle tells."""

from collections.abc import Mapping

import numpy as np
import pytest

from graycard import Camera, UnknownNameError, angles, methods
from graycard.io import from_builtins, to_builtins
from graycard.methods.priors import Override, PriorSpec, of_kind, truth_of

SLOPES = Override(algorithm="slopes-of-depth")
INNER = (slice(1, -1), slice(1, -1))


def sloped(severity: int, seed: int = 0, **overrides: Override) -> PriorSpec:
    return PriorSpec("oracle", severity, seed, overrides={"normal": SLOPES, **overrides})


def finite_differences(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """Normals by the textbook: points behind pixel centres, central differences, their cross product.

    Zero where a neighbour is missing.
    """
    y, x = np.mgrid[: camera.height, : camera.width] + 0.5
    local = np.linalg.inv(camera.K) @ np.stack([x, y, np.ones_like(x)]).reshape(3, -1)
    with np.errstate(invalid="ignore"):
        points = (local * depth.ravel()).T.reshape(*depth.shape, 3)
        across, down = points[1:-1, 2:] - points[1:-1, :-2], points[2:, 1:-1] - points[:-2, 1:-1]
        normals = np.zeros_like(points)
        normals[INNER] = np.cross(down, across) @ camera.camera_to_world[:3, :3].T
        lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
        return np.where(np.isfinite(lengths) & (lengths > 0), normals / lengths, 0.0)


@pytest.mark.parametrize("severity", [0, 3, 5])
def test_they_are_the_finite_differences_of_the_depth_that_is_told(severity: int, scene) -> None:
    told: methods.Priors = scene.priors(sloped(severity))
    depth = told.depth(scene.photograph, scene.view)
    found = told.normal(scene.photograph, scene.view)
    expected = finite_differences(depth, scene.view.camera)
    known = np.linalg.norm(expected, axis=-1) > 0
    assert known.mean() > 0.5
    np.testing.assert_allclose(found[known], expected[known], atol=1e-6)
    seen = np.isfinite(depth)
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), seen, atol=1e-6)  # the border too


def test_at_severity_0_they_are_the_true_normals_within_surfaces(scene) -> None:
    found = scene.priors(sloped(0)).normal(scene.photograph, scene.view)
    seen = np.linalg.norm(scene.known["normal"], axis=-1) > 0
    assert np.median(angles(found, scene.known["normal"])[seen]) < 2


def test_equal_specs_give_equal_bits_and_another_seed_others(scene) -> None:
    one, again, other = (scene.priors(sloped(3, seed)) for seed in (7, 7, 8))
    answers = [p.normal(scene.photograph, scene.view) for p in (one, again, other)]
    assert np.array_equal(answers[0], answers[1])
    assert not np.array_equal(answers[0], answers[2])


def test_light_misleads_them_by_the_kappa_of_depth(scene) -> None:
    """With a kappa of 0 a photograph tells what the albedo tells; with 0.3 it does not."""
    gaps = []
    for kappa in (0.0, 0.3):
        told = scene.priors(sloped(0, depth=Override(errors={"kappa": kappa})))
        lit, even = (told.normal(i, scene.view) for i in (scene.photograph, scene.known["base_color"]))
        gaps.append(np.abs(lit - even).max())
    assert gaps[0] < 1e-9
    assert gaps[1] > 0.05


def test_they_need_the_truth_of_depth_alone() -> None:
    asks = (methods.Ask("normal"),)
    assert truth_of(sloped(2), asks) == {"depth", "base_color"}
    assert truth_of(PriorSpec("oracle", 2), asks) == {"normal", "base_color"}


def test_a_spec_with_them_reads_and_writes_as_data() -> None:
    spec = sloped(3, depth=Override(errors={"kappa": 0.3}))
    assert from_builtins(PriorSpec, to_builtins(spec)) == spec
    assert of_kind(spec, "normal").errors == of_kind(spec, "depth").errors
    assert str(spec).endswith("kappa 0.3; normal: oracle, severity 3, slopes-of-depth")
    assert of_kind(PriorSpec("oracle", 3), "normal").algorithm == "surface"


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"depth": Override("classical")}, "depth of source oracle for normals that are its slopes, got cl"),
        ({"normal": Override(algorithm="slopes-of-depth", severity=2)}, "Give them to depth"),
        ({"normal": Override(algorithm="slopes-of-depth", errors={"waves": 0.1})}, "Give them to depth"),
        ({"normal": Override("classical", algorithm="slopes-of-depth")}, "of normal with source oracle only"),
        ({"normal": Override(algorithm="slopes")}, "did you mean 'slopes-of-depth'"),
    ],
)
def test_what_does_not_go_with_them_is_refused(overrides: Mapping[str, Override], words: str) -> None:
    with pytest.raises((ValueError, UnknownNameError), match=words):
        PriorSpec("oracle", 3, overrides={"normal": SLOPES} | dict(overrides))
