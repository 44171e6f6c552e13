# SPDX-License-Identifier: Apache-2.0
"""``goris`` on captures: the whole way, what is painted where, and what it says of itself."""

import functools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch
from scipy.ndimage import maximum_filter

from glossy_captures import QUICK, UNTOLD, NothingGlossy, told
from glossy_rooms import Painter, knowing, removed_from, write_room
from glossy_sheets import (
    EXTENT,
    FLOOR,
    OBJECT,
    SETTINGS,
    GlossyWorld,
    glossy_world,
    shots_of_world,
    with_settings,
)
from graycard import Camera, Capture, MethodError, View, look_at, methods, open_capture
from graycard.io import silent
from graycard.layers import find_fault
from graycard.methods.goris import GlossyScene, GorisMethod, GorisScene, GorisSettings, _fit, _method, _remove
from graycard.methods.goris._distil import cameras_between, distilled
from graycard.methods.goris._fit import FittedLight, light_rates, with_light
from graycard.methods.goris._flat import FlatSurface
from graycard.methods.goris._model import (
    DIFFUSE,
    FRESNEL,
    LABEL,
    REGION,
    ROUGHNESS,
    SURROUNDINGS,
    drawn_buffers,
)
from graycard.methods.goris._objective import surface_loss
from graycard.methods.goris._remove import (
    RemovalObjective,
    _effects,
    _removal_target,
    next_to_object,
    with_painted_wall,
)
from graycard.methods.goris._scene import LAYERS, _scattered
from graycard.methods.goris._training_views import TrainingView
from graycard.methods.priors import PriorSpec
from graycard.methods.removal import BackgroundPoints, Target
from graycard.methods.removal._behind import Behind
from graycard.methods.splat import CENTRES, SH_DC, LearningRateSchedule
from graycard.methods.surfels import COEFFICIENTS, DETAIL, SurfelScene, plane_depth, srgb_decode_tensor


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


SLOW = functools.partial(pytest.param, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        SLOW({"composite": "paper", "filter": "release", "decay": "linear"}),
        {"transport": False},
        SLOW({"material_inpainting": False, "effect_mask": False, "filter": "none"}),
        {"distilled": True},
    ],
    ids=lambda changes: "-".join(changes) or "default",
)
def test_the_whole_way(scene: Path, changes: dict[str, object], tmp_path: Path):
    """Everything is provided, finite, saved and loaded, and the same again."""
    capture = open_capture(scene / "capture", check=False)
    priors, method = told(scene, PriorSpec("oracle", 1, overrides=UNTOLD)), GorisMethod()
    settings = replace(QUICK, **changes)  # pyright: ignore[reportArgumentType]
    found = method.fit(capture, priors, settings, 0, silent)
    assert isinstance(found, methods.Removable)
    camera = capture.test[0].camera
    layers = found.render(camera, sorted(found.provides))
    assert set(layers) == LAYERS
    for name, image in layers.items():
        assert find_fault(name, image, camera.height, camera.width) is None
    without = found.remove(3).render(camera, ["radiance"])["radiance"]
    assert np.isfinite(without).all()
    assert not np.array_equal(without, layers["radiance"])
    again = method.fit(capture, priors, settings, 0, silent)
    np.testing.assert_array_equal(again.remove(3).render(camera, ["radiance"])["radiance"], without)
    found.save(tmp_path / "d")
    loaded = method.load(tmp_path / "d")
    np.testing.assert_array_equal(loaded.remove(3).render(camera, ["radiance"])["radiance"], without)
    np.testing.assert_array_equal(loaded.render(camera, ["specular"])["specular"], layers["specular"])
    assert (loaded.distilled is not None) is settings.distilled
    assert loaded.remove(3).provides == ({"radiance"} if settings.distilled else LAYERS)
    assert set(loaded.changed) == {view.name for view in capture.train}
    for view in capture.train:
        masks, ours = loaded.changed[view.name], found.changed[view.name]
        np.testing.assert_array_equal(masks.doubted, ours.doubted)
        np.testing.assert_array_equal(masks.unseen, ours.unseen)
        assert masks.doubted[capture.target_mask(view)].all()
        assert masks.doubted[masks.unseen].all()
    assert any(masks.unseen.any() for masks in loaded.changed.values())
    with pytest.raises(MethodError, match=r"expected the object that was fitted \(3\), got 2"):
        found.remove(2)


def test_priors_that_know_more_are_asked(scene: Path):
    """With a mask and normals; where nothing is glossy all steps are in colours, and nothing reflects."""
    capture = open_capture(scene / "capture", check=False)
    known = told(scene, PriorSpec("classical"))
    models = {**known.models, "mask": NothingGlossy(), "normal": NothingGlossy()}
    found = GorisMethod().fit(capture, replace(known, models=models), QUICK, 0, silent)
    layers = found.render(capture.test[0].camera, ["glossy", "specular"])
    assert float(layers["glossy"].max()) == float(layers["specular"].max()) == 0
    assert (found.before.settings.light_steps, QUICK.light_steps > 0) == (0, True)
    priors, divided = replace(known, models=models), replace(QUICK, matte_in_colours=False)
    found = GorisMethod().fit(capture, priors, divided, 0, silent)
    assert found.before.settings.light_steps == QUICK.light_steps
    assert float(found.render(capture.test[0].camera, ["glossy"])["glossy"].max()) < 0.1


def test_bad_input_is_refused_before_any_fit(
    scene: Path, make_scene: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
):
    method, started = GorisMethod(), []

    def progress(share: float, doing: str) -> None:
        started.append(doing)

    without = open_capture(make_scene() / "capture")
    with pytest.raises(MethodError, match="expected a capture that names an object to remove"):
        method.fit(without, methods.Priors(), QUICK, 0, progress)
    capture = open_capture(scene / "capture", check=False)
    cases = {
        "expected the mask of view .* of shape": np.ones((3, 4), bool),
        "got one of the whole picture": np.ones((24, 28), bool),
        "got empty masks only": np.zeros((24, 28), bool),
    }
    for says, mask in cases.items():
        monkeypatch.setattr(Capture, "target_mask", lambda self, view, mask=mask: mask)
        with pytest.raises(MethodError, match=says):
            method.fit(capture, methods.Priors(), QUICK, 0, progress)
    monkeypatch.undo()
    with pytest.raises(MethodError, match="expected a prior that gives inpainting"):
        method.fit(capture, methods.Priors(), QUICK, 0, progress)
    assert not started


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("radiance_share", 0.0, r"expected radiance_share in \(0, 1\], got 0"),
        ("radiance_share", 1.1, r"expected radiance_share in \(0, 1\], got 1.1"),
        ("decay_share", 0.0, r"expected decay_share in \(0, 1\)"),
        ("least_effect", 1.5, r"expected least_effect in \(0, 1\)"),
        ("traced_degree", 4, "expected traced_degree from 0 to that of the colours"),
        ("sky_size", 0, "and sky_size from 1 to 256"),
        ("sky_size", 257, "and sky_size from 1 to 256"),
        ("near", -0.1, r"expected near in \[0, 1\)"),
        ("least_normal_prior_weight", 0.0, "expected least_normal_prior_weight above 0"),
        ("smooth_weight", -1.0, "expected finite weights of 0 or more"),
        ("sky_weight", np.inf, "expected finite weights of 0 or more"),
        ("weights", np.nan, "expected finite weights of 0 or more"),
        ("hole_weight", np.nan, "expected a finite hole_weight of 0 or more"),
        ("radiance_share", 1.0, "expected steps with light transport, got none"),
    ],
)
def test_settings_that_cannot_be_are_refused(name: str, value: float, says: str):
    with pytest.raises(ValueError, match=says):
        GorisSettings(**{name: value})  # pyright: ignore[reportArgumentType]


def test_surfels_begin_as_masks_say(world: GlossyWorld):
    """Regions and labels are shares of what photographs show of a surfel; 1 is rough."""
    shots = shots_of_world(world)
    found = with_light(world.parameters, shots, SETTINGS, 0).surfels
    rough, label = found[REGION][:, 0].sigmoid(), found[LABEL][:, 0].sigmoid()
    true_rough, true_label = (world.parameters.surfels[n][:, 0].sigmoid() for n in (REGION, LABEL))
    middle = (world.parameters.surfels["centres"][:, :2].abs() < 0.6).all(dim=1)  # what views see
    assert float((rough[middle & (true_rough < 0.5)] < 0.5).float().mean()) > 0.8
    assert float((rough[true_rough > 0.5] > 0.5).float().mean()) > 0.9
    assert float((label[true_label > 0.5] > 0.5).float().mean()) > 0.9
    assert float((label[true_label < 0.5] < 0.5).float().mean()) > 0.95
    untold = with_light(world.parameters, [replace(s, told=False) for s in shots], SETTINGS, 0)
    torch.testing.assert_close(
        untold.surfels[REGION].sigmoid(), torch.full_like(found[REGION], 0.9), atol=1e-5, rtol=0
    )


def test_photographs_are_in_doubt_where_they_show_the_object_by_reflection(world: GlossyWorld):
    """Nearly all such pixels are glossy, and there are some in every view; none at a high limit."""
    shots = shots_of_world(world)
    found = _effects(world.parameters.all, shots, with_settings(least_effect=0.1), EXTENT)
    for shot, effect in zip(shots, found, strict=True):
        assert (shot.glossy.numpy()[effect] > 0.5).mean() > 0.9
    assert min(int(effect.sum()) for effect in found) > 10
    none = _effects(world.parameters.all, shots, with_settings(least_effect=0.99), EXTENT)
    assert not any(effect.any() for effect in none)


def test_new_surfels_are_as_they_were_painted(world: GlossyWorld):
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (60, 3)) * [1, 1, 0]
    layers = {
        "diffuse": np.tile([0.2, 0.1, 0.05], (60, 1)),
        "f0": np.tile([0.7, 0.6, 0.5], (60, 1)),
        "roughness": np.full(60, 0.4),
        "glossy": np.full(60, 0.95),
        "normal": np.tile([0.0, 0.0, 1.0], (60, 1)),
    }
    up = np.tile([0.0, 0.0, 1.0], (60, 1))
    wall = BackgroundPoints(points, up, np.full((60, 3), 0.3), np.ones(60), layers)
    before = len(world.parameters)
    found = with_painted_wall(world.parameters, 60, wall, SETTINGS, 0).surfels
    assert len(found[REGION]) == before + 60
    new = {name: values[before:].sigmoid() for name, values in found.items()}
    torch.testing.assert_close(new[FRESNEL], torch.tensor([0.7, 0.6, 0.5]).expand(60, 3))
    torch.testing.assert_close(new[ROUGHNESS], torch.full((60, 1), 0.4))
    torch.testing.assert_close(new[REGION], torch.full((60, 1), 0.05))
    torch.testing.assert_close(
        srgb_decode_tensor(1.5 * new[DIFFUSE]),
        torch.tensor([0.2, 0.1, 0.05]).expand(60, 3),
        atol=1e-4,
        rtol=1e-3,
    )
    coloured = with_painted_wall(world.parameters, 60, replace(wall, layers={}), SETTINGS, 0).surfels
    assert (coloured[REGION][before:].sigmoid() > 0.99).all(), "painted in colours: rough"
    nothing = BackgroundPoints(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    assert with_painted_wall(world.parameters, 0, nothing, SETTINGS, 0) is world.parameters


def target_of(world: GlossyWorld, glossy: float) -> Target:
    """The first view, its hole painted grey and of one material."""
    shape, hole = (36, 44), np.zeros((36, 44), bool)
    hole[20:28, 10:30] = True
    layers = {
        "diffuse": np.full((*shape, 3), 0.2),
        "f0": np.full((*shape, 3), 0.5),
        "roughness": np.full(shape, 0.3),
        "glossy": np.full(shape, glossy),
        "normal": np.tile([0.0, 0.0, 2.0], (*shape, 1)),
    }
    view = View("0", "train", world.cameras[0])
    behind = Behind(view, hole, hole, np.full((*shape, 3), 0.3), np.ones(shape), layers)
    return Target(behind, behind.picture, hole, layers)


def test_holes_are_held_to_colours_where_they_are_rough_and_to_materials_elsewhere(world: GlossyWorld):
    """Polarity: what moves when the painted region is glossy, and when it is rough."""
    shots = shots_of_world(world)[:1]
    for glossy, moves, stays in ((1.0, "f0", "encoded"), (0.0, "encoded", "f0")):
        target = target_of(world, glossy)
        aim = _removal_target(target)
        assert float(aim.glossy.sum()) == glossy * 160
        assert float(aim.rough.sum()) == (1 - glossy) * 160
        assert float(aim.kept.sum()) == 36 * 44 - 160
        assert torch.allclose(aim.layers["normal"].norm(dim=-1), torch.ones(36, 44))

        def loss(aim=aim) -> float:
            alone = replace(aim, kept=torch.zeros(36, 44))  # SSIM of what is kept looks into holes
            objective = RemovalObjective(shots, [alone], SETTINGS, EXTENT, 0)
            return float(objective(world.parameters.all, 0).loss.detach())

        other = {
            "f0": replace(aim, layers={**aim.layers, "f0": aim.layers["f0"] + 0.3}),
            "encoded": replace(aim, encoded=aim.encoded + 0.3),
        }
        assert abs(loss(other[moves]) - loss()) > 1e-4
        assert loss(other[stays]) == pytest.approx(loss(), abs=1e-7)


def test_photographs_count_where_they_are_believed(world: GlossyWorld):
    """Brighter surfels cost more there, and nothing where photographs are in doubt."""
    shots = shots_of_world(world)[:1]
    aim = replace(_removal_target(target_of(world, 1.0)), glossy=torch.zeros(36, 44), kept=torch.ones(36, 44))
    objective = RemovalObjective(shots, [aim], SETTINGS, EXTENT, 0)
    at_truth = float(objective(world.parameters.all, 0).loss.detach())
    brighter = world.changed(**{DIFFUSE: world.parameters.all[DIFFUSE] + 0.5})
    assert float(objective(brighter, 0).loss.detach()) > at_truth + 1e-3
    doubted = RemovalObjective(shots, [replace(aim, kept=torch.zeros(36, 44))], SETTINGS, EXTENT, 0)
    change = float(doubted(brighter, 0).loss.detach()) - float(doubted(world.parameters.all, 0).loss.detach())
    assert change == pytest.approx(0.0, abs=1e-6), "nothing of a photograph that is not believed counts"


def test_the_object_in_a_photograph_says_nothing_to_what_is_beside_it(world: GlossyWorld):
    """SSIM looks at windows: the photograph in doubt must not be in any."""
    shots, target = shots_of_world(world)[:1], target_of(world, 1.0)
    aim, doubt = _removal_target(target), torch.from_numpy(target.behind.doubt)[..., None]
    view = shots[0].photograph
    other = replace(view, encoded=torch.where(doubt, 1 - view.encoded, view.encoded))
    values = {**world.parameters.all, DIFFUSE: world.parameters.all[DIFFUSE].clone().requires_grad_()}
    gradients = []
    for photograph in (view, other):
        objective = RemovalObjective([replace(shots[0], photograph=photograph)], [aim], SETTINGS, EXTENT, 0)
        (found,) = torch.autograd.grad(objective(values, 0).loss, values[DIFFUSE])
        gradients.append(found)
    assert torch.equal(*gradients)


@pytest.fixture(scope="module")
def room(world: GlossyWorld, tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_room(world, tmp_path_factory.mktemp("room"))


def test_a_mirror_begins_on_the_plane_that_was_found_and_nothing_else_is_one(
    world: GlossyWorld, room: Capture, monkeypatch: pytest.MonkeyPatch
):
    """The whole way as it is judged, with a plane above the floor and no mirror in the left of pictures."""
    plane, left = np.array([0.0, 0.0, 1.0, -0.2]), np.arange(36 * 44).reshape(36, 44) % 44 < 22

    def found(shots: list[TrainingView], points: np.ndarray) -> FlatSurface:
        depths = [np.where(left, np.nan, plane_depth(one.photograph.camera, plane)) for one in shots]
        return FlatSurface([~left & (one.glossy.numpy() > 0.5) for one in shots], depths, plane[:3])

    monkeypatch.setattr(_method, "flat_surface", found)
    settings = GorisSettings(iterations=16, surfels=1000, fill=0.9, sky_size=2)
    scene = GorisMethod().fit(room, knowing(world, room), settings, 0, silent)
    glossy = torch.stack(
        [
            torch.from_numpy(scene.render(view.camera, ["glossy"])["glossy"].copy()).float()
            for view in room.train
        ]
    ).mean(dim=0)
    assert float(glossy[:, 30:].mean()) > 3 * float(glossy[:, :14].mean())
    surfels = scene.before.parameters.surfels
    heights = surfels[CENTRES][surfels[REGION][:, 0] < 0, 2]
    assert len(heights) > 50
    assert float(((heights - 0.2).abs() < 0.03).float().mean()) > 0.7


@pytest.mark.parametrize(("name", "module"), [("flat_start", _method), ("first_light", _fit)])
def test_what_is_switched_off_is_not_looked_for(
    world: GlossyWorld, room: Capture, monkeypatch: pytest.MonkeyPatch, name: str, module: ModuleType
):
    """Flat surfaces, and what photographs allow light to begin with."""
    asked: list[str] = []
    looks = "flat_surface" if name == "flat_start" else "initial_light"
    monkeypatch.setattr(module, looks, lambda *_: asked.append(name))
    settings = GorisSettings(iterations=8, surfels=600, sky_size=2)
    for switch in (True, False):
        changed = replace(settings, **{name: switch})  # pyright: ignore[reportArgumentType]
        GorisMethod().fit(room, knowing(world, room), changed, 0, silent)
        assert len(asked) == 1


@dataclass
class Asked:
    """Passes on what it is asked."""

    painter: Painter
    layers: set[str] = field(default_factory=set)
    views: set[str] = field(default_factory=set)

    def answer(self, question: methods.Question) -> np.ndarray:
        self.layers.add(question.of)
        self.views.add(question.view.name)
        return self.painter.answer(question)


def test_holes_are_inpainted_as_materials_and_in_reference_views_as_settings_say(
    world: GlossyWorld, room: Capture
):
    found = []
    for changes in ({}, {"material_inpainting": False}, {"references": 1}, {"references": 0}):
        asked, settings = Asked(Painter(world)), with_settings(**{"iterations": 4, "references": 2} | changes)
        priors = methods.Priors(models={"inpainting": asked})
        removed_from(world, room, priors, settings)
        found.append((len(asked.views), asked.layers))
    materials = {"diffuse", "f0", "roughness", "glossy", "normal"}
    assert [views for views, _ in found] == [2, 2, 1, 4]
    assert [bool(materials & layers) for _, layers in found] == [True, False, True, True]
    assert materials <= found[0][1]


def test_one_mask_for_the_object_and_for_what_is_glossy_is_refused(world: GlossyWorld, room: Capture):
    """A network that is not told which is asked gives such masks: nothing would be glossy."""

    class Same:
        def answer(self, question: methods.Question) -> np.ndarray:
            return room.target_mask(question.view)

    known = knowing(world, room)
    priors = replace(known, models={**known.models, "mask": Same()})
    with pytest.raises(MethodError, match="expected two answers of the prior for masks in train_000"):
        GorisMethod().fit(room, priors, replace(QUICK, object_masks="prior"), 0, silent)


def test_a_fit_without_points_says_so(world: GlossyWorld, tmp_path: Path):
    """Also where priors tell a flat mirror, which is looked for between the points."""
    room = write_room(world, tmp_path)
    (tmp_path / "points.ply").unlink()
    room = open_capture(tmp_path, check=False)
    with pytest.raises(MethodError, match="expected 4 or more sparse points in the capture of room, got 0"):
        GorisMethod().fit(room, knowing(world, room), QUICK, 0, silent)


def test_without_light_a_picture_is_its_colours_however_pixels_are_mixed(world: GlossyWorld):
    """Nothing has fitted mixtures of colours if all steps were in colours."""
    pictures = []
    for composite in ("release", "paper"):
        settings = with_settings(composite=composite, transport=False, radiance_share=1.0)
        scene = GlossyScene(world.parameters, settings, 1.0, EXTENT)
        pictures.append(scene.render(world.cameras[0], ["radiance"])["radiance"])
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize(
    ("loss", "mirror", "wrong"), [("both", 0.0, True), ("paper", 0.0, False), ("paper", 1.0, True)]
)
def test_the_paper_holds_what_is_told_to_be_glossy_alone(
    world: GlossyWorld, loss: str, mirror: float, wrong: bool
):
    """A mirror in the picture where the prior says rough, or a rough picture where it says glossy."""
    settings = with_settings(region_loss=loss, normal_prior_weight=0.0)
    shot = shots_of_world(world)[0]
    shot = replace(shot, glossy=torch.full_like(shot.glossy, mirror))
    region = torch.full_like(world.parameters.surfels[REGION], 6.0 if mirror else -6.0)
    values = world.changed(**{REGION: region.requires_grad_()})
    buffers = drawn_buffers(values, shot.photograph.camera, shot.photograph.sky, settings)
    loss_of = surface_loss(buffers, shot, settings, 0)
    gradient = torch.autograd.grad(loss_of, region, allow_unused=True)[0]
    assert (gradient is not None and bool(gradient.any())) == wrong


def test_what_photographs_show_next_to_the_object_stays_if_the_paper_is_followed(
    world: GlossyWorld, room: Capture
):
    priors, shots = methods.Priors(models={"inpainting": Painter(world)}), shots_of_world(world)
    left = []
    for doubtful_go in (True, False):
        settings = with_settings(iterations=4, grow=0.05, doubtful_go=doubtful_go)
        after = removed_from(world, room, priors, settings, shots=shots).parameters
        floor = after.surfels[CENTRES][:, 2].abs() < 0.02
        left.append(int(floor.sum()))
    assert left[1] > left[0]


@pytest.mark.parametrize("metal", [True, False])
def test_what_a_metal_scatters_stays_when_the_object_goes(world: GlossyWorld, room: Capture, metal: bool):
    priors = methods.Priors(models={"inpainting": Painter(world)})
    settings, shots = with_settings(iterations=8), shots_of_world(world)
    light = FittedLight(world.parameters, metal=metal)
    after = removed_from(world, room, priors, settings, shots=shots, light=light).parameters
    known = {tuple(row) for row in world.parameters.surfels[DIFFUSE].tolist()}
    kept = sum(tuple(row) in known for row in after.surfels[DIFFUSE].tolist())
    assert (kept > 0.5 * len(after)) == metal


def test_the_object_goes_with_its_mirror_image_and_all_else_stays(world: GlossyWorld, room: Capture):
    """The second stage on surfels that are true, with a painter who is right."""
    priors = methods.Priors(models={"inpainting": Painter(world)})
    settings, shots = with_settings(iterations=80, grow=0.03), shots_of_world(world)
    after = removed_from(world, room, priors, settings, shots=shots).parameters
    assert torch.equal(after.shared[SURROUNDINGS], world.parameters.shared[SURROUNDINGS])
    assert float(after.surfels[LABEL].sigmoid().max()) < settings.least_inside
    true = GlossyScene(world.parameters.take(torch.from_numpy(world.part != OBJECT)), settings, 1.0, EXTENT)
    found, kept = (GlossyScene(p, settings, 1.0, EXTENT) for p in (after, world.parameters))
    effects = _effects(world.parameters.all, shots, settings, EXTENT)
    for camera, shot, effect in zip(world.cameras, shots, effects, strict=True):
        wanted, got, before = (s.render(camera, ["radiance"])["radiance"] for s in (true, found, kept))
        where = shot.target.numpy() > 0.5
        mirror = effect & ~where
        away = ~np.asarray(maximum_filter(where | effect, 7), bool)
        for region, least in ((where, 0.4), (mirror, 0.4)):
            assert np.abs(got - wanted)[region].mean() < least * np.abs(before - wanted)[region].mean()
        assert np.abs(got - wanted)[away].mean() < 0.02


def test_what_the_first_stage_has_fitted_moves_slowly_in_the_second(
    world: GlossyWorld, room: Capture, monkeypatch: pytest.MonkeyPatch
):
    """Fresnel terms as slowly as ones that photographs told, whatever they began with."""
    asked: list[bool] = []

    def rates(extent: float, settings: GorisSettings, found: bool) -> dict[str, LearningRateSchedule]:
        asked.append(found)
        return light_rates(extent, settings, found)

    monkeypatch.setattr(_remove, "light_rates", rates)
    priors = methods.Priors(models={"inpainting": Painter(world)})
    settings, shots = with_settings(iterations=8, first_light=False), shots_of_world(world)
    removed_from(world, room, priors, settings, shots=shots)
    assert asked == [True]


def test_what_viewers_are_shown_of_glossy_surfaces_is_what_they_scatter(world: GlossyWorld, tmp_path: Path):
    """In their own colours the object would be mirrored still."""
    scene = GlossyScene(world.parameters, SETTINGS, 1.0, EXTENT)
    floor = torch.from_numpy(world.part == FLOOR)
    found = _scattered(scene).surfels
    base = found[COEFFICIENTS][:, 0] * SH_DC + 0.5
    torch.testing.assert_close(base[floor], (1.5 * world.parameters.surfels[DIFFUSE].sigmoid())[floor])
    assert not found[DETAIL][floor].any()
    for name in (COEFFICIENTS, DETAIL):
        assert torch.equal(found[name][~floor], world.parameters.surfels[name][~floor])


def test_without_the_object_its_mirror_image_is_gone(world: GlossyWorld):
    """The claim of the method on surfels that are true: floor pixels that showed the object show the sky."""
    left = world.parameters.take(torch.from_numpy(world.part != OBJECT))
    scenes = [GlossyScene(p, SETTINGS, 1.0, EXTENT) for p in (world.parameters, left)]
    shots = shots_of_world(world)
    effect = _effects(world.parameters.all, shots, SETTINGS, EXTENT)[0]
    with_object, without = (s.render(world.cameras[0], ["specular"])["specular"] for s in scenes)
    blue = [image[effect].mean(axis=0) for image in (with_object, without)]
    assert blue[0][2] > 1.5 * blue[0][0], "the blue board by reflection"
    assert blue[1][2] == pytest.approx(blue[1][0], rel=0.2), "the grey sky"


def test_a_distilled_scene_looks_like_it_and_traces_nothing(world: GlossyWorld, room: Capture):
    settings = with_settings(iterations=250, fill=0.0)
    found = distilled(world.parameters, room, settings, 0, silent)
    assert set(found.surfels) >= {"centres", "coefficients", "detail"}
    assert REGION not in found.surfels
    scene = GlossyScene(world.parameters, settings, 1.0, EXTENT)
    colours, rough = SurfelScene(found, "goris", 1.0), SurfelScene(world.parameters, "goris", 1.0)
    camera = world.cameras[2]
    true, got, before = (s.render(camera, ["radiance"])["radiance"] for s in (scene, colours, rough))
    assert np.abs(got - true).mean() < 0.5 * np.abs(before - true).mean()


def test_cameras_between_lie_on_the_way():
    eyes = [np.array([x, -2.0, 1.0]) for x in (0.0, 0.3, 2.0)]
    cameras = [Camera.from_fov(20, 16, 50, look_at(eye, np.zeros(3))) for eye in eyes]
    found = cameras_between(cameras, 2)
    assert len(found) == 7, "the first two are nearest to each other: one way"
    assert found[:3] == cameras
    np.testing.assert_allclose(found[3].position, [0.1, -2, 1], atol=1e-9)
    np.testing.assert_allclose(found[5].position, [2.0 - 1.7 / 3, -2, 1], atol=1e-9)
    for camera in found:
        turn = camera.camera_to_world[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
    assert cameras_between(cameras[:1], 2) == cameras[:1]


def test_a_scene_of_another_method_is_refused(world: GlossyWorld, tmp_path: Path):
    scene = GlossyScene(world.parameters, SETTINGS, 1.0, EXTENT)
    GorisScene(scene, scene, 3).save(tmp_path)
    from graycard.methods import load_method

    with pytest.raises(MethodError, match="goris"):
        load_method("removal").load(tmp_path)
    with pytest.raises(MethodError, match="expected layers out of"):
        scene.render(world.cameras[0], ["base_color"])


def test_what_a_mirror_shows_next_to_the_object_alone_goes_with_it(world: GlossyWorld):
    """Parts of the glossy floor next to it go, the more the wider it is; nothing rough goes."""
    shots = shots_of_world(world)
    floor = torch.from_numpy(world.part) == FLOOR
    near, wide = (next_to_object(world.parameters, shots, grow) for grow in (0.0, 0.05))
    assert near[floor].float().mean() < 0.1
    assert (wide | ~near).all()
    assert wide[floor].sum() > near[floor].sum()
    assert not wide[~floor].any()
    clear = [replace(shot, target=torch.zeros_like(shot.target)) for shot in shots]
    assert not next_to_object(world.parameters, clear, 0.05).any()


def test_a_scene_that_is_all_next_to_the_object_is_refused(world: GlossyWorld, room: Capture):
    """Nothing would be left, and the message says which setting took it."""
    shots = [replace(shot, target=torch.ones_like(shot.target)) for shot in shots_of_world(world)]
    mirrors = next_to_object(world.parameters, shots, 0.0)
    seen = world.parameters.take(mirrors | torch.from_numpy(world.part == OBJECT))
    priors, light = methods.Priors(models={"inpainting": Painter(world)}), FittedLight(seen)
    with pytest.raises(MethodError, match="alone, or its own, got all.* change grow"):
        removed_from(world, room, priors, SETTINGS, shots=shots, light=light)
