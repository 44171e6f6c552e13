# SPDX-License-Identifier: Apache-2.0
"""What was fitted, to look at: exported surfels, films, and the page in a headless browser."""

import json
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import imageio.v3 as iio
import numpy as np
import pytest
import torch

from graycard import Camera, GraycardError, MethodError, Predictions, look_at
from graycard.cli import main
from graycard.dataset import open_capture
from graycard.methods.splat import Surfels, parameters_of
from graycard.methods.surfels import COEFFICIENTS, DETAIL, SKY, SurfelScene
from graycard.methods.trained import read_splat, render_splat
from graycard.methods.viewer import open_fitted, orbit, preview, serve_fitted, serve_pictures, write_film
from graycard.predictions import finish_predictions, write_view
from random_surfels import random_surfels

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


def read_film(path: Path) -> list[np.ndarray]:
    if path.is_dir():
        return [iio.imread(picture) for picture in sorted(path.glob("*.png"))]
    if path.suffix == ".gif":
        return list(iio.imiter(path))
    film, pictures = cv2.VideoCapture(str(path)), []
    while (found := film.read())[0]:
        pictures.append(found[1])
    return pictures


def fitted_scene(count: int = 60) -> SurfelScene:
    """As ``2dgs`` would have fitted it, under a black sky."""
    found = random_surfels(count, 2, 3, 0.15, opacities=(0.3, 0.95))
    geometry = found.centres, found.rotations, found.scales, found.opacities, found.features
    r = torch.Generator().manual_seed(4)
    colours = {
        COEFFICIENTS: torch.randn(count, 1, 3, generator=r),
        DETAIL: 0.2 * torch.randn(count, 15, 3, generator=r),
    }
    surfels = Surfels(*(values.float() for values in geometry))
    return SurfelScene(parameters_of(surfels, colours, {SKY: torch.zeros(4, 3)}), "2dgs", 1.0)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    fitted_scene().save(tmp_path / "saved")
    return tmp_path / "saved"


@pytest.mark.parametrize(("kind", "axes"), [("ply", 3), ("2dgs", 2)])
def test_exported_surfels_read_back_as_they_were_fitted(tmp_path: Path, saved: Path, kind: str, axes: int):
    out = tmp_path / "out.ply"
    assert main(["export", str(saved), "--format", kind, "--out", str(out)]) == 0
    assert out.read_bytes().count(b"property float scale_") == axes
    camera = Camera.from_fov(40, 32, 60, look_at(np.array([0.3, -3.0, 0.6]), np.zeros(3)))
    truth = fitted_scene().render(camera, ["depth", "normal"])
    seen = render_splat(read_splat(out), camera)
    both = np.isfinite(truth["depth"]) & np.isfinite(seen.depth)
    assert both.mean() > 0.1
    np.testing.assert_allclose(seen.depth[both], truth["depth"][both], atol=1e-4)
    assert seen.normal is not None
    np.testing.assert_allclose(seen.normal[both], truth["normal"][both], atol=1e-3)


def test_an_exported_splat_file_has_a_record_a_surfel(tmp_path: Path, saved: Path):
    assert main(["export", str(saved), "--format", "splat", "--out", str(tmp_path / "o.splat")]) == 0
    assert len(read_splat(tmp_path / "o.splat")) == 60


def test_what_cannot_be_exported_is_named(
    tmp_path: Path, saved: Path, make_scene: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    for folder, message in [
        (make_scene(), "expected a saved decomposition"),
        (tmp_path / "no", "got another"),
    ]:
        assert main(["export", str(folder), "--format", "ply", "--out", str(tmp_path / "o.ply")]) == 2
        assert message in capsys.readouterr().err.replace("\n", " ")
    assert main(["export", str(saved), "--format", "ply", "--out", str(tmp_path)]) == 2
    assert "expected a file to write to" in capsys.readouterr().err.replace("\n", " ")
    (saved / "surfels.ply").unlink()
    assert main(["export", str(saved), "--format", "ply", "--out", str(tmp_path / "o.ply")]) == 2
    assert "without surfels" in capsys.readouterr().err.replace("\n", " ")


def test_only_methods_of_graycard_are_opened(saved: Path):
    index = json.loads((saved / "decomposition.json").read_text())
    (saved / "decomposition.json").write_text(json.dumps(index | {"method": "evil:code"}))
    with pytest.raises(MethodError, match="expected a decomposition by a method of graycard .* 'evil:code'"):
        open_fitted(saved)


@pytest.mark.parametrize("name", ["turn.gif", "turn", "turn.mp4"])
def test_a_turntable_is_a_film(tmp_path: Path, saved: Path, name: str):
    if name.endswith("mp4"):
        pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg comes with the extra 'view'")
    out = tmp_path / name
    args = ["turntable", str(saved), "--out", str(out), "--frames", "6", "--size", "32", "--seconds", "1"]
    assert main(args) == 0
    pictures = read_film(out)
    assert len(pictures) == 6
    assert all(picture.shape[:2] == (32, 32) for picture in pictures)
    assert np.abs(pictures[0].astype(int) - pictures[3].astype(int)).max() > 20


def test_films_that_cannot_be_made_are_named(tmp_path: Path, saved: Path, capsys: pytest.CaptureFixture[str]):
    for more, message in [
        (["--out", str(tmp_path / "a.avi")], "expected .gif, .mp4 or the name of a folder"),
        (["--out", str(tmp_path / "a"), "--frames", "0"], "Mend --frames"),
        (["--out", str(tmp_path / "a"), "--size", "31"], "Mend --size"),
        (["--out", str(tmp_path / "a"), "--seconds", "0"], "Mend --seconds"),
        (["--out", str(tmp_path / "a"), "--layer", "roughness"], "expected layers out of"),
    ]:
        assert main(["turntable", str(saved), *more]) == 2
        assert message in capsys.readouterr().err.replace("\n", " ")
    assert not list(tmp_path.glob("a*"))
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "x").write_text("x")
    with pytest.raises(GraycardError, match="got one in use"):
        write_film(tmp_path / "used", [np.zeros((2, 2, 3), np.uint8)], 1)


def test_an_orbit_goes_around_and_looks_at_the_middle(make_scene: Callable[..., Path]):
    centres = np.random.default_rng(0).normal([1, 2, 3], 0.5, (500, 3))
    for cameras in ([], [view.camera for view in open_capture(make_scene() / "capture").views]):
        ring = orbit(centres, 8, 64, cameras)
        opposite = (ring[0].position + ring[4].position) / 2
        for camera in ring:
            assert camera.position[2] > opposite[2] - 1e-9
            assert camera.camera_to_world[2, 1] < 0  # the picture's lower edge is below
        middle = np.array([0, 0, 0.4]) if cameras else np.median(centres, axis=0)
        for camera in ring:
            pixel, depth = camera.project(middle)
            assert depth > 0
            assert np.abs(pixel - 32).max() < 2


def test_previews_have_known_values():
    up = np.zeros((1, 2, 3))
    up[..., 2] = 1
    assert preview("normal", up)[0, 0].tolist() == [128, 128, 255]
    depth = np.array([[0.0, 1.0, 2.0, np.inf]])
    assert preview("depth", depth, 2.0)[0, :, 0].tolist() == [255, 128, 0, 0]
    assert preview("radiance", np.full((1, 1, 3), 0.5), 2.0)[0, 0, 0] == 137  # sRGB of a quarter
    assert preview("base_color", np.full((1, 1, 3), 0.5))[0, 0, 0] == 188
    assert preview("roughness", np.array([[0.5, np.nan]]))[0, :, 0].tolist() == [128, 0]


def test_the_page_needs_viser(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(__import__("sys").modules, "viser", None)
    with pytest.raises(MethodError, match=r"pip install 'graycard\[view\]'"):
        serve_pictures({"a": {"radiance": np.zeros((2, 2, 3), np.uint8)}}, {}, 8090)
    with pytest.raises(MethodError, match="expected predictions with layers to show"):
        serve_pictures({}, {}, 8090)


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of websockets, which viser runs on
def test_fitted_surfels_and_their_layers_in_a_browser(saved: Path):
    pytest.importorskip("viser", reason="viser comes with the extra 'view'")
    from playwright.sync_api import sync_playwright

    fitted = open_fitted(saved)
    asked: list[str] = []
    decomposition = fitted.decomposition
    camera = Camera.from_fov(40, 32, 60, look_at(np.array([0.3, -3.0, 0.6]), np.zeros(3)))

    class Watched:
        provides = decomposition.provides

        def render(self, camera: Camera, layers: list[str]) -> dict[str, np.ndarray]:
            asked.extend(layers)
            return decomposition.render(camera, layers)

    object.__setattr__(fitted, "decomposition", Watched())
    server = serve_fitted(fitted, {"train_000": camera}, 8123)
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=CHROMIUM,
                args=["--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader"],
            )
            page = browser.new_page()
            page.goto(f"http://127.0.0.1:{server.get_port()}")
            page.wait_for_selector("canvas", timeout=60_000)
            page.locator("input[role=combobox][value=surfels]").click(timeout=60_000)
            page.get_by_role("option", name="normal").click(timeout=60_000)
            deadline = time.monotonic() + 60
            while "normal" not in asked and time.monotonic() < deadline:
                page.wait_for_timeout(200)
            assert "normal" in asked
            browser.close()
    finally:
        server.stop()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_verb_serves_predictions_until_it_ends(
    tmp_path: Path, make_scene: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    pytest.importorskip("viser", reason="viser comes with the extra 'view'")
    scene = make_scene()
    for view in open_capture(scene / "capture").views:
        write_view(tmp_path / "p", view.name, {"radiance": np.ones((24, 28, 3), np.float32)})
    finish_predictions(tmp_path / "p", Predictions("even", "dark", "tiny-0000"))
    codes: list[int] = []
    args = ["view", str(tmp_path / "p"), "--scene", str(scene), "--port", "8133", "--seconds", "0.5"]
    thread = threading.Thread(target=lambda: codes.append(main(args)))
    thread.start()
    thread.join(60)
    assert codes == [0]
    assert "view: http://127.0.0.1:" in capsys.readouterr().out
