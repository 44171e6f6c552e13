# SPDX-License-Identifier: Apache-2.0
"""Stages of ``goris`` are saved: a fit goes on from its own, and from those of fits that share them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from glossy_captures import QUICK, UNTOLD, NothingGlossy, told
from glossy_sheets import GlossyWorld, glossy_world, shots_of_world
from graycard import Capture, MethodError, open_capture
from graycard.io import silent
from graycard.methods.goris import GorisMethod
from graycard.methods.goris._training_views import looked_at
from graycard.methods.priors import PriorSpec
from graycard.methods.surfels import fit_checkpoint


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


@pytest.mark.parametrize(
    "stage",
    ["", ".removal", *(pytest.param(name, marks=pytest.mark.slow) for name in (".light", ".distilled"))],
)
def test_a_fit_that_was_cut_off_goes_on(scene: Path, tmp_path: Path, stage: str):
    """In any of its stages, and ends with the same bits; what was done is not done again."""

    class KilledError(Exception):
        pass

    path, steps = tmp_path / "fit", []

    def kill(done: float, doing: str) -> None:
        if (tmp_path / f"fit{stage}").exists():
            raise KilledError

    capture = open_capture(scene / "capture", check=False)
    priors, method = told(scene, PriorSpec("oracle", 1, overrides=UNTOLD)), GorisMethod()
    settings = replace(QUICK, distilled=True)
    saved = replace(settings, checkpoint=str(path))
    with pytest.raises(KilledError):
        method.fit(capture, priors, saved, 0, kill)
    whole = method.fit(capture, priors, settings, 0, lambda *_: steps.append(1))
    every = len(steps)
    resumed = method.fit(capture, priors, saved, 0, lambda *_: steps.append(1))
    assert len(steps) - every < every
    assert whole.distilled is not None
    assert resumed.distilled is not None
    for ours, theirs in ((whole.after, resumed.after), (whole.distilled, resumed.distilled)):
        for name, values in ours.parameters.all.items():
            assert torch.equal(values, theirs.parameters.all[name]), name


def test_a_later_stage_that_depends_on_other_things_begins_anew_and_other_masks_are_refused(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Another inpainting and other weights of it; masks are what the first stage depends on."""
    capture = open_capture(scene / "capture", check=False)
    saved = replace(QUICK, checkpoint=str(tmp_path / "f"))
    priors, method = told(scene, PriorSpec("oracle", 1, overrides=UNTOLD)), GorisMethod()
    method.fit(capture, priors, saved, 0, silent)
    others = told(scene, PriorSpec("oracle", 4, overrides=UNTOLD))
    for asked, settings in ((others, saved), (priors, replace(saved, hole_weight=0.1))):
        found = method.fit(capture, asked, settings, 0, silent).after.parameters.all
        alone = method.fit(capture, asked, replace(settings, checkpoint=""), 0, silent).after.parameters.all
        assert all(torch.equal(values, found[name]) for name, values in alone.items())
    masks = Capture.target_mask
    monkeypatch.setattr(Capture, "target_mask", lambda self, view: np.roll(masks(self, view), 1, axis=0))
    with pytest.raises(MethodError, match="got one of others"):
        method.fit(capture, priors, saved, 0, silent)


@pytest.mark.parametrize(
    "changes",
    [
        {"references": 1, "hole_weight": 0.5, "grow": 0.04, "least_inside": 0.4},
        {"effect_mask": False, "doubtful_go": False},
        {"distilled": True},
    ],
    ids=lambda changes: "-".join(changes),
)
def test_fits_that_differ_later_share_the_first_stage(
    scene: Path, tmp_path: Path, changes: dict[str, object]
):
    """And end with the same bits as alone."""
    capture = open_capture(scene / "capture", check=False)
    priors, method = told(scene, PriorSpec("oracle", 1, overrides=UNTOLD)), GorisMethod()
    saving = replace(QUICK, checkpoint=f"{tmp_path}/")
    method.fit(capture, priors, saving, 0, silent)
    doing: list[float] = []
    changed = replace(saving, **changes)  # pyright: ignore[reportArgumentType]
    shared = method.fit(capture, priors, changed, 0, lambda done, what: doing.append(done))
    assert len(doing) == changed.second_steps + (changed.iterations if changed.distilled else 0)
    alone = method.fit(capture, priors, replace(changed, checkpoint=""), 0, silent)
    for name, values in alone.after.parameters.all.items():
        assert torch.equal(values, shared.after.parameters.all[name]), name


def test_to_be_told_that_all_is_glossy_is_more_than_not_to_be_told(world: GlossyWorld):
    """Masks are alike, but regions, initial light and the loss are not: no stage is shared."""
    untold = [replace(shot, told=False) for shot in shots_of_world(world)]
    told_so = [replace(shot, told=True) for shot in untold]
    files = [
        fit_checkpoint("goris", replace(QUICK, checkpoint="stages/"), 0, looked_at(shots))
        for shots in (untold, told_so)
    ]
    assert files[0] is not None
    assert files[1] is not None
    assert files[0].file != files[1].file


def test_where_nothing_is_glossy_a_fit_goes_on_as_well(scene: Path, tmp_path: Path):
    """All steps are radiance only there, which the settings do not say."""
    capture = open_capture(scene / "capture", check=False)
    known = told(scene, PriorSpec("classical"))
    priors = replace(known, models={**known.models, "mask": NothingGlossy()})
    saved = replace(QUICK, checkpoint=str(tmp_path / "fit"))
    one, two = (GorisMethod().fit(capture, priors, saved, 0, silent).after.parameters.all for _ in range(2))
    assert all(torch.equal(values, two[name]) for name, values in one.items())
