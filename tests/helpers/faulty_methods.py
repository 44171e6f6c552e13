# SPDX-License-Identifier: Apache-2.0
"""Methods that are right but for one fault each, for the check to find; ``Right`` has none.

They know the tiny scene, so that what they render is as good as true but for the fault.
"""

import contextlib
import dataclasses
import json
import os
import pickle
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from graycard import (
    Camera,
    Capture,
    EnvironmentLight,
    Light,
    MethodError,
    PointLight,
    Progress,
    srgb_decode,
    srgb_encode,
)
from graycard.methods import NoSettings
from graycard.tiny import LAMP, shade

Arrays = dict[str, Any]
LAYERS = ("base_color", "depth", "normal", "radiance")


@dataclass
class Made:
    """Give a decomposition that is as true as can be."""

    method: str = "Right"
    with_target: bool = True
    gain: float = 1.0
    provides: ClassVar[frozenset[str]] = frozenset(LAYERS)

    def render(self, camera: Camera, layers: Sequence[str]) -> Any:
        found = shade(camera, self.with_target)
        found["radiance"] = found["radiance"] * np.float32(self.gain)
        found["depth"] = np.where(np.isfinite(found["depth"]), found["depth"], np.inf)
        return {name: found[name] for name in layers}

    def lights(self) -> Any:
        return (LAMP,)

    def relight(self, lights: tuple[Light, ...]) -> Any:
        lamp = lights[0]
        assert isinstance(lamp, PointLight)
        return dataclasses.replace(self, gain=lamp.intensity[0] / LAMP.intensity[0])

    def remove(self, object_id: int) -> Any:
        return dataclasses.replace(self, with_target=False)

    def save(self, folder: Path) -> None:
        (folder / "made.json").write_text(json.dumps({"gain": self.gain}))


class Right:
    """A method without a fault."""

    summary: Any = "The tiny scene, known by heart"
    needs: Any = ()
    settings_type: Any = NoSettings
    made: ClassVar[type[Made]] = Made

    def fit(self, capture: Capture, priors: Any, settings: Any, seed: int, progress: Progress) -> Any:
        progress(0.0, "looking")
        return self.made()

    def load(self, folder: Path) -> Any:
        return self.made(gain=json.loads((folder / "made.json").read_text())["gain"])


def changed(**changes: Callable[[Arrays, Camera], Any]) -> type[Right]:
    """Return a method that renders layers changed by functions of the layers and the camera."""

    class Changed(Made):
        def render(self, camera: Camera, layers: Sequence[str]) -> Any:
            found = super().render(camera, LAYERS)
            return {name: changes[name](found, camera) if name in changes else found[name] for name in layers}

    return type("Method", (Right,), {"made": Changed})


def with_made(**members: Any) -> type[Right]:
    """Return a method whose decomposition has other members."""
    return type("Method", (Right,), {"made": type("Other", (Made,), members)})


def with_fit(fit: Callable[..., Any]) -> type[Right]:
    """Return a method that fits in another way; it is called with capture, seed and progress."""

    def fitted(self: Any, capture: Any, priors: Any, settings: Any, seed: int, progress: Any) -> Any:
        return fit(self, capture, seed, progress)

    return type("Method", (Right,), {"fit": fitted})


def _camera_axes(sign: Sequence[float]) -> Callable[[Arrays, Camera], Any]:
    return lambda found, camera: (found["normal"] @ camera.camera_to_world[:3, :3]) * sign


def _tensor(found: Arrays, camera: Camera) -> Any:
    import torch

    return torch.from_numpy(found["base_color"]).requires_grad_()


def _spoilt(layer: str, value: float) -> Callable[[Arrays, Camera], Any]:
    def spoil(found: Arrays, camera: Camera) -> Any:
        values = found[layer].copy()
        values[3, 4] = value
        return values

    return spoil


def _distance(found: Arrays, camera: Camera) -> Any:
    return found["depth"] / (camera.rays() @ camera.forward)


def _small(found: Arrays, camera: Camera) -> Any:
    return found["base_color"][::2, ::2]


def _swallows(self: Any, capture: Any, seed: int, progress: Any) -> Any:
    with contextlib.suppress(BaseException):
        progress(0.5, "half way")
    return self.made()


def _works_silently(self: Any, capture: Any, seed: int, progress: Any) -> Any:
    _burn(3.5)
    return self.made()


def _burn(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        sum(range(10_000))


class Unseeded(Made):
    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.noise = float(np.random.default_rng().uniform(0.5, 1))

    def render(self, camera: Camera, layers: Sequence[str]) -> Any:
        found = super().render(camera, layers)
        return {k: v * np.float32(self.noise) if k == "base_color" else v for k, v in found.items()}


class Stateful(Made):
    calls = 0

    def render(self, camera: Camera, layers: Sequence[str]) -> Any:
        self.calls += 1
        found = super().render(camera, layers)
        gain = np.float32(1 + 0.01 * self.calls)
        return {k: v * gain if k == "base_color" else v for k, v in found.items()}


class OneSize(Made):
    def render(self, camera: Camera, layers: Sequence[str]) -> Any:
        found = super().render(camera, layers)
        return {name: np.reshape(v, (24, 28, *v.shape[2:])) for name, v in found.items()}


class Slow(Made):
    def render(self, camera: Camera, layers: Sequence[str]) -> Any:
        _burn(1.2)
        return super().render(camera, layers)


class Missing(Made):
    def render(self, camera: Camera, layers: Sequence[str]) -> Any:
        return {k: v for k, v in super().render(camera, layers).items() if k != "normal"}


class Besides(Made):
    def render(self, camera: Camera, layers: Sequence[str]) -> Any:
        return super().render(camera, LAYERS)


class Bare(Made):
    def render(self, camera: Camera, layers: Sequence[str]) -> Any:
        return super().render(camera, LAYERS)["base_color"]


class Breaks(Made):
    def render(self, camera: Camera, layers: Sequence[str]) -> Any:
        return {"base_color": np.zeros(3)[7]}


def _save_pickle(self: Any, folder: Path) -> None:
    (folder / "made.pkl").write_bytes(pickle.dumps({"gain": self.gain}))
    Made.save(self, folder)


def _save_objects(self: Any, folder: Path) -> None:
    np.save(folder / "made.npy", np.array([{"gain": 1}], dtype=object))
    Made.save(self, folder)


def _save_elsewhere(self: Any, folder: Path) -> None:
    try:
        (Path.cwd() / "graycard-left-behind.txt").write_text("here")
        os.remove(Path.cwd() / "graycard-left-behind.txt")
    except OSError:
        pass
    Made.save(self, folder)


def _read_truth(self: Any, capture: Any, seed: int, progress: Any) -> Any:
    progress(0.0, "looking")
    with contextlib.suppress(OSError, MethodError):
        (capture.root.parent / "truth" / "truth.json").read_text()
    return self.made()


def _connect(self: Any, capture: Any, seed: int, progress: Any) -> Any:
    progress(0.0, "fetching weights")
    with contextlib.suppress(OSError):
        socket.socket().close()
    return self.made()


def _raise(self: Any, *_: Any) -> Any:
    raise ZeroDivisionError("by nothing")


def _load_other(self: Any, folder: Path) -> Any:
    return Halved()


class Halved(Made):
    def render(self, camera: Camera, layers: Sequence[str]) -> Any:
        found = super().render(camera, layers)
        return {name: v / 2 if name == "base_color" else v for name, v in found.items()}


@dataclass
class Open:
    """Settings that can be changed."""

    steps: int = 3


def _percent(self: Any, capture: Any, seed: int, progress: Any) -> Any:
    progress(50, "half way")
    return self.made()


def _lone(self: Any, capture: Any, seed: int, progress: Any) -> Any:
    progress(0.5)
    return self.made()


def _refuse(self: Any, capture: Any, seed: int, progress: Any) -> Any:
    raise MethodError("expected photographs of a cellar, got others")


def _moved_lamp(self: Any) -> Any:
    x, y, z = LAMP.position
    return (dataclasses.replace(LAMP, position=(x, y, z + 0.9), frame="world"),)


def _codes(found: Arrays, camera: Camera) -> Any:
    return np.round(255 * np.clip(found["base_color"], 0, 1)).astype(np.uint8)


def _exposed(found: Arrays, camera: Camera) -> Any:
    return found["radiance"] * np.float32(EXPOSURE)


EXPOSURE = 3.2564120292663574
"""Exposure of the tiny scene as the check writes it."""

FAULTS: dict[str, tuple[Any, str]] = {
    "no-method": (type("Method", (), {"summary": "x"}), "declaration"),
    "unknown-need": (type("Method", (Right,), {"needs": ("colour",)}), "declaration"),
    "settings-open": (type("Method", (Right,), {"settings_type": Open}), "settings"),
    "fit-raises": (with_fit(_raise), "fit"),
    "refuses": (with_fit(_refuse), "refuses"),
    "reads-held-out": (
        with_fit(lambda self, capture, seed, progress: capture.photograph(capture.test[0])), "fit",
    ),
    "gives-nothing": (with_fit(lambda self, capture, seed, progress: None), "decomposition"),
    "unknown-layer": (with_made(provides=frozenset({"colour"})), "decomposition"),
    "percent": (with_fit(_percent), "progress"),
    "lone-progress": (with_fit(_lone), "progress"),
    "silent": (with_fit(_works_silently), "silent"),
    "swallows": (with_fit(_swallows), "cancel"),
    "unseeded": (type("Method", (Right,), {"made": Unseeded}), "seed"),
    "missing-layer": (type("Method", (Right,), {"made": Missing}), "layers"),
    "layer-besides": (type("Method", (Right,), {"made": Besides}), "layers"),
    "bare-array": (type("Method", (Right,), {"made": Bare}), "layers"),
    "render-raises": (type("Method", (Right,), {"made": Breaks}), "render"),
    "stateful": (type("Method", (Right,), {"made": Stateful}), "stateful"),
    "channels-first": (changed(base_color=lambda f, c: f["base_color"].transpose(2, 0, 1)), "channels-first"),
    "half-size": (changed(base_color=_small), "shape"),
    "third-axis": (changed(depth=lambda f, c: f["depth"][..., None]), "shape"),
    "one-size": (type("Method", (Right,), {"made": OneSize}), "size"),
    "tensor": (changed(base_color=_tensor), "tensor"),
    "codes": (changed(base_color=_codes), "dtype"),
    "none": (changed(base_color=lambda f, c: None), "dtype"),
    "complex": (changed(base_color=lambda f, c: f["base_color"] + 1j), "dtype"),
    "nan": (changed(base_color=_spoilt("base_color", np.nan)), "not-finite"),
    "inf": (changed(normal=_spoilt("normal", np.inf)), "not-finite"),
    "percent-albedo": (changed(base_color=lambda f, c: 100 * f["base_color"]), "range"),
    "srgb-albedo": (changed(base_color=lambda f, c: srgb_encode(f["base_color"])), "encoding"),
    "srgb-light": (changed(radiance=lambda f, c: srgb_encode(f["radiance"])), "encoding"),
    "displayed": (changed(radiance=lambda f, c: srgb_encode(f["radiance"] * EXPOSURE)), "encoding"),
    "decoded-twice": (changed(base_color=lambda f, c: srgb_decode(f["base_color"])), "encoding"),
    "exposed": (changed(radiance=_exposed), "exposure"),
    "irradiance": (changed(radiance=lambda f, c: np.pi * f["radiance"]), "factor"),
    "bgr": (changed(base_color=lambda f, c: f["base_color"][..., ::-1]), "channel-order"),
    "opengl": (changed(normal=_camera_axes((1, -1, -1))), "normal-axes"),
    "opencv": (changed(normal=_camera_axes((1, 1, 1))), "normal-axes"),
    "y-up": (changed(normal=lambda f, c: f["normal"][..., [0, 2, 1]] * (1, 1, -1)), "normal-axes"),
    "inward": (changed(normal=lambda f, c: -f["normal"]), "normal-axes"),
    "coded-normal": (changed(normal=lambda f, c: (f["normal"] + 1) / 2), "normal-code"),
    "long-normal": (changed(normal=lambda f, c: 3 * f["normal"]), "normal-length"),
    "distance": (changed(depth=_distance), "depth-kind"),
    "disparity": (changed(depth=lambda f, c: 1 / f["depth"]), "depth-kind"),
    "millimetres": (changed(depth=lambda f, c: 1000 * f["depth"]), "depth-scale"),
    "scaled-world": (changed(depth=lambda f, c: 0.37 * f["depth"]), "depth-scale"),
    "upside-down": (
        changed(**{name: (lambda f, c, name=name: f[name][::-1]) for name in LAYERS}), "pictures",
    ),
    "light-words": (with_made(lights=lambda self: ["lamp"]), "lights"),
    "light-image": (with_made(lights=lambda self: (EnvironmentLight("sky", "sky.exr"),)), "lights"),
    "light-frame": (
        with_made(lights=lambda self: (dataclasses.replace(LAMP, frame="world"),)), "light-frame",
    ),
    "light-power": (
        with_made(
            lights=lambda self: (
                dataclasses.replace(LAMP, intensity=tuple(4 * np.pi * x for x in LAMP.intensity)),
            )
        ),
        "light-unit",
    ),
    "relight-ignores": (with_made(relight=lambda self, lights: self), "relight"),
    "relight-raises": (with_made(relight=_raise), "relight"),
    "remove-raises": (with_made(remove=_raise), "remove"),
    "remove-none": (with_made(remove=lambda self, number: None), "remove"),
    "save-raises": (with_made(save=_raise), "save"),
    "saves-nothing": (with_made(save=lambda self, folder: None), "save"),
    "pickle": (with_made(save=_save_pickle), "pickle"),
    "objects": (with_made(save=_save_objects), "pickle"),
    "load-raises": (type("Method", (Right,), {"load": _raise}), "load"),
    "load-other": (type("Method", (Right,), {"load": _load_other}), "round-trip"),
    "writes": (with_made(save=_save_elsewhere), "writes"),
    "truth": (with_fit(_read_truth), "truth"),
    "network": (with_fit(_connect), "network"),
    "slow": (type("Method", (Right,), {"made": Slow}), "slow"),
}  # fmt: skip
"""Methods by their fault, each with the name that the check is to give it."""

ENDS: dict[str, tuple[Any, str]] = {
    "exits": (with_fit(lambda *_: os._exit(3)), "ends"),
    "hangs": (with_fit(lambda *_: time.sleep(600)), "hangs"),
    "starts-programs": (
        with_fit(lambda self, *_: (subprocess.run([sys.executable, "-c", "pass"]), self.made())[1]), "",
    ),
}  # fmt: skip
"""Methods that need a process of their own, each with the name of its fault."""

for _name, (_method, _) in {**FAULTS, **ENDS}.items():
    globals()[f"has_{_name.replace('-', '_')}"] = _method
