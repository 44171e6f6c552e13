# SPDX-License-Identifier: Apache-2.0
"""The appearance loss of holes: its value, its gradients, and fits that ask for it."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import torch

from glossy_captures import QUICK, UNTOLD, told
from glossy_sheets import EXTENT, GlossyWorld, glossy_world, shots_of_world, with_settings
from graycard import WeightsError, methods, open_capture
from graycard.io import silent
from graycard.methods.goris import GorisMethod, GorisSettings
from graycard.methods.goris._appearance import appearance_loss, box_around
from graycard.methods.goris._remove import RemovalObjective, RemovalTarget
from graycard.methods.priors import PriorSpec
from layer_references import VGG, layer_errors, random_weights

WEIGHTS = "graycard.methods.goris._appearance.published_lpips"


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


@pytest.fixture
def random_vgg(monkeypatch: pytest.MonkeyPatch) -> None:
    """VGG-16 with a few channels, at random, stands for the fetched one."""
    weights = {name: torch.from_numpy(values) for name, values in random_weights(VGG).items()}
    monkeypatch.setattr(WEIGHTS, lambda net: weights)


def pictures(height: int, width: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Two pictures, and a mask of a part of them."""
    rng = np.random.default_rng(8)
    drawn, painted = (torch.from_numpy(rng.uniform(0, 1, (height, width, 3))).float() for _ in range(2))
    mask = torch.zeros(height, width)
    mask[1:-2, 2:-1] = 1
    return drawn, painted, mask


def padded(picture: torch.Tensor) -> np.ndarray:
    """Black around a picture up to 32 x 32 pixels, half of it on each side."""
    missing = [max(32 - side, 0) for side in picture.shape[:2]]
    around = [(short // 2, short - short // 2) for short in missing]
    return np.pad(picture.numpy().astype(np.float64), (*around, (0, 0)))


@pytest.mark.usefixtures("random_vgg")
@pytest.mark.parametrize("size", [(36, 44), (7, 40), (9, 6)])
def test_it_is_a_fifth_of_lpips_of_pictures_that_are_black_elsewhere(size: tuple[int, int]) -> None:
    """Equation 8 of the supplement, with LPIPS written out in numpy."""
    drawn, painted, mask = pictures(*size)
    errors = layer_errors(padded(drawn * mask[..., None]), padded(painted * mask[..., None]), VGG)
    expected = 0.2 * sum(error.mean() for error in errors)
    assert float(appearance_loss(drawn, painted, mask)) == pytest.approx(expected, rel=1e-4)


@pytest.mark.usefixtures("random_vgg")
def test_equal_holes_cost_nothing_and_the_rest_may_differ() -> None:
    drawn, painted, mask = pictures(36, 44)
    inside = mask[..., None] > 0
    assert float(appearance_loss(torch.where(inside, painted, drawn), painted, mask)) == 0
    assert float(appearance_loss(drawn, painted, mask)) > 0
    assert float(appearance_loss(drawn, painted, 0 * mask)) == 0


def test_its_gradients_are_those_of_differences(monkeypatch: pytest.MonkeyPatch) -> None:
    weights = {name: torch.from_numpy(values).double() for name, values in random_weights(VGG).items()}
    monkeypatch.setattr(WEIGHTS, lambda net: weights)
    drawn, painted, mask = (x.double() for x in pictures(6, 5))
    drawn.requires_grad_()
    assert torch.autograd.gradcheck(lambda x: appearance_loss(x, painted, mask), drawn, eps=1e-7, atol=1e-5)


@pytest.mark.usefixtures("random_vgg")
def test_gradients_are_finite_in_black_and_where_pictures_agree() -> None:
    drawn, painted, mask = pictures(36, 44)
    for image in (torch.zeros_like(drawn), painted.clone(), drawn):
        image.requires_grad_()
        appearance_loss(image, painted, mask).backward()
        assert image.grad is not None
        assert torch.isfinite(image.grad).all()
        assert (image.grad[mask == 0] == 0).all()


def test_the_box_is_the_least_that_holds_the_hole() -> None:
    hole = torch.zeros(9, 12)
    assert box_around(hole) == (slice(0, 0), slice(0, 0))
    hole[2, 3] = hole[5, 10] = 1
    assert box_around(hole) == (slice(2, 6), slice(3, 11))


def target(rough: float) -> RemovalTarget:
    """A hole of 8 x 20 pixels, all rough or all glossy."""
    hole = torch.zeros(36, 44)
    hole[20:28, 10:30] = 1
    flat, three = torch.full((36, 44), 0.3), torch.full((36, 44, 3), 0.3)
    layers = {"diffuse": three, "f0": three, "roughness": flat, "glossy": flat, "normal": three}
    return RemovalTarget(1 - hole, rough * hole, (1 - rough) * hole, three, layers)


def loss_of(world: GlossyWorld, aim: RemovalTarget, **changes: object) -> float:
    shots = shots_of_world(world)[:1]
    objective = RemovalObjective(shots, [aim], with_settings(**changes), EXTENT, 0)
    return float(objective(world.parameters.all, 0).loss.detach())


@pytest.mark.usefixtures("random_vgg")
def test_holes_are_compared_as_settings_say(world: GlossyWorld) -> None:
    """Both colours and traced light are compared where the hole is rough; where it is glossy, materials are.

    Materials are averaged over the box of the hole, not over the picture.
    """
    rough, glossy = target(1.0), target(0.0)
    plain, perceptual = (loss_of(world, rough, hole_loss=kind) for kind in ("photometric", "lpips"))
    assert abs(plain - perceptual) > 1e-3
    without = loss_of(world, glossy, hole_weight=0.0)
    whole, boxed = (loss_of(world, glossy, hole_loss=kind) - without for kind in ("photometric", "lpips"))
    assert boxed == pytest.approx(whole * 36 * 44 / 160, rel=1e-3)


def test_a_fit_without_weights_says_how_to_get_them_before_it_begins(scene: Path) -> None:
    started: list[str] = []
    capture = open_capture(scene / "capture", check=False)
    asked = with_settings(hole_loss="lpips")
    with pytest.raises(
        WeightsError, match=r"Run `graycard weights lpips`, or fit with hole_loss \"photometric\""
    ):
        GorisMethod().fit(capture, methods.Priors(), asked, 0, lambda share, doing: started.append(doing))
    assert not started
    assert GorisSettings().hole_loss == "photometric", "no fit needs weights that did not ask for them"


@pytest.mark.usefixtures("random_vgg")
def test_a_fit_by_it_repeats_and_differs_from_a_photometric_one(scene: Path) -> None:
    capture = open_capture(scene / "capture", check=False)
    priors = told(scene, PriorSpec("oracle", 1, overrides=UNTOLD))

    def without_object(kind: Literal["photometric", "lpips"]) -> np.ndarray:
        found = GorisMethod().fit(capture, priors, replace(QUICK, hole_loss=kind), 0, silent)
        return found.remove(3).render(capture.test[0].camera, ["radiance"])["radiance"]

    first = without_object("lpips")
    np.testing.assert_array_equal(first, without_object("lpips"))
    assert not np.array_equal(first, without_object("photometric"))
