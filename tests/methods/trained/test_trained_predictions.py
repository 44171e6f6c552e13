# SPDX-License-Identifier: Apache-2.0
"""Trained splats as predictions: scored as the code that trained them renders them, in the right units."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from scipy.spatial.transform import Rotation

from graycard import Camera, Capture, DatasetError, GraycardError, Predictions, look_at
from graycard.benchmarks.speed import _gsplat as peer
from graycard.cli import main
from graycard.dataset import open_capture, open_truth
from graycard.eval import score_photographs, score_predictions
from graycard.exchange import ExchangeFormat, export_capture, import_capture
from graycard.io import silent
from graycard.methods.splat import SH_DC, Gaussians, Surfels, harmonics_basis, rotations_to
from graycard.methods.surfels import srgb_decode_tensor, srgb_encode_tensor
from graycard.methods.trained import (
    Encoding,
    Frame,
    FrameKind,
    Look,
    TrainedSplat,
    read_frame,
    render_splat,
    write_splat,
    write_splat_predictions,
)
from graycard.predictions import finish_predictions, open_predictions, write_view
from gsplat_3dgs import colours_by_gsplat, drawn_by_gsplat
from random_gaussians import random_gaussians
from splat_files import inria_columns, plain, raw_splat, write_ply

exporter = pytest.importorskip("gsplat.exporter", reason="gsplat comes with the extras 'gpu' and 'test'")
CLOSE_DB = 0.05
SIZE = (84, 72)
"""Pixels: fine enough that discs are drawn as such, and not as the pixels that they lie in."""


def surface_splat(scene: Path, count: int = 1200) -> TrainedSplat:
    """Discs on the true surfaces of the training views, in the colours of these, a little wrong."""
    capture, truth, r = open_capture(scene / "capture"), open_truth(scene / "truth"), np.random.default_rng(3)
    found = []
    for view in capture.train:
        layers = truth.layers(view)
        seen = np.isfinite(layers["depth"])
        places = view.camera.unproject(np.where(seen, layers["depth"], 1.0))[seen]
        found.append((places, layers["normal"][seen], layers["radiance"][seen]))
    places, normals, radiance = (np.concatenate(parts) for parts in zip(*found, strict=True))
    kept = r.choice(len(places), count, replace=False)
    shown = srgb_encode_tensor(torch.from_numpy(radiance[kept] * capture.exposure).double()).float()
    coefficients = torch.from_numpy(r.normal(0, 0.02, (count, 16, 3))).float()
    coefficients[:, 0] = (shown - 0.5) / SH_DC
    surfels = Surfels(
        torch.from_numpy(places[kept] + r.normal(0, 2e-3, (count, 3))).float(),  # no two of one depth
        torch.from_numpy(rotations_to(normals[kept])).float(),
        torch.from_numpy(r.uniform(0.03, 0.07, (count, 2))).float(),
        torch.from_numpy(r.uniform(0.7, 0.99, count)).float(),
        torch.empty(count, 0),
    )
    return TrainedSplat(surfels, coefficients, False)


def scored(predictions: Path, scene: Path) -> float:
    sheet = score_predictions(predictions, scene)
    (value,) = (score.value for score in sheet.scores if score.metric == "novel_view.psnr")
    assert value is not None
    return value


def write_pictures(folder: Path, capture: Capture, draw: Callable[[Camera], torch.Tensor]) -> Path:
    """Write predictions of encoded pictures, by nothing but the rules of docs/reference/formats.md."""
    for view in capture.views:
        radiance = srgb_decode_tensor(draw(view.camera)) / capture.exposure
        write_view(folder, view.name, {"radiance": radiance.numpy()})
    finish_predictions(folder, Predictions("peer", capture.track, capture.scene))
    return folder


def test_a_3dgs_file_of_gsplats_exporter_scores_as_gsplats_own_code(
    tmp_path: Path, make_scene: Callable[..., Path]
):
    scene = make_scene(size=SIZE)
    capture, discs = open_capture(scene / "capture"), surface_splat(scene)
    thick = torch.nn.functional.pad(discs.shapes.scales, (0, 1), value=0.01)
    raw = {
        "means": discs.shapes.centres,
        "scales": thick.log(),
        "quats": 1.5 * discs.shapes.rotations,
        "opacities": torch.logit(discs.shapes.opacities),
        "sh0": discs.coefficients[:, :1],
        "shN": discs.coefficients[:, 1:],
    }
    exporter.export_splats(**raw, format="ply", save_to=str(tmp_path / "trained.ply"))
    out = tmp_path / "mine"
    assert main(["splat", str(tmp_path / "trained.ply"), str(scene), "--out", str(out)]) == 0
    shapes = plain(Gaussians, discs.shapes.centres, discs.shapes.rotations, thick, discs.shapes.opacities)

    def by_gsplat(camera: Camera) -> torch.Tensor:
        colours = colours_by_gsplat(discs.coefficients, shapes.centres, camera, 3)
        return drawn_by_gsplat(replace(shapes, features=colours), camera)[0]

    mine = scored(out, scene)
    theirs = scored(write_pictures(tmp_path / "theirs", capture, by_gsplat), scene)
    assert mine > 15
    assert abs(mine - theirs) < CLOSE_DB
    assert open_predictions(out).method == "splat"
    assert set(open_predictions(out).layers(capture.views[0].name)) == {"radiance", "depth"}


def test_a_2dgs_file_of_ours_scores_as_gsplats_own_code(tmp_path: Path, make_scene: Callable[..., Path]):
    scene = make_scene(size=SIZE)
    capture, discs = open_capture(scene / "capture"), surface_splat(scene)
    write_splat(tmp_path / "ours.ply", discs, "2dgs")
    out = tmp_path / "mine"
    assert main(["splat", str(tmp_path / "ours.ply"), str(scene), "--out", str(out), "--name", "discs"]) == 0
    found = discs.shapes.centres, discs.shapes.rotations, discs.shapes.scales, discs.shapes.opacities
    centres, rotations, scales, opacities = (values.double() for values in found)
    surfels = Surfels(centres, rotations, scales, opacities, torch.empty(len(discs), 0).double())

    def by_gsplat(camera: Camera) -> torch.Tensor:
        colours = colours_by_gsplat(discs.coefficients.double(), surfels.centres, camera, 3)
        projected = peer.project(surfels, camera)
        pairs = peer.pairs_of(projected, surfels.opacities, camera)
        return peer.accumulate(projected, pairs, surfels.opacities, colours, camera)[0].float()

    mine = scored(out, scene)
    theirs = scored(write_pictures(tmp_path / "theirs", capture, by_gsplat), scene)
    assert mine > 15
    assert abs(mine - theirs) < CLOSE_DB
    layers = open_predictions(out).layers(capture.views[0].name)
    assert set(layers) == {"radiance", "depth", "normal"}
    truth = open_truth(scene / "truth").layers(capture.views[0])
    both = np.isfinite(layers["depth"]) & np.isfinite(truth["depth"])
    assert both.mean() > 0.2
    assert np.median(np.abs(layers["depth"][both] - truth["depth"][both])) < 0.02
    assert np.median((layers["normal"] * truth["normal"]).sum(-1)[both]) > 0.98


def test_what_the_pictures_hold_is_linear_radiance(tmp_path: Path, make_scene: Callable[..., Path]):
    """A wall of one colour before all cameras: decoded by the sRGB curve, divided by the exposure."""
    capture = open_capture(make_scene() / "capture")
    wall = plain(Gaussians, [[0, 0, 0.4]] * 4, [[1, 0, 0, 0]] * 4, [[500] * 3] * 4, [0.999] * 4)
    splat = TrainedSplat(wall, torch.full((4, 1, 3), (0.735 - 0.5) / SH_DC), False)
    shown = 0.735 * 0.999  # the second of them would leave less than 1e-4: it is not drawn
    for look, linear in ((Look("srgb"), ((shown + 0.055) / 1.055) ** 2.4), (Look("linear"), shown)):
        write_splat_predictions(splat, capture, tmp_path / "p", silent, look)
        for view in capture.views:
            seen = open_predictions(tmp_path / "p").layers(view.name)
            np.testing.assert_allclose(seen["radiance"] * capture.exposure, linear, rtol=1e-4)
            depth = view.camera.project(np.array([0, 0, 0.4]))[1]
            np.testing.assert_allclose(seen["depth"], depth, rtol=1e-5)


def import_grey_wall(
    folder: Path, write_tiny: Callable[..., Path], layout: ExchangeFormat = "nerfstudio"
) -> Path:
    """Import photographs of one grey, code 128, at the cameras of the tiny scene; TensoIR's have truth."""
    scene, away = write_tiny(folder / "rendered", train=6, test=3), folder / "away"
    export_capture(scene, layout, away)
    for view in open_capture(scene / "capture").views:
        grey = np.full((view.camera.height, view.camera.width, 3), 128, np.uint8)
        if layout == "nerfstudio":
            Image.fromarray(grey).save(away / "images" / f"{view.name}.png")
    for path in away.glob("*/rgba.png"):
        Image.fromarray(np.full_like(np.asarray(Image.open(path)), (128, 128, 128, 255))).save(path)
    return import_capture(away, folder / "mine", "dark", "wall")


def grey_wall(code: float = 128) -> TrainedSplat:
    """A wall of one colour all around, as training on photographs of it ends."""
    wall = plain(Gaussians, [[0, 0, 0.4]] * 4, [[1, 0, 0, 0]] * 4, [[500] * 3] * 4, [0.9999] * 4)
    return TrainedSplat(wall, torch.full((4, 1, 3), (code / 255 - 0.5) / SH_DC), False)


def test_a_splat_of_imported_photographs_scores_as_they_are(tmp_path: Path, write_tiny: Callable[..., Path]):
    """Its light is that of the photographs, which the exposure of the capture has no part in."""
    scene = import_grey_wall(tmp_path, write_tiny)
    capture, psnr = open_capture(scene / "capture"), {}
    assert not 0.7 < capture.exposure < 1.4  # a factor that would show
    for exposed in (None, False, True):
        write_splat_predictions(grey_wall(), capture, tmp_path / "p", silent, Look(exposed=exposed))
        scores = score_photographs(tmp_path / "p", scene).scores
        (psnr[exposed],) = (score.value for score in scores if score.metric == "photographs.psnr")
    assert psnr[None] == psnr[False] > 50
    assert psnr[True] < 20


@pytest.mark.parametrize(
    ("encoding", "code"), [("srgb", 128), ("linear", 255 * ((128 / 255 + 0.055) / 1.055) ** 2.4)]
)
def test_an_imported_truth_does_not_change_the_unit_of_light(
    tmp_path: Path, write_tiny: Callable[..., Path], encoding: Encoding, code: float
):
    """TensoIR's layout brings albedo and normals, and photographs in display white all the same."""
    scene = import_grey_wall(tmp_path, write_tiny, "tensoir")
    assert (scene / "truth").is_dir()
    capture = open_capture(scene / "capture")
    write_splat_predictions(grey_wall(code), capture, tmp_path / "p", silent, Look(encoding))
    photograph = capture.photograph(capture.train[0])
    seen = open_predictions(tmp_path / "p").layers(capture.train[0].name)["radiance"]
    np.testing.assert_allclose(seen, photograph, rtol=4e-3)  # a thousandth shines through


def test_a_background_is_what_it_was_trained_over(make_scene: Callable[..., Path]):
    camera = open_capture(make_scene() / "capture").views[0].camera
    few = random_gaussians(5, 1, 0.02)
    shapes = plain(Gaussians, few.centres, few.rotations, few.scales, few.opacities)
    splat = TrainedSplat(shapes, torch.zeros(5, 1, 3), False)
    black, white = (render_splat(splat, camera, background=value).colour for value in (0.0, 1.0))
    assert black.min() == 0
    assert (white - black).max() == 1
    assert (white - black).min() < 0.9


def moved(splat: TrainedSplat, frame: Frame) -> TrainedSplat:
    """The same splat as a program has it that moves the world before it trains."""
    shapes, turn = splat.shapes, Rotation.from_matrix(frame.turn)
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before, after = (harmonics_basis(d, splat.degree) for d in (directions, turn.apply(directions)))
    change = np.linalg.lstsq(after, before, rcond=None)[0]
    coefficients = np.einsum("kj,njc->nkc", change, splat.coefficients.double().numpy())
    turns = turn * Rotation.from_quat(shapes.rotations.numpy(), scalar_first=True)
    centres = frame.scale * turn.apply(shapes.centres.numpy()) + frame.shift
    quaternions = turns.as_quat(scalar_first=True)
    there = plain(type(shapes), centres, quaternions, shapes.scales * frame.scale, shapes.opacities)
    return TrainedSplat(there, torch.from_numpy(coefficients).float(), False)


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("kind", ["nerfstudio", "matrix"])
def test_a_moved_world_is_moved_back(tmp_path: Path, make_scene: Callable[..., Path], kind: str, flat: bool):
    """Turned from z up to y up, shrunk and shifted: the picture, depth and normals are those of the scene."""
    scene = make_scene()
    capture, splat = open_capture(scene / "capture"), surface_splat(scene, 300)
    if not flat:
        thick = torch.nn.functional.pad(splat.shapes.scales, (0, 1), value=0.02)
        shapes = plain(Gaussians, splat.shapes.centres, splat.shapes.rotations, thick, splat.shapes.opacities)
        splat = replace(splat, shapes=shapes)
    turn = (
        Rotation.from_euler("x", -90, degrees=True) * Rotation.from_euler("z", 20, degrees=True)
    ).as_matrix()
    scale, shift = 0.37, np.array([0.3, -0.2, 0.7])
    if kind == "nerfstudio":
        held = {"transform": np.hstack([turn, shift[:, None]]).tolist(), "scale": scale}
        (tmp_path / "dataparser_transforms.json").write_text(json.dumps(held))
        frame, wanted = read_frame("nerfstudio", tmp_path / "dataparser_transforms.json"), scale * shift
    else:
        matrix = np.vstack([np.hstack([scale * turn, shift[:, None]]), [0, 0, 0, 1]])
        (tmp_path / "m.json").write_text(json.dumps(matrix.tolist()))
        np.savetxt(tmp_path / "m.txt", matrix)
        np.save(tmp_path / "m.npy", matrix)
        frame, wanted = read_frame("matrix", tmp_path / "m.json"), shift
        for other in ("m.txt", "m.npy"):
            np.testing.assert_allclose(read_frame("matrix", tmp_path / other).turn, frame.turn, atol=1e-12)
    np.testing.assert_allclose(frame.shift, wanted, atol=1e-9)
    assert frame.scale == pytest.approx(scale)
    there = moved(splat, frame)
    for view in capture.views[:2]:
        here, back = render_splat(splat, view.camera), render_splat(there, view.camera, frame)
        apart = np.abs(here.colour - back.colour)
        assert (apart > 2e-3).mean() < 2e-3
        seen = np.isfinite(here.depth) & np.isfinite(back.depth)
        assert np.median(np.abs(here.depth[seen] - back.depth[seen])) < 1e-5
        if flat:
            assert here.normal is not None
            assert back.normal is not None
            assert np.median(np.abs(here.normal - back.normal)[seen]) < 1e-4


def test_what_ns_process_data_has_applied_is_taken_back(tmp_path: Path):
    """nerfstudio composes it with what it did to the frames, and the scale too: nerfstudio_dataparser.py."""
    turn, shift = (
        Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix(),
        np.array([0.1, 0.2, 0.3]),
    )
    first = np.array([[0, 1.0, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0.5]])  # of ns-process-data, and a shift
    whole = np.hstack([turn, shift[:, None]]) @ np.vstack([first, [0, 0, 0, 1]])
    (tmp_path / "d.json").write_text(json.dumps({"transform": whole.tolist(), "scale": 0.5 * 3}))
    meta = {"applied_transform": first.tolist(), "applied_scale": 3, "frames": []}
    (tmp_path / "transforms.json").write_text(json.dumps(meta))
    frame = read_frame("nerfstudio", tmp_path / "d.json", tmp_path / "transforms.json")
    np.testing.assert_allclose(frame.turn, turn, atol=1e-12)
    np.testing.assert_allclose(frame.shift, 0.5 * shift, atol=1e-12)
    assert frame.scale == pytest.approx(0.5)
    (tmp_path / "transforms.json").write_text('{"applied_transform": [[0,0,0,0],[0,0,0,0],[0,0,0,0]]}')
    with pytest.raises(DatasetError, match="that can be undone"):
        read_frame("nerfstudio", tmp_path / "d.json", tmp_path / "transforms.json")


@pytest.mark.parametrize(
    ("kind", "text", "message"),
    [
        ("nerfstudio", '{"scale": 1}', "expected 3 x 4 numbers"),
        (
            "nerfstudio",
            '{"transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0]]}',
            "expected a number other than 0",
        ),
        (
            "nerfstudio",
            '{"transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0]], "scale": 0}',
            "a number other than 0",
        ),
        ("nerfstudio", '{"transform": [[1,0,0,0],[0,1,0,0],[0,0,-1,0]], "scale": 1}', "expected a turn"),
        ("nerfstudio", "[1]", "expected 3 x 4 numbers"),
        ("nerfstudio", '{"transform": [[1,0,0,0],[0,1,0,0],[0,0,1,NaN]], "scale": 1}', "expected"),
        ("matrix", "1 0 0 0 0 1 0 0 0 0 1 0", "expected 4 x 4 numbers"),
        ("matrix", "1 0 0 0 0 2 0 0 0 0 1 0 0 0 0 1", "expected a turn"),
        ("matrix", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1", "last row 0 0 0 1"),
        ("matrix", "1 0 0 nan 0 1 0 0 0 0 1 0 0 0 0 1", "expected finite numbers"),
        ("matrix", "[[1,", "got a file that is none"),
        ("matrix", "one", "expected 4 x 4 numbers"),
    ],
)
def test_frames_that_are_none_are_refused(tmp_path: Path, kind: FrameKind, text: str, message: str):
    (tmp_path / "frame").write_text(text)
    with pytest.raises(GraycardError, match=message):
        read_frame(kind, tmp_path / "frame")
    with pytest.raises(DatasetError, match="expected"):
        read_frame(kind, tmp_path / "none")


def test_the_command_line(
    tmp_path: Path, make_scene: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    scene, out = make_scene(), tmp_path / "out"
    columns = inria_columns(raw_splat(random_gaussians(30, 5, opacities=(0.1, 0.9)), 1))
    path = write_ply(tmp_path / "t.ply", columns | {"segment": columns["x"]})
    (tmp_path / "m.txt").write_text("2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1")
    args = ["splat", str(path), str(scene), "--out", str(out)]
    assert main([*args, "--frame", "matrix", str(tmp_path / "m.txt"), "--background", "white"]) == 0
    told = capsys.readouterr()
    assert "30 ellipsoids (3DGS) with harmonics of degree 1, 5 views" in told.out.replace("\n", " ")
    assert "not looked at: segment" in told.err.replace("\n", " ")
    before = sorted(p.name for p in out.rglob("*"))
    path.write_bytes(path.read_bytes()[:-9])
    assert main(args) == 2
    assert "cut off or damaged" in capsys.readouterr().err
    assert sorted(p.name for p in out.rglob("*")) == before  # a damaged file takes nothing away
    for wrong, message in [
        (["--frame", "colmap", "x"], "expected --frame with nerfstudio or matrix"),
        (["--name", "two\nlines"], "Mend --name"),
    ]:
        assert main([*args, *wrong]) == 2
        assert message in capsys.readouterr().err.replace("\n", " ")


@pytest.mark.parametrize("background", ["black", "white"])
def test_views_without_anything_of_the_splat_are_named(
    tmp_path: Path, make_scene: Callable[..., Path], capsys: pytest.CaptureFixture[str], background: str
):
    """The world was moved, and nobody said so: pictures of the background are written, with a word."""
    scene, columns = make_scene(), inria_columns(raw_splat(random_gaussians(30, 5, opacities=(0.1, 0.9)), 1))
    for shift, unseen in ((0.0, False), (1e4, True)):
        path = write_ply(tmp_path / "t.ply", columns | {"x": columns["x"] + np.float32(shift)})
        args = ["splat", str(path), str(scene), "--out", str(tmp_path / "o"), "--background", background]
        assert main(args) == 0
        said = capsys.readouterr().err.replace("\n", " ")
        assert ("nothing of the splat is seen in 5 of 5 views" in said) == unseen


def test_gravity_of_opengl_and_opencv_cameras(tmp_path: Path):
    """A red ball above, a green one below: red is in the upper half of the picture."""
    balls = plain(Gaussians, [[0, 0, 1], [0, 0, -1]], [[1, 0, 0, 0]] * 2, [[0.2] * 3] * 2, [0.9, 0.9])
    red, green = (np.array(c) for c in ([1.0, 0, 0], [0, 1.0, 0]))
    splat = TrainedSplat(
        balls, torch.from_numpy((np.stack([red, green])[:, None] - 0.5) / SH_DC).float(), False
    )
    camera = Camera.from_fov(32, 32, 60, look_at(np.array([0, -4.0, 0]), np.zeros(3)))
    colour = render_splat(splat, camera).colour
    assert colour[:16, :, 0].sum() > 10 * colour[16:, :, 0].sum()
    assert colour[16:, :, 1].sum() > 10 * colour[:16, :, 1].sum()
