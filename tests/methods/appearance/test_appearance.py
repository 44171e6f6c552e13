# SPDX-License-Identifier: Apache-2.0
"""``appearance`` on a tiny scene, behind the contract."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import Capture, GraycardError, MethodError, View, methods, open_capture, srgb_encode
from graycard.io import silent
from graycard.layers import find_fault
from graycard.methods.appearance import AppearanceScene, AppearanceSettings
from graycard.methods.appearance._method import start
from graycard.methods.appearance._nearest import eyes_of
from graycard.methods.appearance._tone import EMBEDDINGS, tone_rates, toned
from graycard.methods.splat import LOGITS, initial_state
from graycard.methods.splat.fit._optimise import leaves
from graycard.methods.surfels import SurfelObjective, Tones, learning_rates
from graycard.methods.surfels._objective import photographs
from sparse_points import with_points

QUICK = {"iterations": 60, "surfels": 400, "degree": 1, "fill": 0.0}
"""The sparse points alone: there are many of them here."""


@pytest.fixture
def scene(make_scene: Callable[..., Path]) -> Path:
    return make_scene(train=5, test=2)


def settings(**changes: object) -> AppearanceSettings:
    return methods.settings_of(methods.load_method("appearance"), QUICK | changes)


def fitted(scene: Path, seed: int = 0, **changes: object) -> AppearanceScene:
    method = methods.load_method("appearance")
    found = method.fit(with_points(scene), methods.Priors(), settings(**changes), seed, silent)
    assert isinstance(found, AppearanceScene)
    return found


def test_it_follows_the_contract(scene: Path):
    found = fitted(scene)
    assert isinstance(methods.load_method("appearance"), methods.Method)
    assert methods.asks_of(methods.load_method("appearance")) == ()
    assert isinstance(found, methods.Decomposition)
    assert found.lights() is None
    for view in open_capture(scene / "capture", check=False).views:
        layers = found.render(view.camera, sorted(found.provides))
        assert layers.keys() == {"radiance", "normal", "depth"}
        for layer, values in layers.items():
            assert find_fault(layer, values, view.camera.height, view.camera.width) is None
            assert values.dtype == np.float32
    with pytest.raises(MethodError, match="expected layers out of"):
        found.render(open_capture(scene / "capture", check=False).views[0].camera, ["albedo"])


def own_scene(capture: Capture) -> AppearanceScene:
    """Surfels whose photographs differ far more than those of a new fit."""
    own = start(capture, settings(), 0)
    random = torch.Generator().manual_seed(1)
    embeddings = torch.randn(own.shared[EMBEDDINGS].shape, generator=random)
    shared = {**own.shared, EMBEDDINGS: embeddings}
    shared["tone weights 2"] = 300 * shared["tone weights 2"]
    surfels = {**own.surfels, LOGITS: torch.full((len(own),), 3.0)}
    parameters = replace(own, surfels=surfels, shared=shared)
    return AppearanceScene(parameters, eyes_of([v.camera for v in capture.train]), capture.exposure)


def display_error(found: methods.Decomposition, true: methods.Decomposition, views: tuple[View, ...]):
    """Mean square, as displayed."""
    errors = []
    for view in views:
        shown = [s.render(view.camera, ["radiance"])["radiance"] for s in (found, true)]
        drawn, expected = (srgb_encode(image) for image in shown)
        errors.append(((drawn - expected) ** 2).mean())
    return float(np.mean(errors))


def test_a_scene_of_its_own_class_is_recovered(scene: Path, monkeypatch: pytest.MonkeyPatch):
    """Oracle proof: photographs that the model drew itself, each in another tone; 2dgs cannot follow them."""
    capture = replace(with_points(scene), exposure=1.0)
    true = own_scene(capture)
    monkeypatch.setattr(
        Capture, "photograph", lambda capture, view: true.render(view.camera, ["radiance"])["radiance"]
    )
    errors, faster = {}, {"embedding_rate": 1e-2, "network_rate": 2e-3}  # tones differ by far here
    for name, rates in (("appearance", faster), ("2dgs", {})):
        method = methods.load_method(name)
        chosen = methods.settings_of(method, QUICK | {"iterations": 400, "degree": 0} | rates)
        found = method.fit(capture, methods.Priors(), chosen, 0, silent)
        errors[name] = [display_error(found, true, views) for views in (capture.train, capture.test)]
    for ours, plain in zip(errors["appearance"], errors["2dgs"], strict=True):
        assert ours < 0.4 * plain


def test_a_view_has_the_tone_of_the_nearest_photograph_whatever_it_shows(scene: Path):
    """Nothing of a held-out view but its camera can matter: it has no photograph in the capture."""
    capture = with_points(scene)
    true = own_scene(capture)
    view = capture.test[0]
    near = true.eyes.nearest(view.camera)
    before = true.render(view.camera, ["radiance"])["radiance"]
    for number in range(len(capture.train)):
        embeddings = true.parameters.shared[EMBEDDINGS].clone()
        embeddings[number] += 1
        shared = {**true.parameters.shared, EMBEDDINGS: embeddings}
        changed = replace(true, parameters=replace(true.parameters, shared=shared))
        after = changed.render(view.camera, ["radiance"])["radiance"]
        assert np.array_equal(after, before) == (number != near)


def test_each_number_gets_a_gradient_in_the_first_step_of_full_degree(scene: Path):
    capture, chosen = with_points(scene), settings(normal_start=0.0, distortion_start=0.0)
    state = initial_state(start(capture, chosen, 0), 0)
    moving = leaves(state, learning_rates(2.0, chosen) | tone_rates(chosen), 0.0)
    objective = SurfelObjective(photographs(capture, chosen), chosen, 0, Tones(toned, tone_rates(chosen)))
    look = objective(moving, 10)  # the second degree of the harmonics begins at a thirtieth
    asked = {name: values for name, values in moving.items() if values.requires_grad}
    assert asked.keys() == state.parameters.all.keys()
    for name, gradient in zip(asked, torch.autograd.grad(look.loss, list(asked.values())), strict=True):
        assert torch.isfinite(gradient).all(), name
        assert gradient.abs().max() > 0, name


def test_equal_seeds_give_equal_bits_and_a_save_renders_the_same(scene: Path, tmp_path: Path):
    first, again, other = (fitted(scene, seed) for seed in (1, 1, 2))
    for name, values in first.parameters.all.items():
        assert torch.equal(values, again.parameters.all[name])
    assert not torch.equal(first.parameters.shared[EMBEDDINGS], other.parameters.shared[EMBEDDINGS])
    first.save(tmp_path / "saved")
    back = methods.load_method("appearance").load(tmp_path / "saved")
    for view in open_capture(scene / "capture", check=False).views:
        for layer, values in first.render(view.camera, sorted(first.provides)).items():
            assert np.array_equal(values, back.render(view.camera, [layer])[layer])
    assert (tmp_path / "saved" / "surfels.ply").is_file()
    with pytest.raises(MethodError, match="expected a decomposition by '2dgs'"):
        methods.load_method("2dgs").load(tmp_path / "saved")


def test_a_fit_goes_on_where_it_was_cut_off(scene: Path, tmp_path: Path):
    def cut(share: float, message: str) -> None:
        if share >= 0.6:
            raise KeyboardInterrupt

    path = str(tmp_path / "fit")
    method = methods.load_method("appearance")
    with pytest.raises(KeyboardInterrupt):
        method.fit(with_points(scene), methods.Priors(), settings(checkpoint=path), 0, cut)
    whole, resumed = fitted(scene), fitted(scene, checkpoint=path)
    for name, values in whole.parameters.all.items():
        assert torch.equal(values, resumed.parameters.all[name])
    with pytest.raises(MethodError, match="to hold a fit of these photographs"):
        method.fit(with_points(scene), methods.Priors(), settings(checkpoint=path, embedding=8), 0, no_step)


def no_step(share: float, message: str) -> None:
    raise AssertionError("a step was taken")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda image: image * 0, "expected light in the photographs"),
        (lambda image: np.where(np.arange(image.size).reshape(image.shape) == 7, np.nan, image), "finite"),
    ],
)
def test_photographs_without_light_or_sense_are_refused(
    scene: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[np.ndarray], np.ndarray], message: str
):
    honest = Capture.photograph
    monkeypatch.setattr(Capture, "photograph", lambda capture, view: change(honest(capture, view)))
    capture = open_capture(scene / "capture", check=False)
    with pytest.raises(MethodError, match=message):
        methods.load_method("appearance").fit(capture, methods.Priors(), settings(), 0, silent)


def test_one_view_is_refused(make_scene: Callable[..., Path]):
    with pytest.raises(MethodError, match="from different places"):
        fitted(make_scene(train=1, test=1))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"iterations": 0}, "1 or more iterations"),
        ({"embedding": 0}, "1 or more for embedding and width"),
        ({"network_rate": 0.0}, "learning rates above 0"),
    ],
)
def test_bad_settings(changes: dict[str, object], message: str):
    with pytest.raises(GraycardError, match=message):
        settings(**changes)
