# SPDX-License-Identifier: Apache-2.0
"""Surfels come and go as the rules say, and all that belongs to them comes and goes with them."""

from dataclasses import replace

import pytest
import torch

from graycard.methods import splat

EXTENT = 2.0
RULES = splat.DensityRules()
SMALL, LARGE = 0.01, 0.5
"""Sizes in metres: below and above ``RULES.small`` times the extent."""


def state_of(sizes: list[float], gradients: list[float], opacity: float = 0.5) -> splat.FitState:
    """Surfels of some sizes, with mean screen-space gradients, moments and a colour that tell them apart."""
    count = len(sizes)
    number = torch.arange(1.0, count + 1)
    scales = torch.tensor(sizes)[:, None].expand(count, 2)
    turned = torch.nn.functional.normalize(torch.tensor([[1.0, 2, 3, 4]]), dim=1).expand(count, 4)
    surfels = splat.Surfels(
        number[:, None] * torch.ones(3), turned, scales, torch.full((count,), opacity), torch.zeros(count, 0)
    )
    parameters = splat.parameters_of(
        surfels, {"colour": number[:, None] * 10}, {"network": torch.tensor([7.0])}
    )
    state = splat.initial_state(parameters, seed=0)
    moments = {
        name: splat.AdamMoments(m.first + 1, m.second + 2, m.steps + 5) for name, m in state.moments.items()
    }
    views = torch.full((count,), 4.0)
    screen = splat.ScreenStatistics(torch.tensor(gradients) * views, views, torch.zeros(count))
    return replace(state, moments=moments, screen=screen)


def numbers(state: splat.FitState) -> list[float]:
    """Return the numbers of these surfels, by their colour."""
    return (state.parameters.surfels["colour"][:, 0] / 10).tolist()


def test_small_ones_are_cloned_and_large_ones_split():
    before = state_of([SMALL, SMALL, LARGE, LARGE], [1e-3, 1e-5, 1e-3, 1e-5])
    after = splat.densify(before, RULES, EXTENT)
    assert numbers(after) == [1, 2, 4, 1, 3, 3]
    surfels = after.parameters.surfels
    assert torch.equal(surfels[splat.CENTRES][0], surfels[splat.CENTRES][3])
    sizes = surfels[splat.LOG_SCALES].exp()[:, 0]
    torch.testing.assert_close(sizes, torch.tensor([SMALL, SMALL, LARGE, SMALL, LARGE / 1.6, LARGE / 1.6]))
    assert torch.equal(after.parameters.shared["network"], torch.tensor([7.0]))


def test_moments_follow_and_new_surfels_have_none():
    after = splat.densify(state_of([SMALL, LARGE, LARGE], [1e-3, 1e-3, 0]), RULES, EXTENT)
    assert numbers(after) == [1, 3, 1, 2, 2]
    for name in (*splat.GEOMETRY, "colour"):
        moments = after.moments[name]
        assert moments.first.reshape(5, -1)[:, 0].tolist() == [1, 1, 0, 0, 0]
        assert moments.second.reshape(5, -1)[:, 0].tolist() == [2, 2, 0, 0, 0]
        assert moments.first.shape == after.parameters.surfels[name].shape
        assert float(moments.steps) == 5
    assert after.moments["network"].first.tolist() == [1]
    assert all(values.tolist() == [0] * 5 for values in vars(after.screen).values())


def test_children_are_drawn_from_their_parent():
    """In the plane of the disc with its standard deviations; 4000 draws, five standard errors."""
    count, scales = 2000, torch.tensor([0.5, 0.2])
    before = state_of([LARGE] * count, [1.0] * count)
    surfels = dict(before.parameters.surfels)
    surfels[splat.CENTRES] = torch.zeros(count, 3)
    surfels[splat.LOG_SCALES] = scales.log().expand(count, 2).clone()
    before = replace(before, parameters=replace(before.parameters, surfels=surfels))
    after = splat.densify(before, RULES, EXTENT).parameters.surfels
    from graycard.methods.splat._geometry import rotation_matrices

    inside = (rotation_matrices(after[splat.ROTATIONS]).mT @ after[splat.CENTRES][:, :, None])[:, :, 0]
    draws = len(inside)
    assert draws == 2 * count
    assert inside[:, 2].abs().max() < 1e-6
    assert (inside.mean(dim=0)[:2].abs() < 5 * scales / draws**0.5).all()
    spread = inside[:, :2].std(dim=0)
    assert ((spread / scales - 1).abs() < 5 / (2 * draws) ** 0.5).all()
    assert abs(float(torch.corrcoef(inside[:, :2].T)[0, 1])) < 5 / draws**0.5


def test_no_more_than_the_limit_and_the_neediest_first():
    rules = replace(RULES, limit=6)
    after = splat.densify(state_of([SMALL] * 4, [3e-4, 9e-4, 1e-3, 5e-4]), rules, EXTENT)
    assert numbers(after) == [1, 2, 3, 4, 2, 3]
    full = splat.densify(after, rules, EXTENT)
    assert numbers(full) == numbers(after)
    three = replace(RULES, limit=6, children=3)
    split = splat.densify(state_of([LARGE] * 4, [1e-3] * 4), three, EXTENT)
    assert numbers(split) == [2, 3, 4, 1, 1, 1]
    sizes = split.parameters.surfels[splat.LOG_SCALES].exp()
    torch.testing.assert_close(sizes, torch.tensor([LARGE] * 3 + [LARGE / 2.4] * 3)[:, None].expand(6, 2))


def test_nothing_is_changed_in_place_and_equal_states_give_equal_ones():
    def bits(state: splat.FitState) -> list[torch.Tensor]:
        moments = [v for m in state.moments.values() for v in vars(m).values()]
        parameters = state.parameters.all.values()
        return [v.clone() for v in (*parameters, *moments, *vars(state.screen).values(), state.random)]

    before = state_of([SMALL, LARGE], [1e-3, 1e-3])
    kept = bits(before)
    first = bits(splat.densify(before, RULES, EXTENT))
    again = bits(splat.densify(before, RULES, EXTENT))
    splat.prune(before, RULES, EXTENT, bound_sizes=True)
    splat.reset_opacity(before, RULES)
    assert all(torch.equal(a, b) for a, b in zip(kept, bits(before), strict=True))
    assert all(torch.equal(a, b) for a, b in zip(first, again, strict=True))
    assert not torch.equal(splat.densify(before, RULES, EXTENT).random, before.random)


def test_transparent_ones_go_with_all_that_is_theirs():
    before = state_of([SMALL, LARGE, SMALL], [1e-3, 2e-3, 3e-3])
    surfels = dict(before.parameters.surfels)
    surfels[splat.LOGITS] = torch.logit(torch.tensor([0.06, 0.9, 0.04]))
    before = replace(before, parameters=replace(before.parameters, surfels=surfels))
    after = splat.prune(before, RULES, EXTENT, bound_sizes=False)
    assert numbers(after) == [1, 2]
    torch.testing.assert_close(after.screen.gradient, torch.tensor([4e-3, 8e-3]))
    assert {len(m.first) for name, m in after.moments.items() if name != "network"} == {2}
    assert numbers(splat.prune(before, RULES, EXTENT, bound_sizes=True)) == [1]


def test_what_is_too_large_is_so_by_the_extent():
    rules = replace(RULES, largest=0.1)
    before = state_of([0.19, 0.21], [0.0] * 2)
    assert numbers(splat.prune(before, rules, extent=2.0, bound_sizes=True)) == [1]
    assert numbers(splat.prune(before, rules, extent=3.0, bound_sizes=True)) == [1, 2]


def test_what_covers_too_much_of_the_screen_goes():
    before = state_of([SMALL] * 3, [0.0] * 3)
    before = replace(before, screen=replace(before.screen, radius=torch.tensor([0.1, 0.4, 0.2])))
    rules = replace(RULES, largest=None, largest_on_screen=0.3)
    assert numbers(splat.prune(before, rules, EXTENT, bound_sizes=True)) == [1, 3]
    assert numbers(splat.prune(before, rules, EXTENT, bound_sizes=False)) == [1, 2, 3]


def test_nothing_may_be_left():
    after = splat.prune(state_of([SMALL], [0.0], opacity=0.01), RULES, EXTENT, bound_sizes=False)
    assert len(after.parameters) == 0
    assert len(splat.densify(after, RULES, EXTENT).parameters) == 0


def test_opacities_are_lowered_never_raised():
    before = state_of([SMALL, SMALL], [0.0, 0.0])
    surfels = dict(before.parameters.surfels)
    surfels[splat.LOGITS] = torch.logit(torch.tensor([0.8, 0.003]))
    after = splat.reset_opacity(
        replace(before, parameters=replace(before.parameters, surfels=surfels)), RULES
    )
    opacities = after.parameters.surfels[splat.LOGITS].sigmoid()
    torch.testing.assert_close(opacities, torch.tensor([0.01, 0.003]))
    moments = after.moments[splat.LOGITS]
    assert moments.first.tolist() == moments.second.tolist() == [0, 0]
    assert after.moments["colour"].first.flatten().tolist() == [1, 1]


def test_the_defaults_are_those_of_the_paper_at_30_000_steps():
    steps = range(30_001)
    densified = [step for step in steps if RULES.densifies(step, 30_000)]
    assert densified == list(range(600, 15_000, 100))
    assert [step for step in steps if RULES.resets(step, 30_000)] == [3000, 6000, 9000, 12_000]
    assert RULES.was_reset(3001, 30_000)
    assert not RULES.was_reset(3000, 30_000)


@pytest.mark.parametrize("budget", [1, 7, 100])
def test_small_budgets_have_no_interval_of_zero(budget: int):
    assert all(step < budget for step in range(budget) if RULES.densifies(step, budget))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"until": 1.5}, "start, until and opacities in"),
        ({"every": 0.0}, "positive intervals"),
        ({"children": 1}, "2 or more children"),
        ({"limit": 0}, "limit of 1 or more"),
    ],
)
def test_rules_without_sense(changes: dict[str, float], message: str):
    with pytest.raises(ValueError, match=message):
        replace(RULES, **changes)
