# SPDX-License-Identifier: Apache-2.0
"""Faults that a method can have against its contract, each with its mend."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of fault."""

    title: str
    mend: str


KINDS = {
    "import": Kind("it cannot be imported", "Mend the lines that are shown"),
    "declaration": Kind(
        "it is no method",
        "Give it summary, needs, settings_type, fit and load, as docs/tutorials/your-method.md shows",
    ),
    "settings": Kind("its settings can be changed", "Write @dataclass(frozen=True) above settings_type"),
    "fit": Kind("its fit fails", "Mend the lines that are shown"),
    "refuses": Kind(
        "it refuses every capture of the check",
        "Let it fit one of them, or give it what it asks for: --priors, --settings",
    ),
    "decomposition": Kind(
        "its fit gives no decomposition",
        "Return an object with provides (a set of layer names), render, lights and save",
    ),
    "progress": Kind("progress is called wrongly", 'Call progress(done, "doing what") with done from 0 to 1'),
    "silent": Kind("a long fit never calls progress", "Call progress now and then in the loop of fit"),
    "cancel": Kind(
        "Ctrl-C does not stop it", "Do not catch KeyboardInterrupt or BaseException around progress"
    ),
    "seed": Kind(
        "the same seed gives other results",
        "Draw from numpy.random.default_rng(seed), or torch.manual_seed(seed)",
    ),
    "layers": Kind(
        "render does not give the layers that are asked for",
        "Return {name: array for name in layers}, each of them and no other",
    ),
    "render": Kind("rendering fails", "Mend the lines that are shown"),
    "stateful": Kind("a view rendered twice differs", "Let render change nothing that it reads"),
    "channels-first": Kind("an array is (C, H, W)", "Return (H, W, C): values.transpose(1, 2, 0)"),
    "shape": Kind(
        "an array has another shape than its view",
        "Return (H, W, 3) for colours and normals, (H, W) for all else, as large as the camera",
    ),
    "size": Kind(
        "views of other sizes than trained fail",
        "Render by camera.width and camera.height, or raise MethodError and say what cannot be rendered",
    ),
    "tensor": Kind("a tensor in place of an array", "Return values.detach().cpu().numpy()"),
    "dtype": Kind("values are no measured numbers", "Return floating point: 0 to 1, not codes of 0 to 255"),
    "not-finite": Kind(
        "values are NaN or infinite", "Write 0 where nothing is seen; depth and distance may be +inf there"
    ),
    "range": Kind("values are out of range", "Write reflectance, roughness and metallic from 0 to 1"),
    "encoding": Kind("light or albedo is sRGB-encoded, or decoded twice", "Write linear values"),
    "exposure": Kind(
        "light is exposed, or exposed twice",
        "Write W/m²/sr: photographs are so; divide by capture.exposure else",
    ),
    "factor": Kind("values are off by a factor of π", "Write radiance and reflectance, not their integrals"),
    "channel-order": Kind("colours are B, G, R", "Write R, G, B"),
    "normal-axes": Kind(
        "normals are in other axes than the world's",
        "Rotate OpenCV axes to the world: n @ camera.camera_to_world[:3, :3].T",
    ),
    "normal-code": Kind("normals are encoded", "Write n itself, from -1 to 1"),
    "normal-length": Kind("normals have no unit length", "Divide by the length"),
    "depth-kind": Kind(
        "depth is not z", "Write z along the optical axis: distance * (rays @ camera.forward)"
    ),
    "depth-scale": Kind("depth has another unit or scale", "Write metres of the capture's own world"),
    "roughness": Kind("roughness is another quantity", "Write roughness, the square root of alpha"),
    "pictures": Kind(
        "whole pictures are mirrored, moved or exchanged", "Row 0 is the top, column 0 the left"
    ),
    "lights": Kind("its lights are none", "Return a tuple of graycard lights, or None if it looks for none"),
    "light-frame": Kind("lights are in another frame", 'Set frame to "world" or "camera", OpenCV axes'),
    "light-unit": Kind("lights have another unit", "Write W/sr for points, W/m²/sr for areas"),
    "relight": Kind(
        "relighting does not follow the lights", "Render radiance under the lights that are given"
    ),
    "remove": Kind(
        "removal fails", "Return a decomposition that renders radiance of every view without the object"
    ),
    "save": Kind("it cannot be saved", "Write files to the folder that save is given"),
    "pickle": Kind("it saves pickles, which run code when they are read", "Write safetensors, NPY or JSON"),
    "load": Kind("it cannot be loaded", "Mend the lines that are shown"),
    "round-trip": Kind("what is loaded differs from what was saved", "Save all that render reads"),
    "writes": Kind(
        "it writes outside of its folder", "Write to the folder that save is given, or to tempfile"
    ),
    "truth": Kind("it reaches for the truth", "Fit from the capture; name what it is to be told in needs"),
    "network": Kind("it opens a connection", "Fetch weights before, and name them with --allow or --priors"),
    "slow": Kind(
        "rendering is slow", "A tiny view should take milliseconds; a real one is 16 times as large"
    ),
    "hangs": Kind(
        "it does not end", "Give it fewer steps, as --settings iterations=5, or a longer --timeout"
    ),
    "ends": Kind(
        "it ends its process", "Raise MethodError; do not call exit, and look for crashes in native code"
    ),
    "command": Kind("the command fails", "Mend what its last lines say"),
    "outputs": Kind("its outputs cannot be read", "Write every view, as large as its camera"),
}
"""Kinds of faults by their names."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a method."""

    name: str
    """One of :data:`KINDS`."""
    found: str = ""
    """Finding, with the layer."""
    trace: str = ""
    """Traceback, cut to lines of the method; empty where nothing was raised."""

    @property
    def title(self) -> str:
        """Return what is wrong."""
        return KINDS[self.name].title

    @property
    def mend(self) -> str:
        """Return what to do."""
        return KINDS[self.name].mend


def once(faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """Return faults, the first of each name, in the order of :data:`KINDS`."""
    found: dict[str, Fault] = {}
    for fault in faults:
        found.setdefault(fault.name, fault)
    return tuple(found[name] for name in KINDS if name in found)
