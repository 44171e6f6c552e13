# SPDX-License-Identifier: Apache-2.0
"""From a scene as plain data to Mitsuba's own. Import it only after ``use_renderer``."""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from graycard import (
    Camera,
    EnvironmentLight,
    GaussianLight,
    PointLight,
    RectangleLight,
    SphereLight,
    SpotLight,
    world_position,
)
from graycard.synth._mesh import Mesh
from graycard.synth._scene import (
    Ball,
    Color,
    Conductor,
    Glossy,
    LambertGGX,
    Material,
    Matte,
    Quad,
    Scene,
    Texture,
    Thing,
)
from graycard.synth.renderer._gaussian_light import gaussian_emitter
from graycard.synth.renderer._lambert_ggx import MIN_ALPHA, register
from graycard.synth.renderer._variant import SCALAR

_SKY_TO_WORLD = [[0, 0, -1, 0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
"""Mitsuba's environment has its pole at +y and its seam at -z; in the world these are +z and +x."""


def load_scene(scene: Scene, camera: Camera, without: str = "") -> mi.Scene:
    """Return the scene as one camera sees it, lights on the camera included.

    Args:
        scene: What is there.
        camera: Where lights of the ``camera`` frame are mounted.
        without: Name of a thing to leave out; everything else stays as it is.
    """
    content: dict[str, Any] = {"type": "scene"}
    for number, thing in enumerate(scene.things, start=1):
        if thing.name != without:
            content[shape_key(number)] = _shape(thing, _emitter_of(scene, thing))
    for light in scene.lights:
        if isinstance(light, GaussianLight):
            content[f"light-{light.name}"] = gaussian_emitter(light, camera, _weight(scene, light.name))
        elif isinstance(light, PointLight | SpotLight):
            content[f"light-{light.name}"] = _delta_light(light, camera, _weight(scene, light.name))
        elif isinstance(light, EnvironmentLight) and scene.sky is not None:
            content[f"light-{light.name}"] = _sky(scene.sky, _weight(scene, light.name))
    return load(content)


def load(content: dict[str, Any]) -> Any:
    """Mitsuba's object of a dictionary.

    Its default of ``optimize=True`` merges shapes of one material and orders them by address, so that ids
    are lost and no two runs are alike.
    """
    return mi.load_dict(content, parallel=False, optimize=False)


def shape_key(number: int) -> str:
    """Return the id that a thing's shape has in Mitsuba."""
    return f"thing-{number}"


def object_ids(shape_index: np.ndarray, loaded: mi.Scene, scene: Scene) -> np.ndarray:
    """Our ids, uint32, from Mitsuba's indices of shapes, which depend on what else was loaded before."""
    numbers = {shape_key(n): n for n in range(1, len(scene.things) + 1)}
    ids = np.zeros(shape_index.shape, dtype=np.uint32)
    for order, shape in enumerate(loaded.shapes(), start=1):
        ids[shape_index == _registered(shape, order)] = numbers[shape.id()]
    return ids


def _registered(shape: Any, order: int) -> int:
    if mi.variant() == SCALAR:
        return order
    index: Any = dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))
    return int(index[0])


def sensor(camera: Camera, samples: int) -> mi.Sensor:
    """Return a sensor whose pixel centres look exactly along :meth:`graycard.Camera.rays`.

    Raises:
        ValueError: The pixels are not square, or the principal point is not the image centre.
    """
    return load({**_pinhole(camera), "sampler": {"type": "multijitter", "sample_count": samples}})


def centre_sensor(camera: Camera) -> mi.Sensor:
    """Return a sensor that takes one sample per pixel, at its centre."""
    return load({**_pinhole(camera), "sampler": {"type": "stratified", "sample_count": 1, "jitter": False}})


def _pinhole(camera: Camera) -> dict[str, Any]:
    expected = np.array(
        [[camera.K[0, 0], 0, camera.width / 2], [0, camera.K[0, 0], camera.height / 2], [0, 0, 1]]
    )
    if not np.allclose(camera.K, expected, rtol=1e-9, atol=1e-9):
        raise ValueError(f"expected square pixels and a centred principal point, got {camera.K.tolist()}")
    # Mitsuba's camera axes are x left, y up, z forward
    to_world = camera.camera_to_world @ np.diag([-1.0, -1.0, 1.0, 1.0])
    film = {"type": "hdrfilm", "width": camera.width, "height": camera.height, "pixel_format": "rgb"}
    # a wider filter correlates the noise of neighbours and sums them in an order that varies
    box = {"rfilter": {"type": "box"}, "component_format": "float32"}
    return {
        "type": "perspective",
        "fov_axis": "x",
        "fov": float(2 * np.degrees(np.arctan(0.5 * camera.width / camera.K[0, 0]))),
        "to_world": mi.ScalarTransform4f(to_world.tolist()),
        "film": {**film, **box},
    }


def _shape(thing: Thing, emitter: dict[str, Any] | None) -> Any:
    material = _bsdf(thing.material)
    match thing.geometry:
        case Mesh() as mesh:
            return _mesh(thing.name, mesh, material)
        case Ball(center, radius):
            shape = {"type": "sphere", "center": list(center), "radius": radius}
        case Quad(center, half_u, half_v):
            shape = {"type": "rectangle", "to_world": _quad_to_world(center, half_u, half_v)}
    return {**shape, "bsdf": material} | ({"emitter": emitter} if emitter else {})


def _quad_to_world(center: Any, half_u: Any, half_v: Any) -> mi.ScalarTransform4f:
    """From Mitsuba's rectangle, [-1, 1]² at z = 0 that faces +z."""
    normal = np.cross(half_u, half_v)
    to_world = np.eye(4)
    to_world[:3] = np.stack([half_u, half_v, normal / np.linalg.norm(normal), center], axis=1)
    return mi.ScalarTransform4f(to_world.tolist())


def _mesh(name: str, mesh: Mesh, material: dict[str, Any]) -> mi.Mesh:
    properties = mi.Properties()
    properties["mesh_bsdf"] = load(material)
    smooth = {"has_vertex_normals": True, "has_vertex_texcoords": True}
    shape = mi.Mesh(name, len(mesh.vertices), len(mesh.faces), **smooth, props=properties)
    buffers = mi.traverse(shape)
    buffers["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    buffers["vertex_normals"] = mesh.normals.astype(np.float32).ravel()
    buffers["vertex_texcoords"] = mesh.uv.astype(np.float32).ravel()
    buffers["faces"] = mesh.faces.astype(np.uint32).ravel()
    buffers.update()
    return shape


def _bsdf(material: Material) -> dict[str, Any]:
    match material:
        case Matte(color):
            return {"type": "diffuse", "reflectance": _color(color)}
        case Glossy(color, roughness, metallic, specular):
            return {
                "type": "principled",
                "base_color": _color(color),
                "roughness": roughness,
                "metallic": metallic,
                "specular": specular,
            }
        case LambertGGX(color, roughness, metallic):
            content = {"base_color": _color(color), "roughness": roughness, "metallic": metallic}
            return {"type": register(), **content}
        case Conductor(eta, k, roughness):
            alpha = max(roughness**2, MIN_ALPHA)
            return {
                "type": "roughconductor",
                "distribution": "ggx",
                "alpha": alpha,
                "eta": _rgb(eta),
                "k": _rgb(k),
            }


def _color(color: Color) -> dict[str, Any]:
    if not isinstance(color, Texture):
        return _rgb(color)
    upright = np.ascontiguousarray(color.pixels[::-1], dtype=np.float32)  # Mitsuba has v = 0 in row 0
    u, v = color.repeat
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(upright),
        "raw": True,  # linear already
        "filter_type": "bilinear" if color.smooth else "nearest",
        "to_uv": mi.ScalarTransform3f().scale([u, v]),
    }


def _rgb(color: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(c) for c in color]}


def _emitter_of(scene: Scene, thing: Thing) -> dict[str, Any] | None:
    for light in scene.lights:
        if light.name == thing.light and isinstance(light, RectangleLight | SphereLight):
            return {"type": "area", "radiance": _rgb(light.radiance), **_weight(scene, light.name)}
    return None


def _weight(scene: Scene, light: str) -> dict[str, float]:
    return {"sampling_weight": float(scene.light_weights.get(light, 1.0))}


def _delta_light(light: PointLight | SpotLight, camera: Camera, weight: dict[str, float]) -> dict[str, Any]:
    position = world_position(light, camera)
    if isinstance(light, PointLight):
        return {"type": "point", "position": position.tolist(), "intensity": _rgb(light.intensity), **weight}
    axis = np.array(light.direction)
    axis = camera.camera_to_world[:3, :3] @ axis if light.frame == "camera" else axis
    up = np.eye(3)[np.argmin(np.abs(axis))]
    to_world = mi.ScalarTransform4f().look_at(position.tolist(), (position + axis).tolist(), up.tolist())
    return {
        "type": "spot",
        "to_world": to_world,
        "intensity": _rgb(light.intensity),
        "beam_width": light.beam_width,
        "cutoff_angle": light.cutoff_angle,
        **weight,
    }


def _sky(sky: np.ndarray, weight: dict[str, float]) -> dict[str, Any]:
    mirrored = np.ascontiguousarray(sky[:, ::-1], dtype=np.float32)  # its azimuth runs the other way
    to_world = mi.ScalarTransform4f(_SKY_TO_WORLD)
    return {"type": "envmap", "bitmap": mi.Bitmap(mirrored), "to_world": to_world, **weight}
