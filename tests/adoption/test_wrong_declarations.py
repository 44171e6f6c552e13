# SPDX-License-Identifier: Apache-2.0
"""A convention that was declared wrongly is named by a hint, which says what to declare."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from graycard import View, open_predictions
from graycard.adoption import adopt, parse_map, request_of, times_word
from graycard.cli import main
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
    """Declaration that the hint advises; ``right`` if empty."""

    def __str__(self) -> str:
        return self.name


CASES = (
    Case("sRGB for linear", "base_color", lambda v, _: v, "linear", "srgb", "looks decoded twice"),
    Case("linear for sRGB", "base_color", lambda v, _: encode(v), "srgb", "linear", "looks sRGB-encoded"),
    Case("linear picture for sRGB", "radiance", lambda v, _: encode(v * 0.45), "srgb:exposed", "linear",
         "looks as displayed"),
    Case("exposed for not exposed", "radiance", lambda v, _: v, "linear", "linear:exposed",
         "divided by the exposure twice", "the same without exposed"),
    Case("linear exposed for sRGB exposed", "radiance", lambda v, _: encode(v * 0.45), "srgb:exposed",
         "linear:exposed", "sRGB-encoded, then divided by the exposure"),
    Case("linear exposed for sRGB", "radiance", lambda v, _: encode(v), "srgb", "linear:exposed",
         "divided by an exposure that it never had"),
    Case("sRGB for linear exposed", "radiance", lambda v, _: v * 0.45, "linear:exposed", "srgb",
         "decoded twice, and exposed"),
    Case("sRGB exposed for linear", "radiance", lambda v, _: v, "linear", "srgb:exposed",
         "decoded twice, then divided by an exposure"),
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
    Case("a camera's coded for not coded", "normal", lambda v, w: local(v, w), "camera-opencv",
         "camera-opencv:coded", "by 2 n - 1 in camera axes (x right, y down)", "the same without coded"),
    Case("OpenGL's coded for not coded", "normal", lambda v, w: local(v, w) * OPENGL, "camera-opengl",
         "camera-opengl:coded", "by 2 n - 1 in camera axes (x right, y up)", "the same without coded"),
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


@pytest.mark.parametrize(
    ("made", "declared"),
    [
        (lambda v: np.rint((v + 1) / 2 * 255).astype(np.uint8), "camera-opengl:coded:codes"),
        (lambda v: v * 3, "world"),
        (lambda v: v * 0.1, "world"),
    ],
)
def test_normals_that_are_no_directions_are_named(
    made: Callable[[np.ndarray], np.ndarray], declared: str, adopted_scene: Path, own: Path, tmp_path: Path
) -> None:
    """Whatever was mistaken, a length other than 1 shows it; scores look at directions alone."""
    (tmp_path / "theirs").mkdir()
    for view, _, layers, _ in numbered(own, adopted_scene):
        np.save(tmp_path / "theirs" / f"{view.name}.npy", made(layers["normal"]))
    adopt(request_of(tmp_path / "theirs", adopted_scene, [f"normal={{view}}.npy:{declared}"]), tmp_path / "o")
    (hint,) = find_hints(tmp_path / "o", adopted_scene)
    assert (hint.layer, "normals are" in hint.says, "coded" in hint.declare) == ("normal", True, True)


@pytest.mark.parametrize(
    ("layer", "declared", "factor", "right"),
    [
        ("depth", "z:times=0.01", 0.1, "times=0.001"),
        ("depth", "z:codes:times=0.01", 0.0999993, "times=0.001"),
        ("depth", "distance", 2.7, "times=2.7"),
        ("depth", "inverse:times=0.5", 4.0, "times=0.125"),
        ("depth", "z:times=0.001", 1000.0, "the same without times"),
        ("base_color", "linear:times=2", np.pi, "times=6.28319"),
        ("base_color", "gamma2:times=2", 4.0, "times=4"),
        ("base_color", "srgb", np.pi, ""),
        ("normal", "world", -1.0, "times=-1"),
        ("normal", "world:coded", -1.0, ""),
    ],
)
def test_a_factor_is_told_as_it_is_to_be_written(
    layer: str, declared: str, factor: float, right: str
) -> None:
    """A factor is taken on the values as they lie in the files, and stands in the place of another one."""
    assert times_word(parse_map(f"{layer}={{view}}.npy:{declared}"), factor) == right


@pytest.mark.parametrize(("declared", "factor"), [("z:times=0.01", 1000.0), ("inverse:times=0.5", 1.0)])
def test_what_a_hint_of_the_verb_says_is_right_when_it_is_written(
    declared: str,
    factor: float,
    adopted_scene: Path,
    own: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """No second hint sends back to the first declaration."""
    (tmp_path / "theirs").mkdir()
    for view, _, layers, _ in numbered(own, adopted_scene):
        values = layers["depth"] if declared.startswith("z") else 1 / layers["depth"]
        np.save(tmp_path / "theirs" / f"{view.name}.npy", values * factor)
    args = ["adopt", str(tmp_path / "theirs"), str(adopted_scene), "--out", str(tmp_path / "o"), "--map"]
    assert main([*args, f"depth={{view}}.npy:{declared}"]) == 0
    said = capsys.readouterr().out
    word = said.partition("of depth: try ")[2].split("\n")[0].split(",")[0]
    kind = declared.partition(":")[0]
    again = kind if word == "the same without times" else f"{kind}:{word}"
    assert main([*args, f"depth={{view}}.npy:{again}"]) == 0
    assert "hint 1" not in capsys.readouterr().out
    found, mine = open_predictions(tmp_path / "o"), open_predictions(own)
    for view in mine.view_names():
        np.testing.assert_allclose(found.layers(view)["depth"], mine.layers(view)["depth"], rtol=2e-3)


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
