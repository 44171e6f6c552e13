# SPDX-License-Identifier: Apache-2.0
"""An object is taken out of coloured surfels: which are its, which holes are left, what is painted there."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import Camera, Capture, MethodError, View, look_at, methods, open_capture, open_truth
from graycard.io import silent
from graycard.methods import load_method
from graycard.methods._store import restore, store
from graycard.methods.priors import Override, PriorSpec, make_priors
from graycard.methods.removal import (
    KeepMethod,
    OneReferenceSettings,
    PerViewSettings,
    RemovalMethod,
    RemovalScene,
    RemovalSettings,
)
from graycard.methods.removal._behind import Behind, seen_elsewhere
from graycard.methods.removal._filled import BackgroundPoints, filled_depth, seen_points, targets_of
from graycard.methods.removal._method import wall_surfels
from graycard.methods.removal._target import target_masks, target_surfels, widened
from graycard.methods.splat import Surfels, rasterize, surfels_from_points
from sparse_points import with_points

QUICK = RemovalSettings(iterations=12, surfels=400, fill=0.0)
NAMES = ("do-nothing", "removal", "removal-per-view", "removal-one-reference", "grouping")
HASTY = {"grouping": {"identity_rate": 0.3, "classifier_rate": 0.1}}
"""Settings that learn the owners of surfels in twelve steps."""


def above(x: float, y: float) -> Camera:
    return Camera.from_fov(32, 28, 60, look_at(np.array([x, y, 3.0]), np.array([0.0, 0.0, 0.0])))


def sheets(*places: np.ndarray) -> Surfels:
    """Discs that face up, opaque."""
    points = np.concatenate(places)
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return surfels_from_points(points, up, np.full_like(up, 0.5), opacity=0.99)


def floor_depth(camera: Camera) -> np.ndarray:
    """z-depth of the plane z = 0."""
    rays = camera.rays()
    return np.abs(camera.position[2] / rays[..., 2]) * (rays @ camera.forward)


def grid(half: float, height: float, spacing: float = 0.1) -> np.ndarray:
    steps = np.arange(-half, half + spacing / 2, spacing)
    x, y = np.meshgrid(steps, steps)
    return np.stack([x, y, np.full_like(x, height)], axis=-1).reshape(-1, 3)


def mask_of(surfels: Surfels, chosen: np.ndarray, camera: Camera) -> np.ndarray:
    marked = replace(surfels, features=torch.from_numpy(chosen[:, None].astype(np.float32)))
    return (rasterize(marked, camera).features[..., 0] > 0.5).numpy()


def test_the_objects_surfels_are_those_in_its_masks_and_in_its_hull():
    """A box of a lid and a hidden inside over a floor; a stray surfel far away does not widen its hull."""
    floor, lid, low = grid(1.5, 0.0), grid(0.3, 0.5), grid(0.3, 0.3)
    inside = grid(0.15, 0.4)
    surfels = sheets(floor, lid, low, inside)
    whose = np.repeat([0, 1, 1, 2], [len(floor), len(lid), len(low), len(inside)])
    cameras = [above(*place) for place in ((0.9, 0.0), (-0.9, 0.3), (0.1, -0.8))]
    masks = [mask_of(surfels, whose > 0, camera) for camera in cameras]
    found = target_surfels(surfels, cameras, masks, 0.3).numpy()
    assert found[whose == 1].mean() > 0.9
    assert found[whose == 2].all(), "no view sees them"
    places = [camera.project(surfels.centres.numpy())[0].astype(int).T for camera in cameras]
    seen = [m[y.clip(0, 27), x.clip(0, 31)] for m, (x, y) in zip(masks, places, strict=True)]
    beside = (whose == 0) & ~np.any(seen, axis=0)
    assert beside.sum() > 500
    assert found[beside].mean() < 0.01


def test_a_flat_object_has_no_hull():
    floor, board = grid(1.0, 0.0), grid(0.3, 0.5)
    surfels = sheets(floor, board)
    whose = np.repeat([False, True], [len(floor), len(board)])
    camera = above(0.0, 1e-3)
    found = target_surfels(surfels, [camera], [mask_of(surfels, whose, camera)], 0.3).numpy()
    assert found[whose].all()
    for mask, says in ((np.zeros((28, 32), bool), "got none"), (np.ones((28, 32), bool), "got all")):
        with pytest.raises(MethodError, match=says):
            target_surfels(surfels, [camera], [mask], 0.3)


def test_a_thin_object_keeps_the_part_on_top_of_it():
    """Nine tenths of its surfels lie in one plane: the hull goes up to the knob."""
    floor, lid, knob, hidden = grid(1.5, 0.0), grid(0.5, 0.3), grid(0.05, 0.5), grid(0.01, 0.4)
    surfels = sheets(floor, lid, knob, hidden)
    whose = np.repeat([0, 1, 1, 2], [len(floor), len(lid), len(knob), len(hidden)])
    cameras = [above(*place) for place in ((0.9, 0.0), (-0.9, 0.3), (0.1, -0.8))]
    masks = [mask_of(surfels, whose > 0, camera) for camera in cameras]
    assert target_surfels(surfels, cameras, masks, 0.3).numpy()[whose == 2].all()


def test_what_another_view_sees_is_no_hole():
    """A floor; another view sees it, or doubts what it sees, or has something in the way."""
    camera, other = above(0.0, 1e-3), above(0.3, 1e-3)
    depth, its_depth = floor_depth(camera), floor_depth(other)
    where = np.zeros((28, 32), bool)
    where[8:20, 10:22] = True
    nothing = np.zeros_like(where)
    np.testing.assert_array_equal(seen_elsewhere(camera, depth, where, [(other, its_depth, nothing)]), where)
    assert not seen_elsewhere(camera, depth, where, [(other, its_depth, ~nothing)]).any(), "all in doubt"
    assert not seen_elsewhere(camera, depth, where, [(other, 0.5 * its_depth, nothing)]).any(), "hidden"
    assert not seen_elsewhere(camera, depth, where, [(other, 2 * its_depth, nothing)]).any(), "not there"
    blind = np.full_like(its_depth, np.inf)
    assert not seen_elsewhere(camera, depth, where, [(other, blind, nothing)]).any(), "nothing is seen"
    assert not seen_elsewhere(camera, np.full_like(depth, np.inf), where, [(other, its_depth, nothing)]).any()
    assert not seen_elsewhere(camera, depth, where, []).any()


def test_masks_are_widened_by_a_share_of_the_width():
    mask = np.zeros((40, 50), bool)
    mask[20, 25] = True
    assert widened(mask, 0.04).sum() == 13  # a disc of radius 2
    np.testing.assert_array_equal(widened(mask, 0.0), mask)
    assert not widened(~np.ones_like(mask), 0.04).any()


def test_the_depth_of_a_hole_in_a_plane_is_that_of_the_plane():
    depth = floor_depth(above(0.7, -0.9))
    hole = np.zeros((28, 32), bool)
    hole[9:19, 12:24] = True
    broken = np.where(hole, 9.0, depth)
    np.testing.assert_allclose(filled_depth(broken, hole), depth, rtol=1e-4)
    assert np.isinf(filled_depth(np.full_like(depth, np.inf), hole)).all()


def test_a_hole_before_the_sky_is_filled_from_what_is_beside_it():
    """The upper half is sky: the surface goes on into the hole and does not run away to infinity."""
    depth, hole = np.full((20, 24), 3.0), np.zeros((20, 24), bool)
    depth[:10], hole[6:16, 8:16] = np.inf, True
    filled = filled_depth(depth, hole)
    np.testing.assert_allclose(filled[hole], 3.0, rtol=1e-3)
    assert np.isinf(filled[:6]).all()
    alone = np.zeros_like(hole)
    alone[2:4, 2:4] = True
    both = filled_depth(depth, hole | alone)
    assert np.isinf(both[alone]).all(), "a part of the hole with the sky all around"
    np.testing.assert_allclose(both[hole], 3.0, rtol=1e-3)


class Painter:
    """It fills every hole with the number of the view in its name."""

    def answer(self, question: methods.Question) -> np.ndarray:
        return np.full_like(question.image, float(question.view.name))


def behind_of(holes: list[tuple[int, int]]) -> list[Behind]:
    """Views of one floor from above, each with a hole of some rows and columns around its middle."""
    found = []
    for number, (rows, columns) in enumerate(holes):
        camera = above(0.02 * number, 1e-3)
        hole = np.zeros((28, 32), bool)
        hole[14 - rows : 14 + rows, 16 - columns : 16 + columns] = True
        view = View(str(number), "train", camera)
        found.append(Behind(view, hole, hole, np.full((28, 32, 3), 9.0), floor_depth(camera)))
    return found


def test_views_are_filled_each_for_itself_or_told_by_those_with_the_largest_holes():
    priors = methods.Priors("classical", models={"inpainting": Painter()})
    behind = behind_of([(2, 2), (6, 6), (0, 0), (4, 4)])
    each, wall = targets_of(behind, priors, 0)
    for number, target in enumerate(each):
        np.testing.assert_array_equal(target.known, behind[number].hole)
        assert (target.picture[target.known] == number).all()
    assert len(wall.points) == 16 + 144 + 64
    one, wall = targets_of(behind, priors, 1)
    assert len(wall.points) == 144
    np.testing.assert_allclose(wall.points[:, 2], 0, atol=1e-3)
    for number in (0, 1, 3):
        inside = one[number].known
        assert (one[number].picture[inside] == 1).all(), "as view 1 has it"
        assert inside.sum() > 0.8 * behind[number].hole.sum()
        assert not (inside & ~behind[number].hole).any()
    assert not one[2].known.any()
    two, _ = targets_of(behind, priors, 2)
    assert (two[3].picture[two[3].known] == 3).all()
    none, wall = targets_of(behind_of([(0, 0), (0, 0)]), priors, 3)
    assert not any(target.known.any() for target in none)
    assert len(wall.points) == 0


def test_points_are_seen_in_their_pixels_the_nearest_first():
    camera = above(0.0, 1e-3)
    points = np.array([[0.05, 0.05, z] for z in (0.0, 1.0, 9.0)] + [[9.0, 0.0, 0.0], [0.6, 0.0, 0.0]])
    rows, columns, nearest = seen_points(camera, points)
    assert sorted(nearest) == [1, 4], "one hides another, one is behind the camera, one is out of the picture"
    (x, y), _ = camera.project(points[1])
    place = int(np.flatnonzero(nearest == 1)[0])
    assert (rows[place], columns[place]) == (int(y), int(x))


@pytest.fixture(scope="module")
def scene(write_tiny: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_tiny(tmp_path_factory.mktemp("removal"), track="tabletop", train=4, test=1)
    with_points(folder)
    return folder


def told(scene: Path, asks: tuple[methods.Ask, ...], spec: PriorSpec) -> methods.Priors:
    capture, truth = open_capture(scene / "capture", check=False), open_truth(scene / "truth")
    known = {view.name: truth.layers(truth.view(view.name)) for view in capture.train}
    return make_priors(spec, asks, capture, known, ())


@pytest.mark.parametrize("name", NAMES)
def test_the_whole_way(scene: Path, name: str, tmp_path: Path):
    """Everything is provided, finite, saved and loaded, and the same again."""
    capture = open_capture(scene / "capture", check=False)
    method = load_method(name)
    quick = {"iterations": 12, "surfels": 400, "fill": 0.0}
    settings = methods.settings_of(method, quick | HASTY.get(name, {}))
    asks = methods.asks_of(method)
    priors = told(scene, asks, PriorSpec("oracle", 1) if asks else PriorSpec())
    found = method.fit(capture, priors, settings, 0, silent)
    assert isinstance(found, RemovalScene)
    assert isinstance(found, methods.Removable)
    camera, target = capture.test[0].camera, capture.target
    assert target is not None
    with_object, without = (
        found.render(camera, ["radiance"]),
        found.remove(target).render(camera, ["radiance"]),
    )
    assert np.isfinite(without["radiance"]).all()
    assert np.array_equal(with_object["radiance"], without["radiance"]) is (name == "do-nothing")
    second = method.fit(capture, priors, settings, 0, silent)
    assert isinstance(second, RemovalScene)
    again = second.remove(target).render(camera, ["radiance"])
    np.testing.assert_array_equal(again["radiance"], without["radiance"])
    found.save(tmp_path / "d")
    loaded = method.load(tmp_path / "d")
    assert isinstance(loaded, RemovalScene)
    np.testing.assert_array_equal(
        loaded.remove(target).render(camera, ["radiance"])["radiance"], without["radiance"]
    )
    with pytest.raises(MethodError, match=r"expected the object that was fitted \(3\), got 2"):
        found.remove(2)
    facts, arrays = restore(tmp_path / "d", name)
    spoilt = {key: np.where(key.startswith("after/"), np.nan, values) for key, values in arrays.items()}
    store(
        tmp_path / "d", name, facts, {key: values.astype(arrays[key].dtype) for key, values in spoilt.items()}
    )
    with pytest.raises(MethodError, match="expected a whole decomposition in .* to be finite"):
        method.load(tmp_path / "d")


def test_they_differ_in_how_many_views_are_inpainted(scene: Path):
    """One, those that are asked for, or each that has a hole."""
    capture, found = open_capture(scene / "capture", check=False), {}

    class Asked:
        def __init__(self, painter: methods.PriorModel) -> None:
            self.painter, self.views = painter, set()

        def answer(self, question: methods.Question) -> np.ndarray:
            self.views.add(question.view.name)
            return self.painter.answer(question)

    for name in ("removal-one-reference", "removal", "removal-per-view", "grouping"):
        method = load_method(name)
        quick = {"iterations": 12, "surfels": 400, "fill": 0.0} | HASTY.get(name, {})
        quick |= {"references": 2} if name == "removal" else {}
        priors = told(scene, methods.asks_of(method), PriorSpec("oracle", 1))
        asked = Asked(priors.models["inpainting"])
        told_so = replace(priors, models={"inpainting": asked})
        method.fit(capture, told_so, methods.settings_of(method, quick), 0, silent)
        found[name] = len(asked.views)
    assert found == {"removal-one-reference": 1, "removal": 2, "removal-per-view": 4, "grouping": 4}


def test_the_scene_with_its_object_is_that_of_the_first_stage(scene: Path):
    """The second stage changes nothing of it, the sky included."""
    capture = open_capture(scene / "capture", check=False)
    priors = told(scene, RemovalMethod.asks, PriorSpec("oracle", 0))
    found = RemovalMethod().fit(capture, priors, QUICK, 0, silent)
    kept = KeepMethod().fit(capture, methods.Priors(), QUICK, 0, silent)
    for name in kept.provides:
        camera = capture.test[0].camera
        np.testing.assert_array_equal(found.render(camera, [name])[name], kept.render(camera, [name])[name])


def test_all_share_the_first_stage_with_2dgs(scene: Path, tmp_path: Path):
    """They share it by files in a folder, with the same bits as alone."""
    capture, doing = open_capture(scene / "capture", check=False), []
    quick = {"iterations": 12, "surfels": 400, "fill": 0.0}
    saving = quick | {"checkpoint": f"{tmp_path}/"}
    plain = load_method("2dgs")
    plain.fit(capture, methods.Priors(), methods.settings_of(plain, saving), 0, silent)
    for name in ("do-nothing", "removal", "removal-per-view", "removal-one-reference"):
        method, asks = load_method(name), methods.asks_of(load_method(name))
        priors = told(scene, asks, PriorSpec("oracle", 0)) if asks else methods.Priors()
        alone, shared = (methods.settings_of(method, chosen) for chosen in (quick, saving))
        doing.clear()
        found = method.fit(capture, priors, shared, 0, lambda done, _: doing.append(done))
        assert len(doing) == (0 if name == "do-nothing" else RemovalSettings(**quick).second_steps)
        expected = method.fit(capture, priors, alone, 0, silent)
        assert isinstance(found, RemovalScene)
        assert isinstance(expected, RemovalScene)
        for part, values in expected.after.parameters.all.items():
            assert torch.equal(values, found.after.parameters.all[part]), (name, part)


def test_it_gets_nearer_to_the_scene_without_the_object(scene: Path):
    """Pixels of the object are half as far as with it from the true background."""
    capture, truth = open_capture(scene / "capture", check=False), open_truth(scene / "truth")
    priors = told(scene, RemovalMethod.asks, PriorSpec("oracle", 0))
    settings = replace(QUICK, iterations=150, second_share=0.5)
    found = RemovalMethod().fit(capture, priors, settings, 0, silent)
    kept = KeepMethod().fit(capture, priors, settings, 0, silent)
    view = capture.train[1]
    layers = truth.layers(truth.view(view.name))
    footprint, true = layers["object_id"] == 3, layers["counterfactual.radiance"]
    assert footprint.sum() > 10
    pictures = [s.remove(3).render(view.camera, ["radiance"])["radiance"] for s in (found, kept)]
    without, with_object = (float(np.abs(p - true)[footprint].mean()) for p in pictures)
    assert without < 0.5 * with_object


def test_captures_that_name_no_object_or_show_it_wrongly_are_refused(
    scene: Path, make_scene: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
):
    with pytest.raises(MethodError, match="expected a capture that names an object to remove"):
        target_masks(open_capture(make_scene() / "capture"))
    capture = open_capture(scene / "capture", check=False)
    cases = {
        "expected the mask of view .* of shape": np.ones((3, 4), bool),
        "got one of the whole picture": np.ones((24, 28), bool),
        "got empty masks only": np.zeros((24, 28), bool),
    }
    started: list[float] = []
    for says, mask in cases.items():
        monkeypatch.setattr(Capture, "target_mask", lambda self, view, mask=mask: mask)
        for name in NAMES:
            method = load_method(name)
            with pytest.raises(MethodError, match=says):
                method.fit(
                    capture, methods.Priors(), method.settings_type(), 0, lambda done, _: started.append(done)
                )
    assert not started


@pytest.mark.parametrize("name", [name for name in NAMES if name != "do-nothing"])
def test_without_a_painter_nothing_is_fitted(scene: Path, name: str):
    capture, method = open_capture(scene / "capture", check=False), load_method(name)
    started: list[float] = []
    with pytest.raises(MethodError, match="expected a prior that gives inpainting"):
        method.fit(capture, methods.Priors(), method.settings_type(), 0, lambda done, _: started.append(done))
    assert not started


@pytest.mark.parametrize("name", ["removal", "grouping"])
def test_who_says_where_the_object_is_is_a_setting(scene: Path, name: str):
    """A prior that is exact says what the capture does; one that is wrong something else."""
    capture, method = open_capture(scene / "capture", check=False), load_method(name)
    quick = {"iterations": 12, "surfels": 400, "fill": 0.0} | HASTY.get(name, {})
    exact, wrong = (
        told(scene, methods.asks_of(method), PriorSpec("oracle", 0, overrides={"mask": Override(severity=n)}))
        for n in (0, 5)
    )

    def picture(priors: methods.Priors, masks: str) -> np.ndarray:
        settings = methods.settings_of(method, quick | {"object_masks": masks})
        found = method.fit(capture, priors, settings, 0, silent)
        assert isinstance(found, RemovalScene)
        return found.remove(3).render(capture.test[0].camera, ["radiance"])["radiance"]

    granted = picture(exact, "capture")
    np.testing.assert_array_equal(picture(exact, "prior"), granted)
    np.testing.assert_array_equal(picture(wrong, "capture"), granted)
    assert not np.array_equal(picture(wrong, "prior"), granted)


def test_settings_that_cannot_be_are_refused():
    wrong = {"references": -1, "second_share": 0.0, "least_inside": 0.0, "grow": 0.5, "hole_weight": -1.0}
    for name, value in wrong.items():
        with pytest.raises(ValueError, match="expected"):
            RemovalSettings(**{name: value})  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="expected 1 or more iterations"):
        RemovalSettings(iterations=0)
    for settings in (PerViewSettings, OneReferenceSettings):
        with pytest.raises(ValueError, match="the method with any number is 'removal'"):
            settings(references=3)


def test_a_point_alone_gets_no_disc_that_hides_what_is_around_it():
    """At the border of a hole one pixel may show a floor far behind, with nothing next to it."""
    near = grid(0.5, 0.0)
    points = np.concatenate([near, [[0.0, 2.0, -2.0]]])
    distances = np.full(len(points), 1.5)
    distances[-1] = 3.0
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    wall = BackgroundPoints(points, up, np.full_like(points, 0.5), distances)
    features = np.arange(2.0 * len(points)).reshape(-1, 2)
    found = wall_surfels(100, 1000, wall, features, QUICK, 0)
    assert found is not None
    size = found.scales.amax(dim=1).numpy()
    alone = int(found.centres[:, 2].argmin())
    assert size[alone] == pytest.approx(2 * 2 * np.median(size), rel=0.01), (
        "twice as far, twice as large again"
    )
    assert np.delete(size, alone).max() < 1.5 * np.median(size)
    places = {tuple(place): row for place, row in zip(points.round(4).tolist(), features, strict=True)}
    for place, row in zip(found.centres.double().numpy().round(4).tolist(), found.features, strict=True):
        np.testing.assert_allclose(row, places[tuple(place)], rtol=1e-6)
