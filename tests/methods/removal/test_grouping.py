# SPDX-License-Identifier: Apache-2.0
"""``grouping``: surfels learn whose they are, and what was behind the object grows from its rim."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import Camera, Capture, MethodError, Progress, View, look_at, methods, open_capture, open_truth
from graycard.io import silent
from graycard.methods.priors import PriorSpec, make_priors
from graycard.methods.removal import GroupingMethod, GroupingSettings, KeepMethod, RemovalScene
from graycard.methods.removal._behind import Behind
from graycard.methods.removal._filled import Target
from graycard.methods.removal._grouping import identified, named_surfels, pixel_weights, with_means
from graycard.methods.removal._identity import (
    BIASES,
    IDENTITIES,
    OBJECT,
    WEIGHTS,
    IdentityObjective,
    disagreement_of,
    mask_loss,
    neighbours_of_some,
    object_probabilities,
    with_identities,
    without_identities,
)
from graycard.methods.removal._target import target_masks, target_surfels
from graycard.methods.splat import (
    CENTRES,
    GEOMETRY,
    ROTATIONS,
    Parameters,
    gather,
    parameters_of,
    rasterize_features,
    rotation_matrices,
    surfels_from_points,
    surfels_of,
    view_at,
)
from graycard.methods.surfels import FitTask, SurfelObjective, photographs, sparse_start
from sparse_points import with_points

QUICK = GroupingSettings(iterations=60, surfels=400, fill=0.0, identity_rate=0.1, classifier_rate=0.05)
CAMERAS = [
    Camera.from_fov(32, 28, 60, look_at(np.array([x, y, 3.0]), np.zeros(3)))
    for x, y in ((0.9, 0.0), (-0.9, 0.3), (0.1, -0.8))
]


def grid(half: float, height: float, spacing: float = 0.1) -> np.ndarray:
    steps = np.arange(-half, half + spacing / 2, spacing)
    x, y = np.meshgrid(steps, steps)
    return np.stack([x, y, np.full_like(x, height)], axis=-1).reshape(-1, 3)


def sheets(*places: np.ndarray) -> Parameters:
    """Discs that face up, opaque."""
    points = np.concatenate(places)
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return parameters_of(surfels_from_points(points, up, np.zeros((len(points), 0)), opacity=0.99))


def seen(parameters: Parameters, chosen: np.ndarray, camera: Camera) -> torch.Tensor:
    """Return classes of pixels that see chosen surfels."""
    marks = torch.from_numpy(chosen[:, None].astype(np.float32))
    drawn = rasterize_features(surfels_of(parameters.surfels, marks), camera).features[..., 0]
    return (drawn > 0.5).long()


def some_values(seed: int = 0) -> tuple[dict[str, torch.Tensor], torch.Tensor]:
    """A floor and a lid with random identities, and the lid's mask."""
    floor, lid = grid(1.0, 0.0, 0.2), grid(0.3, 0.5)
    plain = sheets(floor, lid)
    mask = seen(plain, np.arange(len(plain)) >= len(floor), CAMERAS[0])
    assert 0 < mask.sum() < mask.numel()
    return with_identities(plain, GroupingSettings(), seed).all, mask


def test_the_loss_of_masks_is_cross_entropy_over_the_logarithm_of_the_classes():
    values, mask = some_values()
    drawn = rasterize_features(surfels_of(values, values[IDENTITIES]), CAMERAS[0]).features.double().numpy()
    scores = drawn @ values[WEIGHTS].double().numpy().T + values[BIASES].double().numpy()
    shares = np.exp(scores) / np.exp(scores).sum(-1, keepdims=True)
    truly = np.where(mask.numpy() == OBJECT, shares[..., OBJECT], shares[..., 1 - OBJECT])
    expected = -np.log2(truly).mean()
    assert float(mask_loss(values, CAMERAS[0], mask)) == pytest.approx(expected, rel=1e-5)
    blind = values | {name: torch.zeros_like(values[name]) for name in (WEIGHTS, BIASES)}
    assert float(mask_loss(blind, CAMERAS[0], mask)) == pytest.approx(1.0, rel=1e-6), "it cannot tell"


def test_masks_move_identities_and_no_surfel():
    """The gradient is what pixels lack of their class, gathered by what each surfel gives to them."""
    values, mask = some_values()
    leaves = {name: v.clone().requires_grad_() for name, v in values.items()}
    loss = mask_loss(leaves, CAMERAS[0], mask)
    names = (IDENTITIES, WEIGHTS, BIASES, *GEOMETRY)
    found = dict(
        zip(
            names,
            torch.autograd.grad(loss, [leaves[name] for name in names], allow_unused=True),
            strict=True,
        )
    )
    assert all(found[name] is None for name in GEOMETRY)
    with torch.no_grad():
        surfels = surfels_of(values, values[IDENTITIES])
        drawn = rasterize_features(surfels, CAMERAS[0]).features
        lack = (drawn @ values[WEIGHTS].T + values[BIASES]).softmax(-1) - torch.eye(2)[mask]
        lack = lack / (mask.numel() * np.log(2))
    torch.testing.assert_close(found[BIASES], lack.sum(dim=(0, 1)))
    torch.testing.assert_close(found[WEIGHTS], torch.einsum("hwc,hwd->cd", lack, drawn))
    torch.testing.assert_close(found[IDENTITIES], gather(surfels, CAMERAS[0], lack) @ values[WEIGHTS])


def test_the_disagreement_of_neighbours_is_their_divergence():
    random = np.random.default_rng(0)
    own, others = random.normal(size=(7, 2)), random.normal(size=(7, 3, 2))
    total = 0.0
    for surfel in range(7):
        p = np.exp(own[surfel]) / np.exp(own[surfel]).sum()
        for neighbour in range(3):
            q = np.exp(others[surfel, neighbour]) / np.exp(others[surfel, neighbour]).sum()
            total += (p * np.log(p / q)).sum()
    scores = torch.from_numpy(own), torch.from_numpy(others)
    assert float(disagreement_of(*scores)) == pytest.approx(total / (7 * 3) / 2, rel=1e-12)
    alike = torch.from_numpy(own)[:, None].expand(-1, 3, -1)
    assert float(disagreement_of(scores[0], alike + 5)) == pytest.approx(0, abs=1e-12), "scores have no zero"
    assert torch.autograd.gradcheck(disagreement_of, tuple(s.clone().requires_grad_() for s in scores))
    sure = torch.tensor([[500.0, -500.0]]), torch.tensor([[[-500.0, 500.0]]])
    assert torch.isfinite(disagreement_of(*sure)), "a logarithm of nothing"


def test_surfels_are_compared_with_those_nearest_to_them():
    places = np.stack([2.0 ** np.arange(9), np.zeros(9), np.zeros(9)], axis=1)
    settings = GroupingSettings(neighbours=2, samples=4)
    some, others = neighbours_of_some(places, settings, (3, 1))
    assert len(set(some.tolist())) == 4
    for surfel, found in zip(some.tolist(), others.tolist(), strict=True):
        apart = np.abs(places[:, 0] - places[surfel, 0])
        assert surfel not in found
        assert sorted(apart[found]) == sorted(np.delete(apart, surfel))[:2]
    again, _ = neighbours_of_some(places, settings, (3, 1))
    assert torch.equal(some, again)
    assert any(not torch.equal(some, neighbours_of_some(places, settings, (3, k))[0]) for k in (2, 3))
    all_of_three, others = neighbours_of_some(places[:3], GroupingSettings(), (0, 0))
    assert (len(all_of_three), others.shape) == (3, (3, 2))


def learnt(plain: Parameters, masks: list[torch.Tensor], settings: GroupingSettings) -> Parameters:
    """Identities after 150 steps on surfels that stand still."""
    start = with_identities(plain, settings, 0)
    values = {name: v.clone().requires_grad_(name not in plain.all) for name, v in start.all.items()}
    adam = torch.optim.Adam([v for v in values.values() if v.requires_grad], lr=0.05)
    for step in range(150):
        number = step % len(masks)
        which, others = neighbours_of_some(plain.surfels[CENTRES].numpy(), settings, (0, step))
        scores = values[IDENTITIES] @ values[WEIGHTS].T + values[BIASES]
        loss = mask_loss(values, CAMERAS[number], masks[number])
        loss = loss + settings.consistency_weight * disagreement_of(scores[which], scores[others])
        adam.zero_grad()
        loss.backward()
        adam.step()
    found = {name: v.detach() for name, v in values.items()}
    surfels = {name: v for name, v in found.items() if name in start.surfels}
    return Parameters(surfels, {name: found[name] for name in (WEIGHTS, BIASES)})


def test_identities_tell_an_object_from_the_rest_inside_and_out():
    """A box over a floor: no view sees what is between lid and bottom, its neighbours say whose it is."""
    floor, lid, bottom, inside = grid(1.2, 0.0, 0.15), grid(0.3, 0.5), grid(0.3, 0.3), grid(0.15, 0.46)
    plain = sheets(floor, lid, bottom, inside)
    whose = np.repeat([0, 1, 1, 2], [len(floor), len(lid), len(bottom), len(inside)])
    masks = [seen(plain, whose > 0, camera) for camera in CAMERAS]
    settings = GroupingSettings(samples=200)
    fitted = learnt(plain, masks, settings)
    likely = object_probabilities(fitted.all).numpy()
    assert (likely[: len(floor)] < 0.3).mean() > 0.95
    assert (likely[len(floor) : len(floor) + len(lid)] > 0.9).mean() > 0.95
    assert (likely[whose == 2] > 0.9).all()
    theirs = named_surfels(fitted, settings).numpy()
    assert theirs[whose > 0].mean() > 0.95
    assert theirs[whose == 0].mean() < 0.05
    alone = object_probabilities(learnt(plain, masks, replace(settings, consistency_weight=0.0)).all).numpy()
    assert alone[whose == 2].min() < 0.9, "without neighbours nobody tells them"


def test_identities_that_say_nothing_are_refused():
    """A class of two that was not learnt has a probability of about one half: more than 0.3."""
    plain = sheets(grid(0.5, 0.0))
    unlearnt = with_identities(plain, GroupingSettings(), 0)
    sides = {"got all": torch.tensor([-9.0, 9.0]), "got none": torch.tensor([9.0, -9.0])}
    for says, biases in sides.items():
        sure = Parameters(unlearnt.surfels, {**unlearnt.shared, BIASES: biases})
        with pytest.raises(MethodError, match=f"probability above 0.3, {says}.*least_probability"):
            named_surfels(sure, GroupingSettings())


def test_identities_come_and_go():
    plain = sheets(grid(0.3, 0.0))
    plain = Parameters(plain.surfels, {"sky": torch.ones(1, 3)})
    named = with_identities(plain, GroupingSettings(identity_dim=7), 3)
    assert named.surfels[IDENTITIES].shape == (len(plain), 7)
    assert float(named.surfels[IDENTITIES].abs().amax()) == pytest.approx(np.sqrt(np.pi), rel=0.05)
    assert float(named.shared[WEIGHTS].abs().amax()) <= 1 / np.sqrt(7)
    back = without_identities(named)
    assert (back.surfels.keys(), back.shared.keys()) == (plain.surfels.keys(), plain.shared.keys())


def test_new_surfels_are_the_means_of_their_neighbours():
    left = sheets(grid(1.0, 0.0, 0.5))
    colours = torch.arange(len(left), dtype=torch.float32)[:, None]
    left = Parameters({**left.surfels, "colours": colours}, {"sky": torch.ones(1, 3)})
    corner = torch.tensor([[-1.0, -1.0, 0.2], [-1.0, -1.0, 0.1]])
    start = with_means(left, corner, 3)
    assert len(start) == len(left) + 2
    for name, values in left.surfels.items():
        torch.testing.assert_close(start.surfels[name][: len(left)], values, rtol=0, atol=0)
    mean = torch.tensor([(-1 - 1 - 0.5) / 3, (-1 - 0.5 - 1) / 3, 0.0])
    torch.testing.assert_close(start.surfels[CENTRES][-2:], mean.expand(2, -1))
    numbers = float(start.surfels["colours"][-1])
    assert numbers == pytest.approx((0 + 1 + 5) / 3), "rows of five, the corner is the first"
    everything = with_means(left, corner[:1], 99)
    torch.testing.assert_close(everything.surfels[CENTRES][-1], left.surfels[CENTRES].mean(dim=0))


def test_the_mean_of_rotations_does_not_ask_for_their_signs():
    """A quaternion and its negative are one rotation: the mean of numbers alone would be any other."""
    alike = torch.nn.functional.normalize(
        torch.tensor([[0.8, 0.1, -0.3, 0.5], [0.78, 0.14, -0.3, 0.5]]), dim=1
    )
    between = rotation_matrices(torch.nn.functional.normalize(alike.sum(dim=0, keepdim=True), dim=1))
    pair = sheets(np.eye(3)[:2])
    for signs in ([1.0, 1.0], [1.0, -3.0], [-2.0, 1.0], [-1.0, -1.0]):
        left = Parameters({**pair.surfels, ROTATIONS: torch.tensor(signs)[:, None] * alike})
        start = with_means(left, torch.zeros(1, 3), 5)
        found = rotation_matrices(surfels_of(start.surfels).rotations[-1:])
        torch.testing.assert_close(found, between)


def target_of(doubt: np.ndarray, hole: np.ndarray) -> Target:
    picture, depth = np.zeros((28, 32, 3)), np.ones((28, 32))
    return Target(Behind(View("0", "train", CAMERAS[0]), doubt, hole, picture, depth), picture, hole)


def test_holes_count_as_much_as_all_else_whatever_their_size():
    doubt, hole = np.zeros((28, 32), bool), np.zeros((28, 32), bool)
    doubt[8:16, 8:16], hole[10, 10], hole[12, 14] = True, True, True
    for share in (0.5, 0.2):
        weight = pixel_weights(target_of(doubt, hole), share)
        assert weight.mean() == pytest.approx(1)
        assert weight[doubt].mean() * doubt.mean() == pytest.approx(share)
        assert (weight[doubt & ~hole] == 0).all(), "nobody knows what is there"
        np.testing.assert_allclose(weight[hole], share / hole.mean())
        np.testing.assert_allclose(weight[~doubt], (1 - share) / (~doubt).mean())
    around = pixel_weights(target_of(hole, hole), 0.5)
    assert (around[10:13, 10:15] > around[0, 0]).all(), "what is beside it in its box counts for both"
    nothing = np.zeros_like(hole)
    np.testing.assert_allclose(pixel_weights(target_of(nothing, nothing), 0.3), 0.7)


@pytest.fixture(scope="module")
def scene(write_tiny: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_tiny(tmp_path_factory.mktemp("grouping"), track="tabletop", train=4, test=1)
    with_points(folder)
    return folder


def fitted(scene: Path, progress: Progress = silent, **changes: object) -> RemovalScene:
    capture, truth = open_capture(scene / "capture", check=False), open_truth(scene / "truth")
    known = {view.name: truth.layers(truth.view(view.name)) for view in capture.train}
    priors = make_priors(PriorSpec("oracle", 0), GroupingMethod.asks, capture, known, ())
    settings = replace(QUICK, **changes)  # pyright: ignore[reportArgumentType]
    return GroupingMethod().fit(capture, priors, settings, 0, progress)


def test_colours_and_places_of_the_first_stage_are_those_of_2dgs(scene: Path):
    """Learning whose surfels are changes nothing else, to the bit, while they come and go."""
    capture = open_capture(scene / "capture", check=False)
    found, kept = fitted(scene), KeepMethod().fit(capture, methods.Priors(), QUICK, 0, silent)
    assert len(kept.before.parameters) != len(capture.points()), "some came or went"
    assert found.before.parameters.all.keys() == kept.before.parameters.all.keys()
    for name, values in kept.before.parameters.all.items():
        assert torch.equal(values, found.before.parameters.all[name]), name


def test_a_step_lowers_colours_masks_and_now_and_then_disagreement(scene: Path):
    capture = open_capture(scene / "capture", check=False)
    settings, seed = replace(QUICK, consistency_weight=3.0, samples=50), 2
    values = with_identities(sparse_start(capture, settings, seed), settings, seed).all
    masks = [torch.from_numpy(mask).long() for mask in target_masks(capture)]
    colours = SurfelObjective(photographs(capture, settings), settings, seed)
    objective = IdentityObjective(colours, masks, settings)
    scores = values[IDENTITIES] @ values[WEIGHTS].T + values[BIASES]
    for step, compared in ((4, False), (5, True), (6, False)):
        look, number = objective(values, step), view_at(step, len(masks), seed)
        which, others = neighbours_of_some(values[CENTRES].numpy(), settings, (seed, step))
        disagreement = 3 * float(disagreement_of(scores[which], scores[others])) if compared else 0.0
        assert disagreement > 0.01 or not compared
        lowered = mask_loss(values, capture.train[number].camera, masks[number])
        expected = colours(values, step).loss.item() + lowered.item() + disagreement
        assert look.loss.item() == pytest.approx(expected, rel=1e-5)
        assert look.offsets is not None
        assert look.radius is not None, "surfels come and go as photographs ask for"


def test_identities_find_nearly_the_surfels_that_exact_shares_find(scene: Path):
    capture = open_capture(scene / "capture", check=False)
    masks, cameras = target_masks(capture), [view.camera for view in capture.train]
    surfels = identified(FitTask(capture, methods.Priors(), QUICK, 0, silent), masks, "grouping")
    learnt_ones = named_surfels(surfels, QUICK)
    exact = target_surfels(surfels_of(surfels.surfels), cameras, masks, 0.3)
    both, either = int((learnt_ones & exact).sum()), int((learnt_ones | exact).sum())
    assert both > 0.7 * either
    assert 10 < either < 0.5 * len(surfels)


def test_it_gets_nearer_to_the_scene_without_the_object(scene: Path):
    """Pixels of the object are half as far as with it from the true background."""
    capture, truth = open_capture(scene / "capture", check=False), open_truth(scene / "truth")
    found = fitted(scene, iterations=150, second_share=0.5)
    view = capture.train[1]
    layers = truth.layers(truth.view(view.name))
    footprint, true = layers["object_id"] == 3, layers["counterfactual.radiance"]
    assert footprint.sum() > 10
    pictures = [part.render(view.camera, ["radiance"])["radiance"] for part in (found.after, found.before)]
    without, with_object = (float(np.abs(p - true)[footprint].mean()) for p in pictures)
    assert without < 0.5 * with_object


def test_a_fit_goes_on_from_its_checkpoint(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    class KilledError(Exception):
        pass

    def kill(done: float, doing: str) -> None:
        if done > 0.7:
            raise KilledError

    path = str(tmp_path / "fit.safetensors")
    with pytest.raises(KilledError):
        fitted(scene, kill, checkpoint=path)
    whole, resumed = fitted(scene), fitted(scene, checkpoint=path)
    for ours, theirs in ((whole.before, resumed.before), (whole.after, resumed.after)):
        for name, values in ours.parameters.all.items():
            assert torch.equal(values, theirs.parameters.all[name]), name
    with pytest.raises(MethodError, match="got one of others"):
        fitted(scene, checkpoint=path, identity_dim=8)
    masks = Capture.target_mask
    monkeypatch.setattr(Capture, "target_mask", lambda self, view: np.roll(masks(self, view), 1, axis=0))
    with pytest.raises(MethodError, match="got one of others"):
        fitted(scene, checkpoint=path)


def test_settings_that_cannot_be_are_refused():
    counts = {name: 0 for name in ("identity_dim", "neighbours", "samples", "consistency_every")}
    shares = {"least_probability": 0.0, "inside_share": 1.0, "second_share": 0.0, "grow": 0.5}
    others = {"consistency_weight": -1.0, "identity_rate": 0.0, "classifier_rate": float("nan")}
    for name, value in (counts | shares | others).items():
        with pytest.raises(ValueError, match="expected"):
            GroupingSettings(**{name: value})  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="expected 1 or more iterations"):
        GroupingSettings(iterations=0)
