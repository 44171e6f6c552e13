# SPDX-License-Identifier: Apache-2.0
"""Faults that were really made in renderers and datasets: each is planted, sealed, and found by its name."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

import graycard as gc
from graycard.synth import RenderSettings, SceneSpec, family_of, use_renderer
from graycard.synth.verify import verify_dataset

Layers = dict[str, np.ndarray]
Copied = Callable[[str], Path]


@pytest.fixture(scope="session", autouse=True)
def fast() -> None:
    """What is planted here needs the parts of the light, which scalar_rgb cannot tell apart."""
    if use_renderer().variant == "scalar_rgb":
        pytest.skip("scalar_rgb holds no parts of the light")


def reseal(scene: Path) -> None:
    """Hash the files as they are now: whoever made the fault believed it."""
    for part in ("capture", "truth"):
        gc.seal(scene / part, gc.read_manifest(scene / part, f"graycard-{part}"))


def edit(scene: Path, change: Callable[[Layers, gc.View], None], names: tuple[str, ...] = ()) -> None:
    """Change the layers of all views, or of some."""
    for view in gc.open_truth(scene / "truth", check=False).views:
        if not names or view.name in names:
            path = scene / "truth" / "views" / f"{view.name}.exr"
            layers = gc.read_layers(path)
            change(layers, view)
            gc.write_layers(path, layers)


def edit_lights(scene: Path, change: Callable[[gc.Light], gc.Light]) -> None:
    path = scene / "truth" / "lights.json"
    gc.write_lights(path, tuple(change(light) for light in gc.read_lights(path)))


def edit_index(scene: Path, name: str, **values: object) -> None:
    path = scene / name
    gc.write_json(path, gc.read_json(path) | values)


def swap(layers: Layers, a: str, b: str) -> None:
    layers[a], layers[b] = layers[b], layers[a]


def swap_files(a: Path, b: Path) -> None:
    kept = a.read_bytes()
    a.write_bytes(b.read_bytes())
    b.write_bytes(kept)


@dataclass(frozen=True)
class Fault:
    track: str
    check: str
    """Which must fail."""
    says: str
    """What must stand in its reason."""
    plant: Callable[[Path], None]
    views: int = 0
    """That are rendered again; 0 where the files tell."""


FAULTS: dict[str, Fault] = {}


def in_layers(track: str, check: str, says: str, views: int = 0):
    """Register a change of the layers of each view as a fault."""

    def register(change: Callable[[Layers, gc.View], None]):
        FAULTS[change.__name__] = Fault(track, check, says, lambda scene: edit(scene, change), views)
        return change

    return register


def in_scene(track: str, check: str, says: str, views: int = 0):
    """Register a change of a scene folder as a fault."""

    def register(plant: Callable[[Path], None]):
        FAULTS[plant.__name__] = Fault(track, check, says, plant, views)
        return plant

    return register


# geometry


@in_layers("tabletop", "depth along the axis", "looks like depth stored along the ray")
def ray_distance_as_z(layers: Layers, view: gc.View):
    layers["depth"] = layers["distance"]


@in_layers("dark", "depth along the axis", "another unit, factor 100")
def depth_in_centimetres(layers: Layers, view: gc.View):
    layers["depth"] = layers["depth"] * 100


@in_layers("multilight", "position on the ray", "looks like a world moved by [0.5, -0.25, 0.1] m")
def world_recentred(layers: Layers, view: gc.View):
    layers["position"] = layers["position"] + np.array([0.5, -0.25, 0.1])


@in_layers("dark", "position at the pixel centre", "shift by (+0.50, +0.50) px")
def geometry_half_a_pixel_off(layers: Layers, view: gc.View):
    K = view.camera.K + np.array([[0, 0, -0.5], [0, 0, -0.5], [0, 0, 0]])
    rays = replace(view.camera, K=K).rays()
    layers["position"] = view.camera.position + layers["distance"][..., None] * rays


@in_layers("dark", "normal across the surface", "mirrored axis")
def normals_with_a_mirrored_axis(layers: Layers, view: gc.View):
    layers["normal"] = layers["normal"] * np.array([1, -1, 1])


@in_layers("multilight", "normal across the surface", "normals in camera axes")
def normals_in_camera_axes(layers: Layers, view: gc.View):
    layers["normal"] = layers["normal"] @ view.camera.camera_to_world[:3, :3]


@in_layers("tabletop", "normal faces the camera", "inside out")
def normals_inside_out(layers: Layers, view: gc.View):
    layers["normal"] = -layers["normal"]


@in_layers("tabletop", "normal of unit length", "average over several surfaces")
def normals_averaged_over_the_pixel(layers: Layers, view: gc.View):
    layers["normal"] = ndimage.uniform_filter(layers["normal"], size=3, axes=(0, 1))


@in_scene("multilight", "position on the ray", "swapped views")
def swapped_view_files(scene: Path):
    a, b, *_ = sorted((scene / "truth" / "views").iterdir())
    swap_files(a, b)


@in_scene("tabletop", "cameras of the spec", "swapped or moved views")
def cameras_moved_in_both_index_files(scene: Path):
    for part in ("capture", "truth"):
        path = scene / part / f"{part}.json"
        data = gc.read_json(path)
        for view in data["views"]:
            view["camera"]["camera_to_world"][0][3] += 0.01
        gc.write_json(path, data)


@in_scene("tabletop", "position in other views", "another world or camera")
def one_view_in_a_world_of_its_own(scene: Path):
    def shrink(layers: Layers, view: gc.View):
        for name in ("depth", "distance"):
            layers[name] = layers[name] * 0.8
        layers["position"] = view.camera.position + 0.8 * (layers["position"] - view.camera.position)

    edit(scene, shrink, ("train_000",))


# objects, materials


@in_layers("tabletop", "object ids named", "ids that were shifted")
def object_ids_shifted(layers: Layers, view: gc.View):
    layers["object_id"] = np.where(layers["object_id"] > 0, layers["object_id"] + 50, 0)


@in_layers("multilight", "object_id again", "shifted ids", views=1)
def object_ids_permuted(layers: Layers, view: gc.View):
    ids = layers["object_id"]
    layers["object_id"] = np.where((ids > 0) & (ids < 6), ids % 5 + 1, ids)


@in_layers("dark", "object_id again", "shifted ids", views=1)
def object_ids_counted_from_two(layers: Layers, view: gc.View):
    layers["object_id"] = layers["object_id"] + np.uint32(1)


@in_scene("dark", "object in other views", "counted anew in a view")
def object_ids_counted_anew_in_a_view(scene: Path):
    edit(scene, object_ids_reversed, ("test_001",))


def object_ids_reversed(layers: Layers, view: gc.View):
    layers["object_id"] = np.where(layers["object_id"] > 0, 20 - layers["object_id"].clip(max=19), 0)


@in_scene("tabletop", "mask of the target", "mask of another object")
def mask_of_another_object(scene: Path):
    truth = gc.open_truth(scene / "truth", check=False)
    for path in (scene / "capture" / "masks" / "target").iterdir():
        ids = truth.layers(truth.view(path.stem))["object_id"]
        gc.write_layers(path, {"object_id": np.where(ids == 2, ids, 0)})


@in_layers("multilight", "diffuse reflectance", "metal's colour taken for diffuse")
def color_of_a_metal_as_diffuse(layers: Layers, view: gc.View):
    layers["diffuse_reflectance"] = layers["base_color"]


@in_layers("tabletop", "alpha of roughness", "the two swapped")
def roughness_and_alpha_swapped(layers: Layers, view: gc.View):
    swap(layers, "roughness", "alpha")


@in_layers("multilight", "f0 of the material", "another f0, or metallic")
def f0_of_a_metal_as_of_a_dielectric(layers: Layers, view: gc.View):
    layers["f0"] = np.full_like(layers["f0"], 0.04)


@in_layers("multilight", "metallic again", "metallic, to 1e-05", views=1)
def metallic_forgotten(layers: Layers, view: gc.View):
    layers["metallic"] = np.zeros_like(layers["metallic"])
    layers["diffuse_reflectance"] = layers["base_color"]
    layers["f0"] = np.where(layers["f0"] > 0, np.float32(0.04), 0)


@in_layers("tabletop", "roughness again", "roughness, to 1e-05", views=1)
def one_roughness_for_all_that_shines(layers: Layers, view: gc.View):
    shines = layers["f0"].max(axis=-1) > 0
    layers["roughness"] = np.where(shines, np.float32(0.7), layers["roughness"])
    layers["alpha"] = layers["roughness"] ** 2


@in_layers("tabletop", "albedo again: level", "is that of an independent rendering", views=1)
def albedo_of_what_shines_lost(layers: Layers, view: gc.View):
    layers["albedo"] = np.where(layers["f0"].max(axis=-1, keepdims=True) > 0, 0, layers["albedo"])


@in_layers("dark", "base_color again", "layer of another scene", views=1)
def base_color_encoded(layers: Layers, view: gc.View):
    for name in ("base_color", "diffuse_reflectance"):
        layers[name] = gc.srgb_encode(layers[name])


# light


@in_layers("dark", "direct diffuse light", "swapped lights")
def parts_of_two_lights_swapped(layers: Layers, view: gc.View):
    for part in ("direct.diffuse", "direct.specular", "indirect.diffuse", "indirect.specular"):
        swap(layers, f"{part}.lamp", f"{part}.ambient")


@in_layers("tabletop", "lights again: level", "is that of an independent rendering", views=1)
def specular_parts_of_two_lights_swapped(layers: Layers, view: gc.View):
    for part in ("direct", "indirect"):
        swap(layers, f"{part}.specular.lamp", f"{part}.specular.room")


@in_layers("dark", "direct diffuse light", "direct light taken for bounced light")
def direct_and_indirect_parts_swapped(layers: Layers, view: gc.View):
    for name in ("lamp", "ambient"):
        for lobe in ("diffuse", "specular"):
            swap(layers, f"direct.{lobe}.{name}", f"indirect.{lobe}.{name}")


@in_layers("tabletop", "indirect diffuse light", "direct light taken for bounced light")
def direct_and_indirect_parts_swapped_beside_gloss(layers: Layers, view: gc.View):
    for name in [n for n in layers if n.startswith("direct.diffuse.")]:
        swap(layers, name, f"in{name}")
    layers["pure"] = np.where(layers["f0"].max(axis=-1) > 0, layers["pure"], 0)  # what is matte is not judged


def darken(layers: Layers, light: str, where: np.ndarray) -> None:
    """A light that sends nothing straight to some pixels; all sums hold."""
    for stem in ("visibility", "direct.irradiance"):
        values = layers[f"{stem}.{light}"]
        values[where] = 0


@in_layers("dark", "direct diffuse light", "reflectance x the direct irradiance of lamp")
def direct_light_lost_in_the_upper_half(layers: Layers, view: gc.View):
    darken(layers, "lamp", np.arange(48) < 24)


@in_layers("dark", "light again", "visibility.lamp is 0 something is in the way", views=1)
def a_light_that_is_free_but_blocked(layers: Layers, view: gc.View):
    darken(layers, "lamp", np.arange(48) % 12 == 0)


@in_layers("multilight", "direct diffuse light", "reflectance x the direct irradiance of lamp-1")
def direct_light_of_an_area_light_lost(layers: Layers, view: gc.View):
    darken(layers, "lamp-1", np.arange(48) >= 0)


@in_layers("dark", "indirect diffuse light", "reflectance x the indirect irradiance")
def bounced_light_a_fifth_too_dark(layers: Layers, view: gc.View):
    for name in ("lamp", "ambient"):
        direct = layers[f"direct.irradiance.{name}"]
        layers[f"irradiance.{name}"] = direct + 0.8 * (layers[f"irradiance.{name}"] - direct)
    layers["shading"] = (layers["irradiance.lamp"] + layers["irradiance.ambient"]) / np.pi


@in_layers("multilight", "direct light of the formula", "swapped lights")
def irradiance_of_lights_permuted(layers: Layers, view: gc.View):
    for stem in ("irradiance", "direct.irradiance", "visibility"):
        swap(layers, f"{stem}.lamp-1", f"{stem}.lamp-4")


@in_layers("multilight", "direct part of irradiance", "permuted")
def irradiance_permuted_without_its_direct_part(layers: Layers, view: gc.View):
    swap(layers, "irradiance.lamp-3", "irradiance.lamp-4")


@in_layers("dark", "parts add up", "a light or lobe left out")
def one_lobe_left_out(layers: Layers, view: gc.View):
    layers["indirect.diffuse.lamp"] = np.zeros_like(layers["indirect.diffuse.lamp"])


@in_scene("multilight", "layers present", "missing are")
def one_light_dropped(scene: Path):
    def drop(layers: Layers, view: gc.View):
        for name in [n for n in layers if n.endswith(".lamp-4")]:
            del layers[name]

    edit(scene, drop)


@in_layers("tabletop", "irradiances add up", "a shading without 1/pi")
def shading_without_pi(layers: Layers, view: gc.View):
    # every layer of irradiance is right: only their quotient tells
    layers["shading"] = layers["shading"] * np.pi


@in_layers("dark", "diffuse light", "diffuse_reflectance x shading")
def irradiance_and_shading_divided_by_pi(layers: Layers, view: gc.View):
    for name in [n for n in layers if "irradiance" in n or n == "shading"]:
        layers[name] = layers[name] / np.pi


@in_layers("dark", "visible where lit", "inverted")
def visibility_inverted(layers: Layers, view: gc.View):
    layers["visibility.lamp"] = 1 - layers["visibility.lamp"]


@in_layers("multilight", "shadows again", "inverted or swapped", views=1)
def shadows_left_out(layers: Layers, view: gc.View):
    layers["visibility.lamp-4"] = np.ones_like(layers["visibility.lamp-4"])


@in_scene("dark", "direct light of the formula", "another frame")
def light_in_the_world_instead_of_on_the_camera(scene: Path):
    edit_lights(scene, lambda light: replace(light, frame="world"))
    edit_index(scene, "capture/capture.json", light_on_camera=False)


@in_scene("multilight", "direct light of the formula", "another frame, axis, angle")
def full_angles_of_a_spot_light(scene: Path):
    def double(light: gc.Light) -> gc.Light:
        if isinstance(light, gc.SpotLight):
            return replace(light, beam_width=2 * light.beam_width, cutoff_angle=2 * light.cutoff_angle)
        return light

    edit_lights(scene, double)


@in_scene("multilight", "direct light of the formula", "swapped lights")
def powers_of_two_lights_swapped(scene: Path):
    lights = {light.name: light for light in gc.read_lights(scene / "truth" / "lights.json")}
    softbox, bulb = lights["lamp-1"], lights["lamp-2"]
    assert isinstance(softbox, gc.RectangleLight)
    assert isinstance(bulb, gc.SphereLight)
    swapped = {"lamp-1": bulb.radiance, "lamp-2": softbox.radiance}
    edit_lights(
        scene, lambda light: replace(light, radiance=swapped[light.name]) if light.name in swapped else light
    )


@in_scene("multilight", "colour of direct light", "tinted by [1.5, 0.75, 0.75]")
def color_of_a_light_tinted(scene: Path):
    edit_lights(scene, lambda light: tinted(light) if isinstance(light, gc.SphereLight) else light)


def tinted(light: gc.SphereLight) -> gc.SphereLight:
    red, green, blue = light.radiance
    return replace(light, radiance=(red / 1.5, green / 0.75, blue / 0.75))


@in_scene("tabletop", "direct light of the formula", "another frame, axis")
def environment_turned(scene: Path):
    path = scene / "truth" / "environment.exr"
    gc.write_rgb(path, np.roll(gc.read_rgb(path), 32, axis=1))


@in_scene("tabletop", "environment of the spec", "one that is mirrored")
def environment_mirrored(scene: Path):
    path = scene / "truth" / "environment.exr"
    gc.write_rgb(path, gc.read_rgb(path)[:, ::-1])


# effects of the target


@in_layers("tabletop", "footprint of the target", "looks like a mask that is lost")
def no_effect_marked(layers: Layers, view: gc.View):
    for name in [n for n in layers if n.startswith("effect.")]:
        layers[name] = np.zeros_like(layers[name])


@in_layers("tabletop", "untouched pixels marked", "looks like a mask that is lost")
def nothing_untouched(layers: Layers, view: gc.View):
    layers["effect.untouched"] = np.zeros_like(layers["effect.untouched"])


@in_layers("tabletop", "effects marked", "looks like masks that are lost")
def no_shadow_and_no_mirror_image(layers: Layers, view: gc.View):
    for name in ("shadow", "mirror", "bleeding"):
        layers[f"effect.{name}"] = np.zeros_like(layers[f"effect.{name}"])


@in_layers("tabletop", "footprint at the target", "mask of another object or view")
def footprint_of_everything(layers: Layers, view: gc.View):
    layers["effect.footprint"] = np.ones_like(layers["effect.footprint"])


@in_layers("tabletop", "effects again", "effect.shadow is where another rendering has it", views=1)
def no_shadow(layers: Layers, view: gc.View):
    layers["effect.shadow"] = np.zeros_like(layers["effect.shadow"])


# changed lights


def swap_edits(scene: Path, a: str, b: str) -> None:
    for path in (scene / "truth" / "relighting" / a / "views").iterdir():
        swap_files(path, scene / "truth" / "relighting" / b / "views" / path.name)


@in_scene("multilight", "relit by its parts", "looks like the picture of another edit")
def pictures_of_two_edits_swapped(scene: Path):
    swap_edits(scene, "without-lamp-1", "without-lamp-2")


@in_scene("multilight", "relit again: level", "is that of an independent rendering", views=1)
def pictures_of_two_surroundings_swapped(scene: Path):
    swap_edits(scene, "environment-1", "environment-2")


@in_scene("tabletop", "relit by its parts", "or of other light")
def relit_pictures_twice_as_bright(scene: Path):
    for path in (scene / "truth" / "relighting").glob("*/views/*.exr"):
        gains = {name: 4 if name.endswith(".var") else 2 for name in gc.read_layers(path)}
        gc.write_layers(path, {name: values * gains[name] for name, values in gc.read_layers(path).items()})


@in_scene("multilight", "relit halves average", "halves of another edit")
def halves_of_another_edit(scene: Path):
    folder = scene / "truth" / "relighting"
    for path in (folder / "environment-1" / "views").iterdir():
        other = gc.read_layers(folder / "environment-2" / "views" / path.name)
        halves = {name: other[name] for name in ("radiance.half_a", "radiance.half_b")}
        gc.write_layers(path, gc.read_layers(path) | halves)


@in_scene("dark", "relit layers", "missing are ['radiance.half_a'", views=1)
def relit_without_its_noise(scene: Path):
    for path in (scene / "truth" / "relighting" / "flash-moved" / "views").iterdir():
        gc.write_layers(path, {"radiance": gc.read_layers(path)["radiance"]})


@in_scene("dark", "lights of the edits", "other ones are of without-")
def lights_of_the_edits_lost(scene: Path):
    for path in (scene / "truth" / "relighting").glob("*/lights.json"):
        gc.write_lights(path, ())


@in_scene("multilight", "lights of the edits", "environment-1, environment-2")
def surroundings_of_two_edits_swapped(scene: Path):
    folder = scene / "truth" / "relighting"
    swap_files(folder / "environment-1" / "environment.exr", folder / "environment-2" / "environment.exr")


@in_scene("dark", "edits of the spec", "flash-moved")
def an_edit_left_out(scene: Path):
    edits = [e for e in gc.read_json(scene / "truth" / "truth.json")["edits"] if e["name"] != "flash-moved"]
    edit_index(scene, "truth/truth.json", edits=edits)


@in_scene("dark", "files", "expected truth/relighting/flash-moved/views/test_001.exr, got none")
def a_relit_picture_missing(scene: Path):
    (scene / "truth" / "relighting" / "flash-moved" / "views" / "test_001.exr").unlink()


# what the index says of all views


@in_scene("tabletop", "noise ceiling", "variance of another rendering")
def a_noise_ceiling_of_nothing(scene: Path):
    edit_index(scene, "truth/truth.json", noise_ceiling=99.0)


@in_scene("tabletop", "noise ceiling", "got none")
def no_noise_ceiling(scene: Path):
    edit_index(scene, "truth/truth.json", noise_ceiling=None)


@in_scene("dark", "diameter", "has a diagonal of")
def another_diameter(scene: Path):
    edit_index(scene, "truth/truth.json", diameter=1234.0)


# noise


@in_layers("dark", "variance of the mean", "looks like identical halves")
def identical_halves(layers: Layers, view: gc.View):
    layers["radiance.half_a"] = layers["radiance.half_b"] = layers["radiance"]


@in_layers("multilight", "variance of the mean", "variance of one image")
def variance_of_an_image_instead_of_the_mean(layers: Layers, view: gc.View):
    layers["radiance.var"] = layers["radiance.var"] * 4


@in_layers("tabletop", "halves average", "halves of another picture")
def halves_of_another_picture(layers: Layers, view: gc.View):
    for end in ("half_a", "half_b"):
        layers[f"radiance.{end}"] = layers[f"counterfactual.radiance.{end}"]


# values, files


@in_layers("tabletop", "values in float32", "float16")
def truth_in_half_precision(layers: Layers, view: gc.View):
    for name in layers:
        layers[name] = layers[name].astype(np.float16) if name != "object_id" else layers[name]


@in_layers("dark", "values finite", "expected finite values in radiance")
def one_pixel_not_a_number(layers: Layers, view: gc.View):
    layers["radiance"][3, 4, 1] = np.nan


@in_layers("dark", "values in range", "expected base_color in [0, 1]")
def colors_of_eight_bits(layers: Layers, view: gc.View):
    layers["base_color"] = layers["base_color"] * 255


@in_scene("dark", "files", "breaks off")
def truncated_file(scene: Path):
    path = scene / "truth" / "views" / "train_000.exr"
    path.write_bytes(path.read_bytes()[:-2000])


@in_scene("tabletop", "files", "got none")
def view_missing(scene: Path):
    (scene / "truth" / "views" / "train_000.exr").unlink()


@in_scene("multilight", "files", "expected finite values in radiance")
def relit_picture_not_a_number(scene: Path):
    path = next((scene / "truth" / "relighting").glob("*/views/*.exr"))
    layers = gc.read_layers(path)
    layers["radiance"][0, 0, 0] = np.inf
    gc.write_layers(path, layers)


@in_scene("dark", "files", "list other views")
def views_listed_for_the_truth_alone(scene: Path):
    path = scene / "capture" / "capture.json"
    edit_index(scene, "capture/capture.json", views=gc.read_json(path)["views"][1:])


@in_scene("tabletop", "files", "expected images of 48x48, got sizes")
def photograph_of_another_size(scene: Path):
    path = scene / "capture" / "photographs" / "train_000.exr"
    gc.write_rgb(path, gc.read_rgb(path)[:, :40])


@in_scene("tabletop", "files", "expected a whole EXR file")
def mask_that_is_no_image(scene: Path):
    (scene / "capture" / "masks" / "target" / "train_000.exr").write_text("no image")


# captures


@in_scene("dark", "photograph is the radiance", "another filter")
def photograph_with_a_gaussian_filter(scene: Path):
    for path in (scene / "capture" / "photographs").iterdir():
        gc.write_rgb(path, ndimage.gaussian_filter(gc.read_rgb(path), (0.5, 0.5, 0)))


@in_scene("multilight", "exposure", "99th percentile")
def exposure_of_a_view(scene: Path):
    brightest = np.percentile(gc.read_rgb(scene / "capture" / "photographs" / "train_000.exr"), 99)
    for part in ("capture", "truth"):
        edit_index(scene, f"{part}/{part}.json", exposure=float(1 / brightest))


# pictures


def scale_picture(layers: Layers, factor: np.ndarray | float) -> None:
    """A gain that all that depends on the radiance follows, so that no sum betrays it."""
    for name in [n for n in layers if n.startswith(("radiance", "emitted", "direct.", "indirect."))]:
        layers[name] = layers[name] * (factor**2 if name.endswith(".var") else factor)


@in_layers("tabletop", "radiance again: level", "channel G", views=3)
def half_a_percent_of_gain_in_one_channel(layers: Layers, view: gc.View):
    scale_picture(layers, np.array([1, 1.005, 1]))


@in_layers("dark", "radiance again: level", "% off", views=1)
def one_light_missing_in_the_picture(layers: Layers, view: gc.View):
    names = [n for n in layers if n.endswith(".ambient") and n.startswith(("direct.", "indirect."))]
    lost = np.sum([layers[n] for n in names if "irradiance" not in n], axis=0)
    for name in ("radiance", "radiance.half_a", "radiance.half_b"):
        layers[name] = layers[name] - lost


@in_layers("multilight", "radiance again: level", "% off", views=1)
def radiance_encoded(layers: Layers, view: gc.View):
    for name in ("radiance", "radiance.half_a", "radiance.half_b"):
        layers[name] = gc.srgb_encode(layers[name])


@in_layers("dark", "radiance again: pattern", "show something else", views=1)
def picture_of_another_paint(layers: Layers, view: gc.View):
    """A texture that is brighter here and darker there: no mean tells."""
    stripes = 1 + 0.2 * (-1) ** np.arange(48)[:, None]
    for name in ("radiance", "radiance.half_a", "radiance.half_b"):
        layers[name] = layers[name] * stripes


@in_layers("tabletop", "radiance again: place", "shifted by (+0.", views=1)
def picture_half_a_pixel_off(layers: Layers, view: gc.View):
    for name in ("radiance", "radiance.half_a", "radiance.half_b"):
        layers[name] = ndimage.shift(layers[name], (0, 0.5, 0), order=1, mode="nearest")


@in_scene("multilight", "radiance again: level", "% off", views=1)
def one_bounce_less(scene: Path):
    render_otherwise(scene, "radiance", replace(_settings(scene), max_depth=2), seed=1000)


@in_scene("tabletop", "counterfactual's random numbers", "another seed")
def counterfactual_with_another_seed(scene: Path):
    render_otherwise(scene, "counterfactual.radiance", _settings(scene), seed=5)


@in_layers("tabletop", "target removed", "still there")
def counterfactual_with_its_target(layers: Layers, view: gc.View):
    for end in ("", ".var", ".half_a", ".half_b"):
        layers[f"counterfactual.radiance{end}"] = layers[f"radiance{end}"]


def _settings(scene: Path) -> RenderSettings:
    manifest = gc.read_manifest(scene / "truth", "graycard-truth")
    return gc.decode(RenderSettings, manifest.settings["render"])


def render_otherwise(scene: Path, name: str, settings: RenderSettings, seed: int) -> None:
    """Replace a picture by one that is rendered with other settings or another seed."""
    from graycard.synth._mitsuba import load_scene
    from graycard.synth._separation import estimate
    from graycard.synth._views import radiance_images, sub_buffer_seeds

    manifest = gc.read_manifest(scene / "truth", "graycard-truth")
    spec = SceneSpec(manifest.track, str(manifest.settings["family"]), 1000)
    built = family_of(spec).build(1000, settings)
    numbers = {view.name: number for number, view in enumerate(built.views)}

    def replace_picture(layers: Layers, view: gc.View):
        without = built.target if name.startswith("counterfactual") else ""
        loaded = load_scene(built, view.camera, without=without)
        seeds = sub_buffer_seeds(seed, numbers[view.name])
        layers |= estimate(name, radiance_images(loaded, view.camera, seeds, settings))

    edit(scene, replace_picture)


def failures(scene: Path, views: int) -> dict[str, list[str]]:
    """All reasons of the failed checks, by the name of the check."""
    verdict = verify_dataset(scene.parents[1], views or 1, render=views > 0)
    found: dict[str, list[str]] = {}
    for check in verdict.checks:
        if check.status == "failed":
            found.setdefault(check.name, []).append(check.reason)
    return found


@pytest.mark.parametrize("track", gc.TRACKS)
def test_a_scene_without_a_fault_passes(copied: Copied, track: str):
    assert failures(copied(track), 2) == {}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found_by_name(copied: Copied, name: str):
    fault = FAULTS[name]
    scene = copied(fault.track)
    fault.plant(scene)
    reseal(scene)
    found = failures(scene, fault.views)
    assert fault.check in found, list(found)
    assert any(fault.says in reason for reason in found[fault.check]), found[fault.check]


@pytest.mark.parametrize("track", gc.TRACKS)
def test_every_fault_is_of_a_kind_that_a_whole_scene_has_not(copied: Copied, track: str):
    """Rewriting and sealing the files, which each fault does, is no fault by itself."""
    scene = copied(track)
    edit(scene, lambda layers, view: None)
    reseal(scene)
    assert failures(scene, 0) == {}
