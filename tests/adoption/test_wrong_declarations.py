# SPDX-License-Identifier: Apache-2.0
"""A convention that was declared wrongly is named by a hint, which says what to declare."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from graycard import View, open_predictions
from graycard.adoption import adopt, request_of
from graycard.eval import find_hints
from other_outputs import decode, encode, numbered

OPENGL = np.array([1.0, -1.0, -1.0])
Made = Callable[[np.ndarray, View], np.ndarray]


def local(normals: np.ndarray, view: View) -> np.ndarray:
    return normals @ view.camera.camera_to_world[:3, :3]


def ray_cosine(view: View) -> np.ndarray:
    return view.camera.rays() @ view.camera.forward


@dataclass(frozen=True)
class Case:
    """A convention of files, and another one that they are declared to have."""

    name: str
    layer: str
    made: Made
    right: str
    wrong: str
    says: str
    declare: str = ""
    """What the hint advises; ``right`` where it is empty."""

    def __str__(self) -> str:
        return self.name


CASES = (
    Case("sRGB for linear", "base_color", lambda v, _: v, "linear", "srgb", "looks decoded twice"),
    Case("linear for sRGB", "base_color", lambda v, _: encode(v), "srgb", "linear", "looks sRGB-encoded"),
    Case("linear picture for sRGB", "radiance", lambda v, _: encode(v * 0.45), "srgb:exposed", "linear",
         "looks as displayed"),
    Case("exposed for not exposed", "radiance", lambda v, _: v, "linear", "linear:exposed",
         "divided by the exposure twice", "the same without exposed"),
    Case("B, G, R", "base_color", lambda v, _: v[..., ::-1], "linear:bgr", "linear", "looks like B, G, R",
         "bgr, or leave it out"),
    Case("world for camera", "normal", lambda v, w: local(v, w), "camera-opencv", "world",
         "looks like camera axes (x right, y down)"),
    Case("world for OpenGL's camera", "normal", lambda v, w: local(v, w) * OPENGL, "camera-opengl", "world",
         "looks like camera axes (x right, y up)"),
    Case("camera for world", "normal", lambda v, _: v, "world", "camera-opencv", "was in world axes"),
    Case("OpenGL's camera for world", "normal", lambda v, _: v, "world", "camera-opengl",
         "was in world axes"),
    Case("OpenGL for OpenCV", "normal", lambda v, w: local(v, w), "camera-opencv", "camera-opengl",
         "the other kind of camera axes", "camera-opencv for camera-opengl, or the reverse"),
    Case("OpenCV for OpenGL", "normal", lambda v, w: local(v, w) * OPENGL, "camera-opengl", "camera-opencv",
         "the other kind of camera axes", "camera-opencv for camera-opengl, or the reverse"),
    Case("z up for y up", "normal", lambda v, _: v[..., [0, 2, 1]] * (1, 1, -1), "world-y-up", "world",
         "looks like y up"),
    Case("not coded for coded", "normal", lambda v, _: (v + 1) / 2, "world:coded", "world",
         "looks encoded as (n + 1) / 2", "coded"),
    Case("coded for not coded", "normal", lambda v, _: v, "world", "world:coded",
         "looks decoded by 2 n - 1", "the same without coded"),
    Case("a camera's codes for the world", "normal", lambda v, w: (local(v, w) * OPENGL + 1) / 2,
         "camera-opengl:coded", "world", "encoded as (n + 1) / 2: write n of the world"),
    Case("z for distance", "depth", lambda v, w: v / ray_cosine(w), "distance", "z",
         "looks like distance along the ray"),
    Case("distance for z", "depth", lambda v, _: v, "z", "distance", "z that was taken for distance"),
    Case("z for 1 / z", "depth", lambda v, _: 1 / v, "inverse", "z", "looks like 1 / z",
         "inverse, or z for inverse"),
    Case("millimetres for metres", "depth", lambda v, _: v * 1000, "z:times=0.001", "z",
         "looks like millimetres", "times=0.001"),
    Case("a world that was scaled", "depth", lambda v, _: v / 2.7, "z:times=2.7", "z",
         "looks scaled: times 2.7", "times=2.7"),
    Case("upside down albedo", "base_color", lambda v, _: v[::-1], "linear:bottom-up", "linear",
         "looks mirrored: top and bottom", "bottom-up, or leave it out"),
    Case("upside down depth", "depth", lambda v, _: v, "z", "z:bottom-up",
         "looks mirrored: top and bottom", "bottom-up, or leave it out"),
    Case("upside down pictures", "radiance", lambda v, _: v[::-1], "linear:bottom-up", "linear",
         "pictures look mirrored: top and bottom", "bottom-up, or leave it out"),
    Case("alpha for roughness", "roughness", lambda v, _: v**2, "gamma0.5", "linear", "looks like alpha"),
)  # fmt: skip


def write(folder: Path, case: Case, own: Path, scene: Path) -> None:
    folder.mkdir()
    for view, _, layers, _ in numbered(own, scene):
        values = case.made(layers[case.layer].astype(np.float64), view)
        np.save(folder / f"{view.name}.npy", values.astype(np.float32))


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_wrong_declaration_is_named_and_the_right_one_is_not(
    case: Case, adopted_scene: Path, own: Path, tmp_path: Path
) -> None:
    write(tmp_path / "theirs", case, own, adopted_scene)
    for declared, hinted in ((case.right, False), (case.wrong, True)):
        maps = [f"{case.layer}={{view}}.npy:{declared}"]
        adopt(request_of(tmp_path / "theirs", adopted_scene, maps), tmp_path / "ours")
        hints = find_hints(tmp_path / "ours", adopted_scene)
        assert [hint.layer for hint in hints] == [case.layer] * hinted, hints
        if hinted:
            assert case.says in hints[0].says
            assert hints[0].declare.startswith(case.declare or case.right)
        else:
            found, mine = open_predictions(tmp_path / "ours"), open_predictions(own)
            for view in mine.view_names():
                was = mine.layers(view)[case.layer]
                np.testing.assert_allclose(found.layers(view)[case.layer], was, rtol=2e-5, atol=2e-6)


@pytest.mark.parametrize("layer", ["radiance", "base_color", "normal", "depth"])
def test_views_in_another_order_are_named(layer: str, adopted_scene: Path, own: Path, tmp_path: Path) -> None:
    """Files are numbered in the reverse order of the names of views."""
    word = {"radiance": "linear", "base_color": "linear", "normal": "world", "depth": "z"}[layer]
    (tmp_path / "theirs").mkdir()
    names = sorted(open_predictions(own).view_names(), reverse=True)
    for number, name in enumerate(names):
        np.save(tmp_path / "theirs" / f"{number}.npy", open_predictions(own).layers(name)[layer])
    (tmp_path / "order.txt").write_text("\n".join(names))
    for order, hinted in ((str(tmp_path / "order.txt"), False), ("capture", True)):
        request = request_of(
            tmp_path / "theirs", adopted_scene, [f"{layer}={{index}}.npy:{word}"], order=order
        )
        adopt(request, tmp_path / "ours")
        hints = find_hints(tmp_path / "ours", adopted_scene)
        assert [hint.says.partition(":")[0] for hint in hints] == ["views look exchanged"] * hinted, hints
        assert all("--order" in hint.declare for hint in hints)


def test_decoding_goes_on_beyond_white(adopted_scene: Path, own: Path, tmp_path: Path) -> None:
    """Nothing is cut off: colour-science's curve goes on, too."""
    values = np.linspace(0, 3, 28 * 24 * 3).reshape(24, 28, 3)
    (tmp_path / "theirs").mkdir()
    for name in open_predictions(own).view_names():
        np.save(tmp_path / "theirs" / f"{name}.npy", values)
    adopt(request_of(tmp_path / "theirs", adopted_scene, ["radiance={view}.npy:srgb"]), tmp_path / "ours")
    found = open_predictions(tmp_path / "ours").layers("test_001")["radiance"]
    np.testing.assert_allclose(found, decode(values), rtol=1e-6)
