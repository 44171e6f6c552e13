# SPDX-License-Identifier: Apache-2.0
"""A tiny scene with a target, its truth with materials, and what a method may ask about it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from graycard import Capture, View, methods, open_capture, open_truth
from graycard.methods import priors

ASKS = (
    methods.Ask("depth"),
    methods.Ask("normal"),
    methods.Ask("base_color"),
    methods.Ask("roughness"),
    methods.Ask("metallic"),
    methods.Ask("mask", ("glossy", "target")),
    methods.Ask("inpainting", ("radiance",)),
)


@dataclass(frozen=True)
class Scene:
    capture: Capture
    truth: dict[str, dict[str, np.ndarray]]

    @property
    def view(self) -> View:
        return self.capture.train[0]

    @property
    def known(self) -> dict[str, np.ndarray]:
        return self.truth[self.view.name]

    @property
    def photograph(self) -> np.ndarray:
        return self.capture.photograph(self.view) * self.capture.exposure

    def priors(self, spec: priors.PriorSpec, asks: tuple[methods.Ask, ...] = ASKS) -> methods.Priors:
        return priors.make_priors(spec, asks, self.capture, self.truth)


@pytest.fixture
def asks() -> tuple[methods.Ask, ...]:
    """All that can be asked."""
    return ASKS


@pytest.fixture(scope="session")
def scene(tiny_scenes: dict[str, Path]) -> Scene:
    """The tabletop: the floor is glossy, the ball a metal, the target neither."""
    folder = tiny_scenes["tabletop"]
    capture, truth = open_capture(folder / "capture"), open_truth(folder / "truth")
    known = {}
    for view in truth.views:
        layers = dict(truth.layers(view))
        layers["roughness"] = np.array([0.0, 0.2, 0.45, 1.0], np.float32)[layers["object_id"]]
        layers["metallic"] = np.array([0.0, 0.0, 1.0, 0.0], np.float32)[layers["object_id"]]
        known[view.name] = layers
    return Scene(capture, known)


@pytest.fixture
def questions(scene: Scene) -> dict[str, Callable[[methods.Priors, View], np.ndarray]]:
    """By kind, how a method asks about a view whose photograph is the true radiance."""

    def shown(view: View) -> np.ndarray:
        return scene.truth[view.name]["radiance"] * scene.capture.exposure

    def hole(view: View) -> np.ndarray:
        return scene.truth[view.name]["object_id"] == scene.capture.target

    return {
        "depth": lambda p, v: p.depth(shown(v), v),
        "normal": lambda p, v: p.normal(shown(v), v),
        "base_color": lambda p, v: p.base_color(shown(v), v),
        "roughness": lambda p, v: p.roughness(shown(v), v),
        "metallic": lambda p, v: p.metallic(shown(v), v),
        "mask": lambda p, v: p.mask(shown(v), v, "target"),
        "inpainting": lambda p, v: p.inpainting(shown(v), v, hole(v)),
    }
