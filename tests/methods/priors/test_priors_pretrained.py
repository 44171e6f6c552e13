# SPDX-License-Identifier: Apache-2.0
"""Networks from disk: tiny ones that the tests make themselves."""

import sys
import warnings
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from graycard import MethodError, RecordError, methods, srgb_encode
from graycard.methods import Ask
from graycard.methods.priors import (
    Override,
    PriorSpec,
    check_priors,
    parse_priors,
    weights_in,
    weights_of,
)
from graycard.methods.priors._slopes import normals_of


class Grey(torch.nn.Module):
    """Depth: one metre and the mean of the channels."""

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return 1 + image.mean(dim=1, keepdim=True)


class Toward(torch.nn.Module):
    """Normals that look up, in the axes of a network: x right, y up, z towards the camera; not unit."""

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        one = torch.ones_like(image[:, :1])
        return torch.cat([0 * one, 3 * one, 4 * one], dim=1)


class Same(torch.nn.Module):
    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return image


class Small(torch.nn.Module):
    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return image[:, :1, ::2, ::2]


class Two(torch.nn.Module):
    def forward(self, image: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return image, image


class Mean(torch.nn.Module):
    """Inpainting: the mean of what is known; refuses sides that LaMa could not take."""

    def forward(self, image: torch.Tensor, hole: torch.Tensor) -> torch.Tensor:
        if image.shape[2] % 8 != 0 or image.shape[3] % 8 != 0:
            raise RuntimeError("sides must be multiples of 8")
        known = 1 - hole
        mean = (image * known).sum(dim=(2, 3), keepdim=True) / known.sum(dim=(2, 3), keepdim=True)
        return image * known + mean * hole


class Shrink(torch.nn.Module):
    def forward(self, image: torch.Tensor, hole: torch.Tensor) -> torch.Tensor:
        return image[:, :, 1:]


def save(module: torch.nn.Module, path: Path) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.jit.script(module).save(str(path))
    return path


def told_by(scene, kind: Any, module: torch.nn.Module, folder: Path, of: str = "photograph"):
    save(module, folder / f"{kind}.pt")
    return scene.priors(PriorSpec("pretrained", path=str(folder)), (Ask(kind, (of,)),))


def test_a_module_sees_the_encoded_image_and_gives_depth(scene, tmp_path: Path):
    told = told_by(scene, "depth", Grey(), tmp_path)
    expected = 1 + srgb_encode(scene.photograph).mean(axis=-1)
    np.testing.assert_allclose(told.depth(scene.photograph, scene.view), expected, rtol=1e-5)


def test_normals_of_a_module_are_turned_into_the_world(scene, tmp_path: Path):
    told = told_by(scene, "normal", Toward(), tmp_path)
    normal = told.normal(scene.photograph, scene.view)
    pose = scene.view.camera.camera_to_world[:3, :3]
    up, back = -pose[:, 1], -pose[:, 2]
    np.testing.assert_allclose(normal, np.broadcast_to(0.6 * up + 0.8 * back, normal.shape), atol=1e-6)
    assert up[2] > 0  # the camera stands upright


def test_colours_materials_and_masks_by_modules(scene, tmp_path: Path):
    image, view = scene.photograph, scene.view
    told = told_by(scene, "base_color", Same(), tmp_path)
    np.testing.assert_allclose(told.base_color(image, view), srgb_encode(image), atol=1e-6)
    told = told_by(scene, "mask", Grey(), tmp_path, "glossy")
    assert told.mask(image, view, "glossy").all()
    told = told_by(scene, "roughness", Grey(), tmp_path)
    with pytest.raises(MethodError, match=r"expected roughness in \[0, 1\], got 1"):
        told.roughness(image, view)


def test_holes_are_filled_in_by_a_module_at_any_size(scene, tmp_path: Path):
    view, hole = scene.view, np.zeros((24, 28), bool)
    hole[5:9, 6:12] = True
    told = told_by(scene, "inpainting", Mean(), tmp_path, "radiance")
    even = np.full((24, 28, 3), 0.25)
    holed = np.where(hole[..., None], 9.0, even)
    np.testing.assert_allclose(told.inpainting(holed, view, hole), even, atol=1e-5)
    halves = np.where(np.arange(28) < 14, 1.0, 3.0) * np.ones((24, 1))
    filled = told.inpainting(np.where(hole, 9.0, halves), view, hole, of="depth")
    assert np.array_equal(filled[~hole], halves[~hole])
    assert (np.abs(filled[hole] - 2) < 0.3).all()
    colours = np.repeat(halves[..., None], 3, axis=-1)
    filled = told.inpainting(np.where(hole[..., None], 9.0, colours), view, hole, of="f0")
    assert (np.abs(filled[hole] - 2) < 0.3).all()
    assert np.array_equal(told.inpainting(even, view, np.zeros_like(hole)), even)
    with pytest.raises(MethodError, match="expected a hole with something around it"):
        told.inpainting(even, view, np.ones_like(hole))


@pytest.mark.parametrize(
    ("kind", "module", "message"),
    [
        ("depth", Small(), r"expected \(1, 1, 24, 28\) from the network for depth, got \(1, 1, 12, 14\)"),
        ("normal", Grey(), r"expected \(1, 3, 24, 28\) from the network for normal, got \(1, 1, 24, 28\)"),
        ("depth", Two(), "expected the network to give a tensor, got tuple"),
        ("depth", Mean(), "the network failed: "),
    ],
)
def test_modules_that_give_something_else(
    kind: str, module: torch.nn.Module, message: str, scene, tmp_path: Path
):
    told = told_by(scene, kind, module, tmp_path)
    with pytest.raises(MethodError, match=message):
        getattr(told, kind)(scene.photograph, scene.view)


def test_an_inpainting_module_that_gives_another_size(scene, tmp_path: Path):
    told = told_by(scene, "inpainting", Shrink(), tmp_path, "radiance")
    hole = np.zeros((24, 28), bool)
    hole[5:9, 6:12] = True
    with pytest.raises(MethodError, match="from the network for inpainting, got"):
        told.inpainting(scene.photograph, scene.view, hole)


def test_damaged_weights_and_folders_for_other_kinds(scene, tmp_path: Path):
    (tmp_path / "depth.pt").write_bytes(b"no archive")
    (tmp_path / "roughness").mkdir()
    spec = PriorSpec("pretrained", path=str(tmp_path))
    with pytest.raises(MethodError, match="expected a TorchScript module at .*depth.pt, got"):
        scene.priors(spec, (Ask("depth"),))
    with pytest.raises(MethodError, match="expected a TorchScript file for roughness priors, got the folder"):
        scene.priors(spec, (Ask("roughness"),))


def test_a_path_that_no_file_can_have_holds_no_weights():
    spec = PriorSpec("pretrained", path="x" * 5000)
    with pytest.raises(MethodError, match="expected weights"):
        check_priors(spec, (Ask("depth"),))
    assert weights_in(spec) == ()
    own = PriorSpec("oracle", overrides={"depth": Override(source="pretrained", path="x" * 5000)})
    with pytest.raises(MethodError, match="expected weights"):
        check_priors(own, (Ask("depth"),))


def test_a_word_that_is_no_word_is_not_read():
    with pytest.raises(RecordError, match="expected priors in a word or a path .*, got 100000 characters"):
        parse_priors("x" * 100_000)


def test_weights_of_what_is_optional_may_be_missing(scene, tmp_path: Path):
    """Unless they were named, or there are none at all."""
    asks = (Ask("depth"), Ask("normal", optional=True))
    save(Grey(), tmp_path / "depth.pt")
    spec = PriorSpec("pretrained", path=str(tmp_path))
    assert scene.priors(spec, asks).kinds == {"depth"}
    assert len(weights_of(spec, asks)) == 1
    named = replace(spec, overrides={"normal": Override(source="pretrained")})
    with pytest.raises(MethodError, match="expected weights for normal priors at .*normal.pt, got none"):
        scene.priors(named, asks)
    with pytest.raises(MethodError, match=r"expected weights of what the method asks for \(mask.pt\) in"):
        scene.priors(spec, (Ask("mask", ("glossy",), optional=True),))


def test_without_transformers_it_says_what_to_install(scene, tmp_path: Path, monkeypatch):
    monkeypatch.setitem(sys.modules, "transformers", None)
    spec = PriorSpec("oracle", overrides={"depth": Override(source="pretrained", path=str(tmp_path))})
    with pytest.raises(MethodError, match=r"got none: .*\. Install it: pip install 'graycard\[priors\]'"):
        scene.priors(spec, (Ask("depth"),))


def stand_in(model_type: str, estimates: str | None, calls: list) -> SimpleNamespace:
    """Put the part of ``transformers`` that is called in its place: a network with 1 + 3 * mean of the
    encoded image."""

    class Processor:
        def __call__(self, images: np.ndarray, return_tensors: str) -> dict[str, torch.Tensor]:
            assert images.dtype == np.uint8
            assert return_tensors == "pt"
            return {"pixel_values": torch.from_numpy(images).float().permute(2, 0, 1)[None] / 255}

        def post_process_depth_estimation(self, outputs: torch.Tensor, target_sizes: list) -> list[dict]:
            assert [tuple(outputs.shape[1:])] == target_sizes
            return [{"predicted_depth": outputs[0]}]

    class Model(torch.nn.Module):
        config = SimpleNamespace(model_type=model_type)

        def forward(self, pixel_values: torch.Tensor) -> torch.Tensor:
            return 1 + 3 * pixel_values.mean(dim=1)

    if estimates:
        Model.config.depth_estimation_type = estimates

    def loads(made: type):
        def from_pretrained(path: str, local_files_only: bool):
            calls.append((path, local_files_only))
            return made()

        return SimpleNamespace(from_pretrained=from_pretrained)

    return SimpleNamespace(AutoImageProcessor=loads(Processor), AutoModelForDepthEstimation=loads(Model))


@pytest.mark.parametrize(
    ("model_type", "estimates", "inverse"),
    [
        ("depth_pro", None, False),
        ("depth_anything", "metric", False),
        ("depth_anything", "relative", True),
        ("dpt", None, True),
    ],
)
def test_metric_and_relative_depth(
    model_type: str, estimates: str | None, inverse: bool, scene, tmp_path: Path, monkeypatch
):
    calls: list = []
    monkeypatch.setitem(sys.modules, "transformers", stand_in(model_type, estimates, calls))
    for kind in ("depth", "normal"):
        (tmp_path / kind).mkdir()
    told = scene.priors(PriorSpec("pretrained", path=str(tmp_path)), (Ask("depth"), Ask("normal")))
    assert calls == [(str(tmp_path / kind), True) for kind in ("depth", "depth", "normal", "normal")]
    said = 1 + 3 * (np.round(255 * srgb_encode(scene.photograph)) / 255).mean(axis=-1)
    expected = np.median(said) / said if inverse else said
    depth = told.depth(scene.photograph, scene.view)
    np.testing.assert_allclose(depth, expected, rtol=1e-5)
    expected = normals_of(depth, scene.view.camera)
    np.testing.assert_allclose(told.normal(scene.photograph, scene.view), expected, atol=1e-6)


@pytest.mark.filterwarnings("ignore")
def test_a_tiny_depth_pro_of_random_weights(scene, tmp_path: Path):
    transformers = pytest.importorskip("transformers", reason="transformers is not installed (extra: priors)")
    encoder = {"num_hidden_layers": 2, "num_attention_heads": 2, "image_size": 16, "patch_size": 4}
    config = transformers.DepthProConfig(
        patch_size=16,
        fusion_hidden_size=16,
        intermediate_hook_ids=[1, 0],
        intermediate_feature_dims=[10, 8],
        scaled_images_ratios=[0.5, 1.0],
        scaled_images_overlap_ratios=[0.0, 0.2],
        scaled_images_feature_dims=[12, 12],
        image_model_config={"model_type": "dinov2", "hidden_size": 16, **encoder},
        patch_model_config={"model_type": "vit", "hidden_size": 24, **encoder},
        fov_model_config={"model_type": "vit", "hidden_size": 32, **encoder},
        use_fov_model=True,
    )
    torch.manual_seed(0)
    transformers.DepthProForDepthEstimation(config).save_pretrained(tmp_path / "depth")
    size = {"height": 32, "width": 32}
    transformers.DepthProImageProcessor(size=size).save_pretrained(tmp_path / "depth")
    told = scene.priors(PriorSpec("pretrained", path=str(tmp_path)), (Ask("depth"),))
    depth = told.depth(scene.photograph, scene.view)
    assert depth.shape == (24, 28)
    assert np.array_equal(depth, told.depth(scene.photograph, scene.view))


def test_a_folder_that_is_no_checkpoint(scene, tmp_path: Path, monkeypatch):
    def from_pretrained(path: str, local_files_only: bool):
        raise OSError(f"{path} has no config.json\nmore")

    auto = SimpleNamespace(from_pretrained=from_pretrained)
    library = SimpleNamespace(AutoImageProcessor=auto, AutoModelForDepthEstimation=auto)
    monkeypatch.setitem(sys.modules, "transformers", library)
    (tmp_path / "depth").mkdir()
    with pytest.raises(MethodError, match="checkpoint of transformers for depth in .*no config.json$"):
        scene.priors(PriorSpec("pretrained", path=str(tmp_path)), (methods.Ask("depth"),))
