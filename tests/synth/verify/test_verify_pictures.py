# SPDX-License-Identifier: Apache-2.0
"""Checks of single views on pictures made by hand, without a renderer."""

import dataclasses
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graycard import (
    Camera,
    Capture,
    EnvironmentLight,
    Light,
    PointLight,
    Points,
    SceneObject,
    Sensor,
    Truth,
    View,
    look_at,
)
from graycard.io import Manifest
from graycard.synth._spec import CaptureSettings
from graycard.synth.dataset._photographs import photographed
from graycard.synth.verify._captures import check_capture
from graycard.synth.verify._check import At, Check
from graycard.synth.verify._closed_forms import sky_towards
from graycard.synth.verify._counterfactual import check_counterfactual
from graycard.synth.verify._geometry import check_between, check_geometry
from graycard.synth.verify._irradiance import check_background, check_irradiance
from graycard.synth.verify._materials import check_objects
from graycard.synth.verify._subject import Subject, TruePicture
from graycard.synth.verify._summaries import Summary
from graycard.synth.verify._transport import check_halves, check_parts

SIDE = 24
CAMERA = Camera.from_fov(SIDE, SIDE, 50, look_at(np.array([0.0, -3.0, 2.0]), np.zeros(3)))
VIEW = View("train_000", "train", CAMERA)
OBJECTS = (
    SceneObject(1, "floor", False),
    SceneObject(2, "lamp", True),
    SceneObject(3, "vase", False),
)


def make_subject(lights: tuple[Light, ...] = (), sky: np.ndarray | None = None) -> Subject:
    views = (VIEW, View("test_001", "test", CAMERA))
    capture = Capture("tabletop", "made-0000", views, 1.0, False, 3)
    truth = Truth("tabletop", "made-0000", views, 1.0, 4.0, OBJECTS, 3)
    manifest = Manifest(
        "graycard-truth", 1, "tabletop", "made-0000", {"variant": "llvm_ad_rgb"}, {"scene": 0}, {}
    )
    return Subject(At("tabletop/made-0000"), Path("nowhere"), capture, truth, manifest, lights, sky)


def floor(**changed: Any) -> TruePicture:
    """A plane z = 0 of albedo 0.5."""
    rays, camera = CAMERA.rays(), CAMERA
    distance = -camera.position[2] / rays[..., 2]
    ones = np.ones((SIDE, SIDE))
    layers = {
        "distance": distance,
        "depth": distance * (rays @ camera.forward),
        "position": camera.position + distance[..., None] * rays,
        "normal": ones[..., None] * np.array([0.0, 0.0, 1.0]),
        "object_id": ones.astype(np.uint32),
        "base_color": 0.5 * np.ones((SIDE, SIDE, 3)),
    }
    return TruePicture(
        At("tabletop/made-0000", "train_000"), 0, View("train_000", "train", camera), layers | changed, True
    )


def nothing() -> TruePicture:
    dark = np.zeros((SIDE, SIDE))
    return floor(object_id=dark.astype(np.uint32), depth=dark + np.inf, distance=dark + np.inf)


def status(checks: Any) -> dict[str, str]:
    return {check.name: check.status for check in checks}


def test_a_plane_has_the_geometry_of_a_plane():
    found = list(check_geometry(floor()))
    assert {check.status for check in found} == {"passed"}
    assert len(found) == 6


@pytest.mark.parametrize("height", [0.0, 0.004, 0.01, 0.02, 0.05, 0.2])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_step_of_one_object_is_not_taken_for_a_slope(height: float, axis: int):
    """Doors of a cupboard have the normal of its front, and a step of few millimetres at their rim."""
    side, pose = 96, look_at(np.array([0.0, -1.0, 2.0]), np.zeros(3))
    camera = Camera.from_fov(side, side, 50, pose)
    rays = camera.rays()
    raised = np.indices((side, side))[axis] // 8 % 2
    distance = (height * raised - camera.position[2]) / rays[..., 2]
    layers = {
        "distance": distance,
        "depth": distance * (rays @ camera.forward),
        "position": camera.position + distance[..., None] * rays,
        "normal": np.ones((side, side, 1)) * np.array([0.0, 0.0, 1.0]),
        "object_id": np.ones((side, side), np.uint32),
    }
    picture = TruePicture(floor().at, 0, View("train_000", "train", camera), layers, True)
    assert status(check_geometry(picture))["normal across the surface"] == "passed"


def test_a_normal_in_other_axes_is_not_across_the_surface():
    turned = floor(normal=np.ones((SIDE, SIDE, 1)) * np.array([0.0, -np.sin(0.3), np.cos(0.3)]))
    assert status(check_geometry(turned))["normal across the surface"] == "failed"


def test_where_nothing_is_seen_there_is_no_geometry():
    assert status(check_geometry(nothing())) == {"position on the ray": "skipped"}
    assert status(check_between(nothing(), floor(), At("s"))) == {"position in other views": "skipped"}


def test_views_that_see_other_points_have_no_object_in_common():
    far = floor(position=floor().layers["position"] + np.array([0.0, 0.0, -0.2]))
    assert status(check_between(far, floor(), At("s")))["object in other views"] == "skipped"


def test_a_camera_that_is_moved_looks_through_what_another_sees():
    raised = floor(position=floor().layers["position"] + np.array([0.0, 0.0, 0.5]))
    assert status(check_between(raised, floor(), At("s")))["position in other views"] == "failed"


def test_the_surface_of_a_light_is_black():
    ids = np.full((SIDE, SIDE), 2, np.uint32)
    black = np.zeros((SIDE, SIDE, 3))
    assert status(check_objects(make_subject(), floor(object_id=ids, base_color=black))) == {
        "object ids named": "passed",
        "emitters flagged": "passed",
    }
    assert status(check_objects(make_subject(), floor(object_id=ids)))["emitters flagged"] == "failed"


def emptied(rng: np.random.Generator, **masks: np.ndarray) -> TruePicture:
    """The upper half is untouched; the target is seen in a corner below."""
    ids = np.ones((SIDE, SIDE), np.uint32)
    ids[-4:, -4:] = 3
    halves = {f"radiance.half_{end}": rng.random((SIDE, SIDE, 3)) for end in "ab"}
    changed = (np.arange(SIDE) >= SIDE // 2)[:, None, None] * 0.1
    other = {f"counterfactual.{name}": values + changed for name, values in halves.items()}
    pictures = {
        f"{stem}radiance": (v[f"{stem}radiance.half_a"] + v[f"{stem}radiance.half_b"]) / 2
        for stem, v in (("", halves), ("counterfactual.", other))
    }
    untouched = np.broadcast_to((np.arange(SIDE) < SIDE // 2)[:, None], (SIDE, SIDE)).astype(float)
    return floor(**({"object_id": ids, "effect.untouched": untouched} | halves | other | pictures | masks))


def test_untouched_pixels_are_equal_to_the_bit():
    found = status(check_counterfactual(make_subject(), emptied(np.random.default_rng(0))))
    assert set(found.values()) == {"passed"}
    assert {"untouched pixels", "effects where touched", "target removed"} <= set(found)
    everywhere = np.ones((SIDE, SIDE))
    wrong = emptied(np.random.default_rng(0), **{"effect.untouched": everywhere})
    assert status(check_counterfactual(make_subject(), wrong))["untouched pixels"] == "failed"


def effects_of(target: np.ndarray, shadow: np.ndarray) -> dict[str, np.ndarray]:
    """All masks of a target that does nothing but cast a shadow, and variances."""
    masks = {"footprint": target, "shadow": shadow, "untouched": ~shadow}
    none = dict.fromkeys(("mirror", "bleeding"), np.zeros_like(target))
    variances = dict.fromkeys(("radiance.var", "counterfactual.radiance.var"), np.ones((SIDE, SIDE, 3)))
    return {f"effect.{name}": mask.astype(float) for name, mask in (masks | none).items()} | variances


@pytest.mark.parametrize("lost", ["nothing", "a corner", "the rim", "all"])
@pytest.mark.parametrize("change", [1e-8, 0.1])
def test_what_rounding_makes_equal_need_not_be_marked_as_untouched(lost: str, change: float):
    """Each eighth pixel that the target touches is equal by chance; some of the mask is lost."""
    parts = {
        "nothing": (slice(0), slice(0)),
        "a corner": (slice(4), slice(4)),
        "the rim": (slice(SIDE // 2 - 3, SIDE), slice(SIDE)),
        "all": (slice(SIDE), slice(SIDE)),
    }
    before = emptied(np.random.default_rng(0)).layers
    below = before["effect.untouched"] == 0
    equal = ~below | (np.arange(SIDE) % 8 == 0)
    changed = effects_of(before["object_id"] == 3, below)
    changed["effect.untouched"][parts[lost]] = 0
    for name in ("radiance", "radiance.half_a", "radiance.half_b"):
        changed[f"counterfactual.{name}"] = before[name] + change * ~equal[..., None]
    picture = emptied(np.random.default_rng(0), **changed)
    found = status(check_counterfactual(make_subject(), picture))
    is_right = lost == "nothing" and change < 1e-6
    assert found["untouched pixels marked"] == ("passed" if is_right else "failed")
    assert found["untouched pixels"] == "passed"


def test_no_effect_is_marked_where_the_picture_is_untouched():
    shadow = np.zeros((SIDE, SIDE))
    shadow[0, 0] = 1
    marked = emptied(np.random.default_rng(0), **{"effect.shadow": shadow})
    assert status(check_counterfactual(make_subject(), marked))["effects where touched"] == "failed"


def test_a_target_that_is_not_seen_cannot_be_looked_for():
    hidden = emptied(np.random.default_rng(0), object_id=np.ones((SIDE, SIDE), np.uint32))
    assert status(check_counterfactual(make_subject(), hidden))["target removed"] == "skipped"


def test_a_picture_without_noise_has_no_variance_to_be_judged():
    same = np.ones((SIDE, SIDE, 3))
    names = ("radiance", "radiance.half_a", "radiance.half_b")
    still = floor(**dict.fromkeys(names, same), **{"radiance.var": 1e-16 * same})
    assert status(check_halves(still, 1)) == {"halves average": "passed", "variance of the mean": "skipped"}


@pytest.mark.parametrize(("turn", "verdict"), [(0, "passed"), (20, "failed")])
def test_the_background_is_the_environment(turn: int, verdict: str):
    sky = np.linspace(0.1, 2.0, 64)[None, :, None] * np.ones((32, 64, 3))
    above = look_at(np.zeros(3), np.array([1.0, 0.5, 0.8]))
    seen = nothing()
    camera = Camera.from_fov(SIDE, SIDE, 50, above)
    radiance = sky_towards(sky, camera.rays().reshape(-1, 3)).reshape(SIDE, SIDE, 3)
    picture = TruePicture(
        seen.at, 0, View("train_000", "train", camera), {**seen.layers, "radiance": radiance}, True
    )
    found = check_background(make_subject(sky=np.roll(sky, turn, axis=1)), picture)
    assert status(found) == {"background is the environment": verdict}


def lit(light: PointLight, **changed: np.ndarray) -> TruePicture:
    to_light = np.array(light.position) - floor().layers["position"]
    square = (to_light**2).sum(-1)
    cosine = to_light[..., 2] / np.sqrt(square)
    arriving = (cosine / square)[..., None] * np.array(light.intensity)
    layers = {
        f"irradiance.{light.name}": arriving,
        f"direct.irradiance.{light.name}": arriving,
        f"visibility.{light.name}": np.ones((SIDE, SIDE)),
        "shading": arriving / np.pi,
    }
    return floor(**(layers | changed))


def test_the_light_of_a_point_is_its_formula():
    light = PointLight("p", (0.3, 0.2, 1.5), (3, 2, 1))
    subject = make_subject((light,))
    assert set(status(check_irradiance(subject, lit(light))).values()) == {"passed"}
    moved = make_subject((PointLight("p", (-0.3, 0.2, 1.5), (3, 2, 1)),))
    assert status(check_irradiance(moved, lit(light)))["direct light of the formula"] == "failed"


def test_a_light_that_is_hardly_seen_or_has_no_formula_is_skipped():
    light = PointLight("p", (0.3, 0.2, 1.5), (3, 2, 1))
    hidden = lit(
        light, **{"visibility.p": np.zeros((SIDE, SIDE)), "direct.irradiance.p": np.zeros((SIDE, SIDE, 3))}
    )
    assert (
        status(check_irradiance(make_subject((light,)), hidden))["direct light of the formula"] == "skipped"
    )
    sky = make_subject((EnvironmentLight("p", "environment.exr"),))
    found: list[Check] = list(check_irradiance(sky, lit(light)))
    assert "there is no formula for the light p" in [check.reason for check in found]


def test_without_matte_pixels_there_is_no_diffuse_law():
    light = PointLight("p", (0.3, 0.2, 1.5), (3, 2, 1))
    black = np.zeros((SIDE, SIDE, 3))
    parts = {f"{a}.{b}.p": black for a in ("direct", "indirect") for b in ("diffuse", "specular")}
    names = ("radiance", "emitted", "f0", "albedo", "diffuse_reflectance")
    flat = {"roughness": np.zeros((SIDE, SIDE)), "pure": np.ones((SIDE, SIDE))}
    picture = lit(light, **parts, **dict.fromkeys(names, black), **flat)
    assert status(check_parts(make_subject((light,)), picture)) == {
        "parts add up": "passed",
        "energy": "passed",
        "diffuse light": "skipped",
    }


def taken(sensor: Sensor, noise: float, gain: float = 1.0) -> dict[str, str]:
    """Verdicts on a photograph of levels 0.1 to 0.8, or to 3.2 where there is no noise.

    It has ``noise`` times the noise of its camera, then ``gain`` times its brightness.
    """
    subject = make_subject()
    brightest = 1.6 if sensor.bits or sensor.shot_noise else 6.4
    radiance = np.random.default_rng(0).uniform(0.2, brightest, (SIDE, SIDE, 3))
    kept = replace(subject.capture, exposure=0.5, sensor=sensor, target=None)
    level = photographed(radiance, "train_000", 0.5, sensor, 3).astype(float)
    photograph = gain * (radiance + noise * (level - radiance))

    class Held(Capture):
        def photograph(self, view: View) -> np.ndarray:
            return photograph

    fields = {f.name: getattr(kept, f.name) for f in dataclasses.fields(kept)}
    truth = replace(subject.truth, target=None)
    held = replace(subject, capture=Held(**fields), truth=truth)
    return status(check_capture(held, floor(radiance=radiance)))


@pytest.mark.parametrize("sensor", [Sensor(8), Sensor(0, 8000.0, 20.0), Sensor(8, 2000.0)])
def test_a_photograph_has_the_noise_and_the_exposure_of_its_camera(sensor: Sensor):
    assert set(taken(sensor, 1.0).values()) == {"passed"}
    assert taken(sensor, 0.5)["photograph of its camera"] == "failed"
    assert taken(sensor, 1.5)["photograph of its camera"] == "failed"
    assert taken(sensor, 1.0, gain=1.006)["photograph's exposure"] == "failed"


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_without_noise_a_photograph_is_the_radiance_up_to_white(factor: float):
    sensor = Sensor(exposures={"train_000": factor})
    assert taken(sensor, 1.0) == {"photograph of its camera": "passed"}
    assert taken(sensor, 1.0, gain=1.01) == {"photograph of its camera": "failed"}
    assert taken(sensor, 0.0) == {"photograph of its camera": "failed"}  # it is not cut off at white


def test_too_few_values_between_black_and_white_say_nothing():
    sensor = Sensor(0, 4.0)  # so few electrons that a level of 0.5 may be any
    assert taken(sensor, 1.0) == {"photograph of its camera": "skipped"}


def summed_up(moved: tuple[float, float, float], seen_there: bool = False, count: int = 40) -> dict[str, str]:
    """Verdicts on points of the floor that are moved, and found where they were or where they are then."""
    rng, picture = np.random.default_rng(1), floor()
    row, column = rng.integers(0, SIDE, (2, count))
    places = picture.layers["position"][row, column]
    found = places + np.array(moved)
    pixel = CAMERA.project(found if seen_there else places)[0] + rng.normal(0, 0.5, (count, 2))
    number = np.arange(count)
    points = Points(found, np.zeros((count, 3), np.uint8), number, 0 * number, pixel)

    class Held(Capture):
        def points(self) -> Points:
            return points

    subject = make_subject()
    fields = {f.name: getattr(subject.capture, f.name) for f in dataclasses.fields(subject.capture)}
    truth = replace(subject.truth, views=(VIEW,))
    summary = Summary(replace(subject, capture=Held(**fields), truth=truth), CaptureSettings())
    black = np.zeros((SIDE, SIDE, 3))
    summary.add(floor(**{"radiance": black, "radiance.var": black}))
    return status(summary.checks())


def test_sparse_points_lie_where_their_views_see_them():
    found = summed_up((0, 0, 0))
    assert found["sparse points in photographs"] == found["sparse points on surfaces"] == "passed"
    assert summed_up((5, 0, 0))["sparse points in photographs"] == "failed"
    assert summed_up((0, 0, 1), seen_there=True)["sparse points on surfaces"] == "failed"
    assert summed_up((0, 0, 0), count=8)["sparse points"] == "skipped"
