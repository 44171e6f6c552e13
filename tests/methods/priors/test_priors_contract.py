# SPDX-License-Identifier: Apache-2.0
"""Priors that are refused before any time is spent, and answers that are refused from any source."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from graycard import MethodError, UnknownNameError, View, methods
from graycard.methods import Ask
from graycard.methods.priors import (
    Override,
    PriorSpec,
    check_priors,
    make_priors,
    truth_of,
    unanswered,
    weights_of,
)


@dataclass
class Says:
    """A network that says one thing."""

    what: np.ndarray

    def answer(self, question: methods.Question) -> np.ndarray:
        return self.what


def ask(kind: str, says: np.ndarray, scene, **options) -> np.ndarray:
    told = methods.Priors("pretrained", models={kind: Says(says)})
    return getattr(told, kind)(scene.photograph, scene.view, **options)


SIZE = (24, 28)
BAD_ANSWERS = {
    "size": ("depth", np.ones((24, 27)), r"expected depth of shape \(24, 28\), got \(24, 27\)"),
    "nan": ("depth", np.full(SIZE, np.nan), "prior for depth of view .*: expected finite values in depth"),
    "behind": ("depth", np.full(SIZE, -1.0), "expected depth > 0, got -1"),
    "long": ("normal", np.full((*SIZE, 3), 0.9), "expected normals of length 1"),
    "infinite": ("normal", np.full((*SIZE, 3), np.inf), "expected finite values in normal"),
    "bright": ("base_color", np.full((*SIZE, 3), 1.2), r"expected base_color in \[0, 1\], got 1.2 to 1.2"),
    "negative": ("roughness", np.full(SIZE, -0.1), r"expected roughness in \[0, 1\]"),
    "grey": ("base_color", np.ones(SIZE), r"expected base_color of shape \(24, 28, 3\)"),
}


@pytest.mark.parametrize("case", BAD_ANSWERS)
def test_bad_answers_are_refused(case: str, scene):
    kind, says, message = BAD_ANSWERS[case]
    with pytest.raises(MethodError, match=message):
        ask(kind, says, scene)


def test_bad_masks_and_fillings_are_refused(scene):
    with pytest.raises(MethodError, match="expected bool of .*, got float64"):
        ask("mask", np.ones(SIZE), scene, of="target")
    hole = np.zeros(SIZE, bool)
    with pytest.raises(MethodError, match="expected finite values of shape"):
        ask("inpainting", np.full((*SIZE, 3), np.nan), scene, hole=hole)
    with pytest.raises(MethodError, match="expected a hole of bool and shape"):
        ask("inpainting", np.ones((*SIZE, 3)), scene, hole=hole.astype(float))
    with pytest.raises(UnknownNameError, match="subject of a mask that exists, got 'shiny'"):
        ask("mask", np.ones(SIZE, bool), scene, of="shiny")


def test_bad_images_are_refused(scene):
    told = methods.Priors("pretrained", models={"depth": Says(np.ones(SIZE))})
    with pytest.raises(MethodError, match=r"expected an image of shape \(24, 28, 3\) to ask for depth"):
        told.depth(scene.photograph[:, :5], scene.view)
    broken = scene.photograph.copy()
    broken[3, 4] = np.nan
    with pytest.raises(MethodError, match="expected a finite image to ask for depth of view train_000"):
        told.depth(broken, scene.view)


def test_good_answers_come_as_float64_and_sky_may_be_infinite(scene):
    says = np.full(SIZE, 2.0, np.float32)
    says[:5] = np.inf
    told = ask("depth", says, scene)
    assert told.dtype == np.float64
    assert np.array_equal(told, says)


def test_an_image_with_a_hole_may_hold_anything_there_and_stays_outside(scene):
    hole = np.zeros(SIZE, bool)
    hole[5:9, 6:12] = True
    image = np.where(hole[..., None], np.nan, scene.photograph)
    told = methods.Priors("pretrained", models={"inpainting": Says(np.full((*SIZE, 3), 7.0))})
    filled = told.inpainting(image, scene.view, hole)
    assert np.array_equal(filled[~hole], scene.photograph[~hole])
    assert (filled[hole] == 7.0).all()
    depth = np.ones(SIZE)
    told = methods.Priors("pretrained", models={"inpainting": Says(np.full(SIZE, 7.0))})
    assert np.array_equal(told.inpainting(depth, scene.view, hole, of="depth"), np.where(hole, 7.0, 1.0))


def test_nothing_answers_where_there_is_no_source(scene, asks):
    none = methods.Priors()
    assert none.kinds == frozenset()
    with pytest.raises(MethodError, match="expected a prior that gives depth, got one of source 'none'"):
        none.depth(scene.photograph, scene.view)
    optional = tuple(Ask(a.kind, a.of, optional=True) for a in asks)
    assert scene.priors(PriorSpec(), optional).kinds == frozenset()
    assert scene.priors(PriorSpec("oracle"), optional).kinds == {a.kind for a in asks}
    assert scene.priors(PriorSpec("classical"), optional).kinds == {a.kind for a in asks} - {"mask"}


@pytest.mark.parametrize(
    ("spec", "asked", "message"),
    [
        (PriorSpec(), (Ask("depth"),), "gives depth, got 'none'. One of oracle, classical, pretrained does"),
        (
            PriorSpec("classical"),
            (Ask("mask", ("target",)),),
            "gives mask, got 'classical'. One of oracle, pr",
        ),
        (
            PriorSpec("oracle", overrides={"mask": Override(source="classical")}),
            (Ask("mask", ("target",), optional=True),),
            "expected a source of priors that gives mask, got 'classical'",
        ),
        (
            PriorSpec("oracle"),
            (),
            "expected no priors for a method that asks for none, got oracle, severity 0",
        ),
        (
            PriorSpec("oracle", overrides={"normal": Override(severity=1)}),
            (Ask("depth"),),
            r"expected overrides of what the method asks for \(depth\), got normal",
        ),
        (PriorSpec("pretrained"), (Ask("depth"),), "expected weights for depth priors at a path, got none"),
        (
            PriorSpec("pretrained", path="/nowhere"),
            (Ask("depth"),),
            "expected weights for depth priors at /nowhere/depth.pt, got none. Nothing is downloaded",
        ),
    ],
)
def test_what_does_not_go_together_is_met_before_the_fit(spec: PriorSpec, asked: tuple, message: str):
    with pytest.raises(MethodError, match=message):
        check_priors(spec, asked)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (
            lambda: Ask(cast(Any, "dpeth")),
            UnknownNameError,
            "kind of prior that exists.*did you mean 'depth'",
        ),
        (lambda: Ask("mask"), UnknownNameError, "subject of a mask that exists, got 'photograph'"),
        (lambda: Ask("depth", ()), ValueError, "expected what depth is asked of, got nothing"),
    ],
)
def test_asks_that_cannot_be(make: Callable[[], Ask], error: type[Exception], message: str):
    with pytest.raises(error, match=message):
        make()


def test_only_the_truth_that_answers_is_told(asks):
    assert truth_of(PriorSpec("classical"), asks[:5]) == frozenset()
    assert truth_of(PriorSpec("oracle"), (Ask("roughness"),)) == {"roughness"}
    mixed = PriorSpec("classical", overrides={"metallic": Override(source="oracle")})
    assert truth_of(mixed, asks[:5]) == {"metallic", "object_id"}
    oracle, without = PriorSpec("oracle"), {"counterfactual.radiance"}
    assert truth_of(oracle, (Ask("inpainting", ("radiance", "depth")),)) == without
    assert truth_of(oracle, (Ask("inpainting", ("depth", "albedo")),)) == frozenset()
    of = truth_of(oracle, (Ask("inpainting", ("glossy", "normal")),))
    assert of == {f"counterfactual.{name}" for name in ("f0", "roughness", "normal")}


def test_the_truth_cannot_be_changed_through_an_answer(scene, questions):
    told = scene.priors(PriorSpec("oracle"))
    for kind, question in questions.items():
        first = question(told, scene.view)
        first[...] = 0
        assert question(told, scene.view).any(), kind


def test_an_oracle_knows_its_own_views_and_what_was_declared(scene):
    told = scene.priors(PriorSpec("oracle"))
    stranger = View("train_900", "train", scene.view.camera)
    with pytest.raises(MethodError, match="expected a view of the scene, got 'train_900'"):
        told.depth(scene.photograph, stranger)
    hole = np.zeros(SIZE, bool)
    with pytest.raises(MethodError, match="expected radiance of shape"):
        told.inpainting(np.ones(SIZE), scene.view, hole)
    with pytest.raises(MethodError, match="expected a view of the scene, got 'train_900'"):
        told.inpainting(scene.photograph, stranger, hole)
    known = {view: {"depth": layers["depth"]} for view, layers in scene.truth.items()}
    narrow = make_priors(PriorSpec("oracle"), (Ask("inpainting", ("depth",)),), scene.capture, known)
    with pytest.raises(MethodError, match="expected a method that says which layers it inpaints"):
        narrow.inpainting(scene.photograph, scene.view, hole)


def test_weights_are_hashed_again_when_they_change(tmp_path: Path):
    asked, spec = (Ask("depth"),), PriorSpec("pretrained", path=str(tmp_path))
    (tmp_path / "depth.pt").write_bytes(b"one")
    first = weights_of(spec, asked)
    assert weights_of(spec, asked) == first
    (tmp_path / "depth.pt").write_bytes(b"others")
    second = weights_of(spec, asked)
    (tmp_path / "depth").mkdir()
    (tmp_path / "depth" / "config.json").write_text("{}")
    third = weights_of(spec, asked)
    assert len({*first, *second, *third}) == 3
    assert weights_of(PriorSpec("oracle"), asked) == []


def test_methods_that_declare_no_asks_ask_nothing(scene):
    assert methods.asks_of(methods.load_method("gray")) == ()
    assert make_priors(PriorSpec(), (), scene.capture, {}) == methods.Priors()


def test_what_nothing_answers_is_named_where_it_is_optional():
    asks = (
        Ask("inpainting", ("radiance",)),
        Ask("mask", ("glossy",), optional=True),
        Ask("normal", optional=True),
    )
    assert unanswered(PriorSpec("classical"), asks) == ("mask",)
    assert unanswered(PriorSpec("oracle", 2), asks) == ()
    assert unanswered(PriorSpec("none", overrides={"inpainting": Override("classical")}), asks) == (
        "mask",
        "normal",
    )
