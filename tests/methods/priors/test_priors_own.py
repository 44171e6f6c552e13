# SPDX-License-Identifier: Apache-2.0
"""The network of ``graycard train-prior``: its shape, and how a file of its weights is asked."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file, save_file
from scipy.spatial.transform import Rotation

from graycard import Camera, MethodError, View
from graycard.io import sha256
from graycard.methods import Ask
from graycard.methods._priors import Question
from graycard.methods.priors import Override, PriorSpec, parse_priors, unanswered, weights_of
from graycard.methods.priors._own import load_own
from graycard.methods.priors._spec import OWN_KINDS
from graycard.methods.priors.network import HEADS, GeometryNet, inputs_of, rays_of

KINDS = ("depth", "normal", "base_color", "roughness", "metallic")
OPTIONAL = tuple(Ask(kind, optional=True) for kind in KINDS)
K = np.array([[120.0, 0, 56], [0, 120, 56], [0, 0, 1]])
IMAGE = np.random.default_rng(0).uniform(0, 1, (112, 112, 3))


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Random ones, as a training begins with, that see a surface everywhere."""
    torch.manual_seed(0)
    net = GeometryNet()
    tensors = {name: values.half().numpy() for name, values in net.state_dict().items()}
    tensors["head.bias"] = np.full_like(tensors["head.bias"], 3.0)
    path = tmp_path_factory.mktemp("weights") / "own.safetensors"
    save_file(tensors, path)
    return path


def asked(weights: Path, kind, pose: np.ndarray) -> np.ndarray:
    view = View("a", "train", Camera(112, 112, K, pose))
    return load_own(kind, weights).answer(Question(kind, view, IMAGE))


def test_it_tells_all_heads_at_the_size_of_the_picture():
    net = GeometryNet()
    rays = rays_of(K, 32, 48)
    told = net(inputs_of(torch.rand(2, 3, 32, 48), rays.expand(2, -1, -1, -1)))
    assert {name: tuple(values.shape) for name, values in told.items()} == {
        name: (2, channels, 32, 48) for name, channels in HEADS.items()
    }
    torch.testing.assert_close(told["normal"].norm(dim=1), torch.ones(2, 32, 48))
    for name in ("base_color", "roughness", "metallic"):
        assert 0 <= told[name].min() <= told[name].max() <= 1


def test_it_is_small(weights: Path):
    assert weights.stat().st_size < 6e6


def test_the_last_layer_is_not_cut_off_from_the_others():
    """Without a norm before it, one large step left it no positive input, and a constant answer for good."""
    net = GeometryNet()
    low = dict(net.state_dict())
    low["up.0.bias"] = torch.full_like(low["up.0.bias"], -100.0)
    net.load_state_dict(low)
    told = net(inputs_of(torch.rand(1, 3, 32, 32), rays_of(K, 32, 32)[None]))
    told["depth"].std().backward()
    assert net.stem.weight.grad is not None
    assert net.stem.weight.grad.abs().max() > 0


def test_rays_are_those_of_the_camera():
    x, y = rays_of(K, 112, 112).double().numpy()
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    wanted = Camera(112, 112, K, np.eye(4)).rays()
    np.testing.assert_allclose(rays / np.linalg.norm(rays, axis=-1, keepdims=True), wanted, atol=1e-6)


def test_a_file_answers_all_its_kinds(scene, weights: Path):
    spec = parse_priors(f"pretrained:{weights}")
    told = scene.priors(spec, OPTIONAL)
    assert told.kinds == OWN_KINDS == set(KINDS)
    for kind in KINDS:
        answer = getattr(told, kind)(scene.photograph, scene.view)  # sound, or it raises
        assert answer.shape[:2] == scene.photograph.shape[:2]
        assert np.any(answer != 0)
    assert weights_of(spec, OPTIONAL) == [sha256(weights)] * len(KINDS)


def test_what_it_does_not_know_needs_another_source(scene, weights: Path):
    spec = parse_priors(f"pretrained:{weights}")
    filling = Ask("inpainting", ("radiance",))
    with pytest.raises(MethodError, match="`graycard train-prior` tells of base_color, depth, metallic"):
        scene.priors(spec, (*OPTIONAL, filling))
    assert unanswered(spec, (*OPTIONAL, replace(filling, optional=True))) == ("inpainting",)
    mixed = PriorSpec("oracle", 2, overrides={"normal": Override("pretrained", path=str(weights))})
    assert scene.priors(mixed, (Ask("normal"), filling)).kinds == {"normal", "inpainting"}
    assert weights_of(mixed, (Ask("normal"), filling)) == [sha256(weights)]


def test_it_does_not_know_where_the_camera_stands(weights: Path):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", [0.3, -1.1, 2.0]).as_matrix()
    pose[:3, 3] = 5.0
    straight, turned = asked(weights, "normal", np.eye(4)), asked(weights, "normal", pose)
    np.testing.assert_allclose(turned, straight @ pose[:3, :3].T, atol=1e-6)


def test_weights_of_another_network_are_refused(scene, tmp_path: Path):
    path = tmp_path / "w.safetensors"
    for write in (
        lambda: path.write_bytes(b"none"),
        lambda: save_file({"stem.weight": np.zeros((3, 3), np.float16)}, path),
    ):
        write()
        with pytest.raises(MethodError, match="expected weights of graycard's own network in .*w.safe"):
            scene.priors(parse_priors(f"pretrained:{path}"), (Ask("normal"),))


def test_weights_that_give_no_numbers_are_refused(weights: Path, tmp_path: Path):
    broken = {name: np.full_like(values, np.nan) for name, values in load_file(weights).items()}
    save_file(broken, tmp_path / "w.safetensors")
    with pytest.raises(MethodError, match="expected finite values from the network for depth"):
        asked(tmp_path / "w.safetensors", "depth", np.eye(4))
