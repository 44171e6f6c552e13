# SPDX-License-Identifier: Apache-2.0
"""Specs, settings, names and knobs."""

import json

import pytest

from graycard import TRACKS, PointLight, RecordError, UnknownNameError
from graycard.io import dumps, from_builtins
from graycard.synth import (
    Family,
    RenderSettings,
    Scene,
    SceneSpec,
    all_families,
    describe,
    family_of,
    resolved_knobs,
    scene_name,
)

CORRIDOR = SceneSpec("dark", "corridor", 0)


@pytest.mark.parametrize("samples", [4, 16, 36, 64, 100, 144, 256, 1024])
def test_samples_are_four_squares(samples: int) -> None:
    assert RenderSettings(samples=samples).samples == samples


@pytest.mark.parametrize("samples", [0, 2, 8, 32, 65, 128])
def test_other_samples_are_refused(samples: int) -> None:
    with pytest.raises(ValueError, match=f"4 times a square .*got {samples}"):
        RenderSettings(samples=samples)


@pytest.mark.parametrize("name", ["width", "height", "train_views", "test_views", "max_depth"])
def test_settings_out_of_range_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"expected {name} to be . or more, got 0"):
        RenderSettings(**{name: 0})  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("names", [("lamp", "lamp"), ("key.light",), ("var",), ("",)])
def test_lights_whose_layers_would_be_mixed_up_are_refused(names: tuple[str, ...]) -> None:
    lights = tuple(PointLight(name, (0, 0, 1), (1, 1, 1)) for name in names)
    with pytest.raises(ValueError, match="expected each light once, its name of letters"):
        Scene((), lights, ())


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a seed of 0 or more, got -1"):
        SceneSpec("dark", "corridor", -1)


def test_specs_and_settings_survive_json() -> None:
    spec = SceneSpec("dark", "corridor", 3, {"ambient": 0.1})
    assert from_builtins(SceneSpec, json.loads(dumps(spec))) == spec
    settings = RenderSettings(32, 24, 4, 2, 36, 3)
    assert from_builtins(RenderSettings, json.loads(dumps(settings))) == settings
    assert settings.views == 6


def test_a_bad_setting_in_json_is_a_mendable_error() -> None:
    with pytest.raises(RecordError, match="4 times a square"):
        from_builtins(RenderSettings, {"samples": 5})


def test_names() -> None:
    assert scene_name(CORRIDOR) == "corridor-0000"
    assert scene_name(SceneSpec("tabletop", "glossy-table", 123)) == "glossy-table-0123"


def test_the_name_tells_changed_knobs_apart_but_does_not_tell_them() -> None:
    names = {scene_name(SceneSpec("dark", "corridor", 0, {"ambient": a})) for a in (0.1, 0.25)}
    assert len(names) == 2
    assert all(n.startswith("corridor-0000-") and "ambient" not in n and "0.25" not in n for n in names)


def test_a_knob_at_its_default_changes_no_name() -> None:
    assert scene_name(SceneSpec("dark", "corridor", 0, {"light_offset": 0.25})) == "corridor-0000"


def test_there_is_a_family_for_each_track() -> None:
    assert {f.track for f in all_families().values()} == set(TRACKS)
    for name, family in all_families().items():
        made = family_of(SceneSpec(family.track, name, 0))
        assert isinstance(made, Family)
        assert made.name == name


def test_an_unknown_family_is_named_with_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'dark/corridor'"):
        scene_name(SceneSpec("dark", "coridor", 0))


def test_a_family_of_another_track_is_unknown() -> None:
    with pytest.raises(UnknownNameError, match="expected a scene family that exists, got 'dark/studio'"):
        family_of(SceneSpec("dark", "studio", 0))


def test_a_misspelt_knob_is_refused() -> None:
    with pytest.raises(RecordError, match=r"(?s)the knobs of dark/corridor.*ambiant"):
        family_of(SceneSpec("dark", "corridor", 0, {"ambiant": 0.1}))


@pytest.mark.parametrize(
    ("track", "family", "knob", "value"),
    [
        ("dark", "corridor", "light_offset", 9.0),
        ("tabletop", "glossy-table", "roughness", 0.0),
        ("multilight", "studio", "metal_roughness", 1.5),
    ],
)
def test_a_knob_out_of_range_is_refused(track: str, family: str, knob: str, value: float) -> None:
    with pytest.raises(RecordError, match=rf"expected {knob} in \[.*\], got {value}"):
        family_of(SceneSpec(track, family, 0, {knob: value}))


def test_resolved_knobs_hold_the_defaults() -> None:
    knobs = resolved_knobs(SceneSpec("dark", "corridor", 0, {"ambient": 1}))
    assert knobs["ambient"] == 1
    assert knobs["light_offset"] == 0.25


def test_the_description_is_one_line_with_seed_and_knobs() -> None:
    assert describe(CORRIDOR) == (
        "A dark storage corridor, lit by a lamp beside the camera and a faintly glowing ceiling (seed 0)"
    )
    assert describe(SceneSpec("dark", "corridor", 2, {"light_offset": 0.4})).endswith(
        "(seed 2; light offset 0.4 m)"
    )
