# SPDX-License-Identifier: Apache-2.0
"""The second stage on surfaces that are known: where lamps begin, what moves, and what is put elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from graycard.io import silent
from graycard.methods.gsid import GsidSettings
from graycard.methods.gsid._aggregation import largest_lack
from graycard.methods.gsid._bounces import bounces_between
from graycard.methods.gsid._candidates import (
    CLEAR,
    DOUBT,
    LEAST_SKY,
    FirstLights,
    Samples,
    Search,
    _distance,
    _explained,
    _merged,
)
from graycard.methods.gsid._draw import draw, reach_in_view
from graycard.methods.gsid._fit import learning_rates, train_lights
from graycard.methods.gsid._lights import (
    LAMPS as NAMES,
)
from graycard.methods.gsid._lights import (
    POSITIONS,
    first_lights,
    lamps_from,
)
from graycard.methods.gsid._materials import first_materials
from graycard.methods.gsid._model import (
    BASE_COLOR,
    METALLIC,
    OPEN,
    ROUGHNESS,
    SHADOW,
    Reach,
    ground_of,
    picture_of,
    pixels_of,
    seen_anew,
)
from graycard.methods.gsid._objective import few
from graycard.methods.gsid._stage import LightStage, objective_in, reach_in, renewed
from graycard.methods.gsid._start import samples_in
from graycard.methods.shading import lamp_visibility, look_up, surroundings_of, unevenness
from graycard.methods.splat import (
    CENTRES,
    LOG_SCALES,
    LOGITS,
    ROTATIONS,
    Parameters,
    initial_state,
    rasterize_features,
    view_at,
    windows_of,
)
from graycard.methods.surfels import srgb_encode_tensor
from lit_sheets import EXTENT, LAMPS, World

QUICK = GsidSettings(visibility="traced", iterations=90, lamps=3, sky_size=4, tile=24, aggregate_every=0.5)
TRUE = np.array([light.position for light in LAMPS])


def stage_of(world: World, settings: GsidSettings = QUICK) -> LightStage:
    return LightStage(world.surfels, world.shots, settings, EXTENT, 0)


def state_of(world: World, positions: np.ndarray, intensity: float = 0.5):
    sent = torch.zeros(len(positions), 2, 3)
    sent[:, 0] = intensity
    places, sky = torch.from_numpy(positions).float(), torch.full((6, 3), 0.05)
    lights = first_lights(FirstLights(places, sent, torch.zeros(3), sky), QUICK)
    surface = {name: values.clone() for name, values in world.surface.items()}  # a fit uses them up
    return initial_state(Parameters(surface, lights), 0)


def lights_of(samples: Samples, world: World, lamps: int) -> FirstLights:
    search = Search(samples, world.surfels, replace(QUICK, lamps=lamps), EXTENT)
    return search.lights_at(search.places(), traced=True)


def test_lamps_begin_where_they_are(world: World):
    """On true materials, to about a spacing of the places that are tried."""
    samples = samples_in(stage_of(world), world.surface)
    found = lights_of(samples, world, 2)
    distance = np.linalg.norm(found.positions.numpy()[:, None] - TRUE, axis=-1)
    assert sorted(distance.argmin(axis=1)) == [0, 1]
    assert distance.min(axis=1).max() < 0.35


def test_strengths_are_found_exactly_where_places_are_known():
    columns = torch.rand(200, 2, 2, 3, generator=torch.Generator().manual_seed(1))
    sky = torch.rand(200, 6, 3, generator=torch.Generator().manual_seed(2))
    true, of_sky = (
        torch.tensor([[[1.0, 2.0, 0.5], [0.0, 0.0, 0.0]], [[3.0, 0.5, 0.0], [0.1, 0.2, 0.3]]]),
        0.25,
    )
    shown = (columns * true).sum(dim=(1, 2)) + (sky * of_sky).sum(dim=1)
    found, found_sky = _explained(columns, sky, shown, doubt=0)
    torch.testing.assert_close(found, true, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(found_sky, torch.full((6, 3), of_sky), atol=1e-4, rtol=1e-4)


def test_a_sky_is_doubted_and_a_lamp_is_not():
    """The lamp is taken of two equal explanations; a sky that alone explains something stays, fainter."""
    lamp = torch.rand(300, 1, 1, 3, generator=torch.Generator().manual_seed(3))
    sky = torch.rand(300, 6, 3, generator=torch.Generator().manual_seed(4))
    sky[:, 0] = lamp[:, 0, 0]
    both, of_sky = _explained(lamp, sky, 2 * lamp[:, 0, 0], DOUBT)
    torch.testing.assert_close(both, torch.full((1, 1, 3), 2.0), atol=1e-4, rtol=1e-4)
    assert of_sky.abs().max() < 1e-4
    one = torch.zeros(300, 6, 3)
    one[:, 2] = sky[:, 1]
    nothing, alone = _explained(0 * lamp, one, sky[:, 1], DOUBT)
    assert nothing.abs().max() < 1e-6
    torch.testing.assert_close(alone[2], torch.full((3,), 1 / (1 + DOUBT**2)), atol=1e-4, rtol=1e-4)


def test_places_that_are_near_are_one_lamp():
    places = torch.tensor(
        [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [3.0, 0.0, 0.0], [6.0, 0.0, 0.0], [9.0, 0.0, 0.0]]
    )
    found = _merged(places, torch.tensor([3.0, 1.0, 2.0, 0.5, 0.0]), 1.0, 2)
    torch.testing.assert_close(found, torch.tensor([[0.1, 0.0, 0.0], [3.0, 0.0, 0.0]]))
    assert _merged(places, torch.zeros(5), 1.0, 2).shape == (0, 3)


def test_without_lamps_the_sky_explains_it(world: World):
    samples = samples_in(stage_of(world), world.surface)
    found = lights_of(samples, world, 0)
    assert found.positions.shape == (0, 3)
    assert found.sky.max() > 0.05


def test_the_sky_of_the_start_is_not_held_down(world: World):
    """Floor and board get of it what they get of the true sky, and no face begins dark."""
    samples = samples_in(stage_of(world), world.surface)
    sky = lights_of(samples, world, 2).sky[:, None, None]
    irradiance = look_up(surroundings_of(sky).irradiance, torch.tensor([[0.0, 0.0, 1.0]]))
    torch.testing.assert_close(irradiance, torch.full((1, 3), torch.pi * 0.05), atol=0, rtol=0.25)
    assert float(sky.min()) == pytest.approx(LEAST_SKY * float(samples.shown.mean()))


def test_materials_begin_as_the_prior_says(world: World):
    found = first_materials(world.surfels, world.normals, world.shots)
    seen = world.surfels.centres[:, :2].abs().amax(dim=1) < 0.5
    floor = world.surfels.centres[:, 2] < 0.1
    off = (found[BASE_COLOR].sigmoid() - world.surface[BASE_COLOR].sigmoid()).abs().mean(dim=1)
    assert off[seen & ~floor].mean() < 0.08
    torch.testing.assert_close(
        found[ROUGHNESS].sigmoid()[seen & ~floor],
        torch.full((int((seen & ~floor).sum()), 1), 0.6),
        atol=0.02,
        rtol=0,
    )
    torch.testing.assert_close(found[SHADOW], -world.normals)


def test_without_a_prior_they_begin_neutral(world: World):
    from graycard.methods.gsid._guess import MaterialGuess

    found = first_materials(
        world.surfels, world.normals, [replace(s, guess=MaterialGuess()) for s in world.shots]
    )
    torch.testing.assert_close(found[BASE_COLOR].sigmoid(), torch.full_like(found[BASE_COLOR], 0.4))
    torch.testing.assert_close(found[METALLIC].sigmoid(), torch.full_like(found[METALLIC], 0.1))


@pytest.mark.parametrize("visibility", ["traced", "vector", "vector_half", "vector_relu", "none"])
def test_everything_that_moves_has_a_gradient(world: World, visibility):
    settings = replace(QUICK, visibility=visibility)
    stage, state = stage_of(world, settings), state_of(world, TRUE)
    rates = learning_rates(EXTENT, settings)
    objective = objective_in(stage, state.parameters)
    values = {n: v.detach().requires_grad_(n in rates) for n, v in state.parameters.all.items()}
    values[SHADOW] = (values[SHADOW] + 0.3).detach().requires_grad_(SHADOW in rates)
    moving = [values[name] for name in rates]
    found = torch.autograd.grad(objective(values, 0).loss, moving, allow_unused=True, materialize_grads=True)
    for name, gradient in zip(rates, found, strict=True):
        assert gradient.isfinite().all(), name
        assert gradient.any(), name
    assert (SHADOW in rates) is visibility.startswith("vector")


def test_the_fit_lowers_the_error_and_repeats_to_the_bit(world: World):
    ends = []
    for _ in range(2):
        state = train_lights(state_of(world, TRUE + 0.15, 0.3), stage_of(world), silent)
        ends.append(state.parameters.all)
    for name, values in ends[0].items():
        assert torch.equal(values, ends[1][name]), name
    assert error(world, ends[0]) < 0.6 * error(world, state_of(world, TRUE + 0.15, 0.3).parameters.all)


def error(world: World, values) -> float:
    stage = stage_of(world)
    shared = {name: values[name] for name in (*NAMES, "log sky")}
    reach = reach_in(stage, Parameters(world.surface, shared))
    off = [shaded(values, shot, s).whole - shot.linear for shot, s in zip(world.shots, reach, strict=True)]
    return float(torch.stack(off).abs().mean())


def shaded(values, shot, reach):
    sky = surroundings_of(values["log sky"].exp())
    return picture_of(pixels_of(values, shot.ground), lamps_from(values), sky, reach, "traced", EXTENT)


def test_the_same_light_of_fewer_lamps_costs_less():
    light = torch.tensor([0.7])
    halves = torch.cat([light / 2, light / 2])
    assert float(few(halves)) == pytest.approx(2**0.5 * float(few(light)), rel=1e-3)
    dark = torch.zeros(2, requires_grad=True)
    few(dark).backward()
    assert dark.grad is not None
    assert bool(dark.grad.isfinite().all())


def test_lamps_begin_away_from_what_is_seen(world: World):
    samples = samples_in(stage_of(world), world.surface)
    points = samples.points[:40]
    near = _distance(
        torch.cat([points.mean(dim=0)[None] + torch.tensor([0.0, 0.0, 9.0]), points[:1]]), samples
    )
    assert near[0] > 8
    assert near[1] < CLEAR * EXTENT
    found = lights_of(samples, world, 8)
    assert _distance(found.positions, samples).min() > CLEAR * EXTENT / 2  # places are moved afterwards


def test_light_is_missing_where_the_photographs_are_brighter(world: World):
    values = state_of(world, TRUE).parameters.all
    pictures = [
        shaded(values, shot, None if s is None else s)
        for shot, s in zip(
            world.shots,
            reach_in(stage_of(world), Parameters(world.surface, {n: values[n] for n in NAMES})),
            strict=True,
        )
    ]
    brighter = [replace(shot, linear=p.whole.clone()) for shot, p in zip(world.shots, pictures, strict=True)]
    brighter[2].linear[20:23, 14:17] += 0.5
    lack = largest_lack(brighter, pictures, EXTENT)
    ground = world.shots[2].ground
    expected = ground.points[21, 15] + 0.25 * EXTENT * ground.normal[21, 15]
    assert torch.linalg.vector_norm(lack.position - expected) < 0.15
    assert (lack.intensity > 0).all()


def test_tiles_hold_each_pixel_once():
    for size in ((112, 112), (113, 57), (30, 200), (8, 8)):
        count = torch.zeros(*size, dtype=torch.int)
        for window in windows_of(*size, 56):
            window.of(count).add_(1)
        assert (count == 1).all()
        sides = [(w.bottom - w.top, w.right - w.left) for w in windows_of(*size, 56)]
        assert max(max(pair) for pair in sides) <= 84


def test_each_pixel_has_its_turn_in_a_round(world: World):
    """Each view's tiles, in an order of each round's own."""
    objective = objective_in(stage_of(world, replace(QUICK, tile=18)), state_of(world, TRUE).parameters)
    count = len(objective.shots)
    assert count == 4 * len(windows_of(32, 36, 18))
    rounds = [[view_at(step, count, 0) for step in range(first, first + count)] for first in (0, count)]
    assert all(sorted(turns) == list(range(count)) for turns in rounds)
    assert rounds[0] != rounds[1]


def test_a_tile_is_a_part_of_its_view(world: World):
    """Its own camera sees what the whole view has there."""
    values, window = state_of(world, TRUE).parameters.all, windows_of(32, 36, 16)[3]
    for shot in world.shots:
        whole, part = pixels_of(values, shot.ground), pixels_of(values, shot.at(window).ground)
        torch.testing.assert_close(part.material.base_color, window.of(whole.material.base_color))
        ground, pixels = seen_anew(values, shot.at(window).ground.camera)
        torch.testing.assert_close(ground.points, window.of(shot.ground.points))
        torch.testing.assert_close(pixels.normal, window.of(shot.ground.normal))


def test_light_arrives_on_surfaces_as_they_are_now(world: World):
    """Views keep the surfaces of the beginning; what surfels receive is drawn on those that have moved."""
    moving = stage_of(world, replace(QUICK, geometry_rate=0.1))
    parameters = state_of(world, TRUE).parameters
    parameters.surfels[LOGITS].fill_(-1.0)
    now = renewed(moving, parameters)
    fresh = [
        replace(s, ground=ground_of(now.surfels, s.ground.camera, world.surface[OPEN])) for s in world.shots
    ]
    found, wanted = (reach_in(stage, parameters) for stage in (now, replace(now, shots=fresh)))
    before = reach_in(moving, parameters)
    for one, other, old in zip(found, wanted, before, strict=True):
        assert one.shadows is not None
        assert other.shadows is not None
        assert torch.equal(one.shadows, other.shadows)
        assert old.shadows is not None
        assert not torch.equal(one.shadows, old.shadows)
    for shot in fresh:
        alone = rasterize_features(now.surfels, shot.ground.camera, features=torch.ones(len(now.surfels), 1))
        assert torch.equal(alone.alpha, shot.ground.drawn.alpha)


def test_bounced_light_is_that_of_the_surfels_of_now(world: World):
    """Rays go to the nodes alone, once a place, and anew when surfels have moved."""
    settings = replace(QUICK, geometry_rate=0.1, visibility="vector")
    bounces = bounces_between(world.surfels, world.normals, EXTENT)
    stage = replace(stage_of(world, settings), bounces=bounces)
    parameters = state_of(world, TRUE).parameters
    for opacity in (5.0, -1.0):
        parameters.surfels[LOGITS].fill_(opacity)
        stage = renewed(stage, parameters)
        there = bounces.seen_from.nodes
        wanted = lamp_visibility(stage.surfels, there, parameters.shared[POSITIONS], EXTENT)
        for _ in range(2):
            assert torch.equal(stage.reached_nodes(bounces, parameters.shared[POSITIONS]), wanted)
        found = reach_in(stage, parameters)
        assert all(one.bounced is not None and one.shadows is None for one in found)
        assert stage.traced == {}


def test_places_stand_still_and_the_rest_of_geometry_follows(world: World):
    moving = replace(QUICK, geometry_rate=0.1)
    before = {name: values.clone() for name, values in world.surface.items()}
    after = train_lights(state_of(world, TRUE), stage_of(world, moving), silent).parameters.surfels
    assert torch.equal(after[CENTRES], before[CENTRES])
    for name in (LOG_SCALES, ROTATIONS, LOGITS):
        assert not torch.equal(after[name], before[name]), name
    frozen = learning_rates(EXTENT, replace(QUICK, geometry_rate=0))
    assert not {CENTRES, LOG_SCALES, ROTATIONS, LOGITS} & frozen.keys()


def test_materials_can_be_left_as_the_prior_has_them(world: World):
    materials = {BASE_COLOR, ROUGHNESS, METALLIC}
    assert materials <= learning_rates(EXTENT, QUICK).keys()
    assert not materials & learning_rates(EXTENT, replace(QUICK, materials="prior")).keys()


def test_shaded_surfels_look_like_shaded_pixels(world: World):
    """Up to what is blended: albedo times light, or the light of each surfel (G12)."""
    stage = stage_of(world)
    lights = world.lamps, surroundings_of(torch.full((6, 4, 4, 3), 0.05))
    reached = lamp_visibility(world.surfels, world.surfels.centres, world.lamps.positions, EXTENT)
    for shot in world.shots:
        forward = replace(stage.settings, shading="forward")
        drawn = [
            draw(
                world.surface, shot.ground, lights,
                reach_in_view(world.surfels, shot.ground.camera, Reach(reached), settings), settings, EXTENT,
            )
            for settings in (stage.settings, forward)
        ]  # fmt: skip
        error = (srgb_encode_tensor(drawn[0].whole) - srgb_encode_tensor(drawn[1].whole)).square().mean()
        assert -10 * np.log10(float(error)) > 30
        torch.testing.assert_close(drawn[0].whole, shot.linear)


def test_a_cubemap_of_one_colour_is_smooth():
    assert float(unevenness(torch.full((6, 4, 4, 3), 0.3))) == 0
    assert float(unevenness(torch.full((6, 1, 1, 3), 0.3))) == 0
    assert float(unevenness(torch.rand(6, 4, 4, 3))) > 0.1


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"iterations": 1}, "2 or more iterations"),
        ({"lobes": 0}, "lobes and sky_size of 1 or more"),
        ({"tile": 8}, "a tile of 11 or more pixels"),
        ({"geometry_rate": -0.1}, "geometry_rate of 0 or more"),
        ({"least_share": 2.0}, r"least_share in \[0, 1\]"),
        ({"sky_weight": -1.0}, "weights of 0 or more"),
    ],
)
def test_settings_out_of_range(wrong: dict, match: str):
    with pytest.raises(ValueError, match=match):
        GsidSettings(**wrong)
