# SPDX-License-Identifier: Apache-2.0
"""Views of a fit: exported surfels, films, and the page in a headless browser."""

import json
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import MappingProxyType

import cv2
import imageio.v3 as iio
import numpy as np
import pytest
import torch
from playwright.sync_api import Page, sync_playwright
from scipy.spatial.transform import Rotation
from viser import ViserServer

from graycard import Camera, GraycardError, MethodError, Predictions, look_at
from graycard.cli import main
from graycard.dataset import open_capture
from graycard.methods.splat import Surfels, parameters_of
from graycard.methods.surfels import COEFFICIENTS, DETAIL, SKY, SurfelScene
from graycard.methods.trained import read_splat, render_splat
from graycard.methods.viewer import (
    open_fitted,
    orbit,
    preview,
    serve_fitted,
    serve_pictures,
    up_of,
    write_film,
)
from graycard.methods.viewer._turns import Turns
from graycard.predictions import finish_predictions, open_predictions, write_view
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
    """Return a scene like a fit of ``2dgs``, under a black sky."""
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
            assert camera.position[2] > opposite[2] - 1e-3
            assert camera.camera_to_world[2, 1] < 0  # the picture's lower edge is below
        middle = np.array([0, 0, 0.4]) if cameras else np.median(centres, axis=0)
        for camera in ring:
            pixel, depth = camera.project(middle)
            assert depth > 0
            assert np.abs(pixel - 32).max() < 2


def ring(
    turned: np.ndarray, reach: float = 2 * np.pi, roll: float = 0.0, height: float = 1.0
) -> list[Camera]:
    """Photographs from an arc about the origin, whose world is then turned."""
    found = []
    for number, angle in enumerate(np.linspace(0, reach, 12, endpoint=False)):
        pose = look_at(np.array([3 * np.cos(angle), 3 * np.sin(angle), height]), np.zeros(3))
        pose[:3, :3] @= Rotation.from_rotvec([0, 0, roll * (-1) ** number]).as_matrix()
        pose[:3] = turned @ pose[:3]
        found.append(Camera.from_fov(32, 24, 50, pose))
    return found


COLMAP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Turn z into minus y, as a reconstruction from upright photographs has it."""


@pytest.mark.parametrize("seed", [None, 0, 1, 2])
@pytest.mark.parametrize(("reach", "roll"), [(2 * np.pi, 0.0), (2.0, 0.0), (0.5, 0.0), (2 * np.pi, 0.1)])
def test_up_is_what_is_up_in_the_photographs(seed: int | None, reach: float, roll: float):
    """The film turns about what is up in the photographs, however structure from motion lays the world."""
    turned = COLMAP if seed is None else Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    cameras, true = ring(turned, reach, roll), turned[:, 2]
    assert np.degrees(np.arccos(min(up_of(cameras) @ true, 1))) < 0.5
    film = orbit(np.zeros((5, 3)), 8, 32, cameras)
    np.testing.assert_allclose([c.position @ true for c in film], 1.0, atol=0.05)
    assert all(-c.camera_to_world[:3, 1] @ true > 0.9 for c in film)


def test_up_where_it_is_not_known():
    """One photograph, or none, or as many upside down as upright."""
    tilted = ring(COLMAP)[:1]
    np.testing.assert_allclose(up_of(tilted) @ tilted[0].camera_to_world[:3, :3], [0, -1, 0], atol=1e-9)
    upright = Camera.from_fov(32, 24, 50, look_at(np.array([3.0, 0, 0]), np.zeros(3)))
    over = Camera(32, 24, upright.K, upright.camera_to_world @ np.diag([-1.0, -1, 1, 1]))
    for cameras in ([], [upright, over]):
        np.testing.assert_allclose(up_of(cameras), [0, 0, 1], atol=1e-6)


def test_previews_have_known_values():
    up = np.zeros((1, 2, 3))
    up[..., 2] = 1
    assert preview("normal", up)[0, 0].tolist() == [128, 128, 255]
    depth = np.array([[0.0, 1.0, 2.0, np.inf]])
    assert preview("depth", depth, 2.0)[0, :, 0].tolist() == [255, 128, 0, 0]
    assert preview("radiance", np.full((1, 1, 3), 0.5), 2.0)[0, 0, 0] == 137  # sRGB of a quarter
    assert preview("base_color", np.full((1, 1, 3), 0.5))[0, 0, 0] == 188
    assert preview("roughness", np.array([[0.5, np.nan]]))[0, :, 0].tolist() == [128, 0]


def test_the_page_needs_viser(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """Its message is all that is said: a traceback is for those who write methods."""
    folder = write_even(tmp_path / "p", ["a"])
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MethodError, match=r"pip install 'graycard\[view\]'"):
        serve_pictures(open_predictions(folder), {}, 8090)
    assert main(["view", str(folder)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("graycard: expected viser, which serves the page")
    assert "Traceback" not in said


def write_even(folder: Path, names: Sequence[str], layers: Mapping[str, str] = MappingProxyType({})) -> Path:
    """Write predictions of one value, 24 x 28: radiance, but for views with a layer of their own."""
    for number, name in enumerate(names):
        values = np.full((24, 28, 3), 0.1 * (number + 1), np.float32)
        write_view(folder, name, {layers.get(name, "radiance"): values})
    finish_predictions(folder, Predictions("even", "dark", "tiny-0000"))
    return folder


def test_predictions_without_views_have_no_page(tmp_path: Path):
    with pytest.raises(MethodError, match="expected predictions with layers to show"):
        serve_pictures(open_predictions(write_even(tmp_path / "p", [])), {}, 8090)


def test_pages_that_cannot_be_served_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = write_even(tmp_path / "p", ["a"])
    for more, message in [
        (["--port", "0"], "Mend --port"),
        (["--port", "65536"], "Mend --port"),
        (["--port", "-1"], "Mend --port"),
        (["--seconds", "-1"], "Mend --seconds"),
        (["--seconds", "nan"], "Mend --seconds"),
    ]:
        assert main(["view", str(folder), *more]) == 2
        assert message in capsys.readouterr().err.replace("\n", " ")


def wait_until(holds: Callable[[], bool], page: Page | None = None) -> None:
    end = time.monotonic() + 60
    while not holds() and time.monotonic() < end:
        page.wait_for_timeout(20) if page else time.sleep(0.02)
    assert holds()


def test_pictures_are_drawn_one_at_a_time_and_only_the_newest_of_those_that_wait():
    """Two pages ask ten times each while a picture is being drawn."""
    turns, gate, drawn = Turns(), threading.Event(), []
    inside, most = [0], [0]

    def job(reader: str, number: int) -> None:
        inside[0] += 1
        most[0] = max(most[0], inside[0])
        gate.wait(60)
        time.sleep(0.002)
        drawn.append((reader, number))
        inside[0] -= 1

    threads = []
    for reader, number in [("a", 0), *((reader, n) for n in range(1, 11) for reader in "ab")]:
        job_of = partial(job, reader, number)
        threads.append(threading.Thread(target=turns.run, args=(reader, job_of)))
        threads[-1].start()
        wait_until(lambda: inside[0] == 1)
        time.sleep(0.005)  # so that they ask in this order
    gate.set()
    for thread in threads:
        thread.join(60)
    assert most == [1]
    assert drawn[0] == ("a", 0)
    assert sorted(drawn[1:]) == [("a", 10), ("b", 10)]


def test_a_picture_may_ask_for_another():
    turns, drawn = Turns(), []

    def outer() -> None:
        turns.run("a", lambda: drawn.append("inner"))
        drawn.append("outer")

    thread = threading.Thread(target=turns.run, args=("a", outer), daemon=True)
    thread.start()
    thread.join(60)
    assert drawn == ["inner", "outer"]


def test_a_picture_that_cannot_be_drawn_ends_its_turn():
    turns, drawn = Turns(), []

    def fail() -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        turns.run("a", fail)
    turns.run("b", lambda: drawn.append("b"))
    assert drawn == ["b"]


@contextmanager
def page_of(server: ViserServer) -> Iterator[Page]:
    """Open the page of a server in Chromium; at the end the server is stopped."""
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=CHROMIUM,
                args=["--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader"],
            )
            page = browser.new_page()
            page.goto(f"http://127.0.0.1:{server.get_port()}")
            page.wait_for_selector("canvas", timeout=60_000)
            yield page
            browser.close()
    finally:
        server.stop()


def choose(page: Page, shown: str, wanted: str) -> None:
    page.locator(f"input[role=combobox][value={shown}]").click(timeout=60_000)
    page.get_by_role("option", name=wanted, exact=True).click(timeout=60_000)


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of websockets, which viser runs on
def test_fitted_surfels_and_their_layers_in_a_browser(saved: Path):
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
    with page_of(serve_fitted(fitted, {"train_000": camera}, 8123)) as page:
        choose(page, "surfels", "normal")
        wait_until(lambda: "normal" in asked, page)


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on this machine")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_views_are_read_when_they_are_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A damaged view that nobody chooses is no fault; the page names it if somebody does."""
    names = [f"view_{number:03d}" for number in range(9)]
    folder = write_even(tmp_path / "p", names, {"view_003": "base_color"})
    (folder / "views" / "view_008.exr").write_bytes(b"broken")
    read: list[str] = []
    layers = Predictions.layers
    monkeypatch.setattr(Predictions, "layers", lambda self, view: read.append(view) or layers(self, view))
    cameras = dict(zip(names, ring(np.eye(3)), strict=False))
    with page_of(serve_pictures(open_predictions(folder), cameras, 8143)) as page:
        assert read == ["view_000"]
        choose(page, "view_000", "view_003")
        page.wait_for_selector("input[role=combobox][value=base_color]", timeout=60_000)
        assert {*read} == {"view_000", "view_003"}
        choose(page, "view_003", "view_008")
        page.wait_for_selector("text=view_008.exr", timeout=60_000)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_verb_serves_predictions_until_it_ends(
    tmp_path: Path, make_scene: Callable[..., Path], capsys: pytest.CaptureFixture[str]
):
    scene = make_scene()
    write_even(tmp_path / "p", [view.name for view in open_capture(scene / "capture").views])
    codes: list[int] = []
    args = ["view", str(tmp_path / "p"), "--scene", str(scene), "--port", "8133", "--seconds", "0.5"]
    thread = threading.Thread(target=lambda: codes.append(main(args)))
    thread.start()
    thread.join(60)
    assert codes == [0]
    assert "view: http://127.0.0.1:" in capsys.readouterr().out
