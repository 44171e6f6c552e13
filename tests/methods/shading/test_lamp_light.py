# SPDX-License-Identifier: Apache-2.0
"""All lamps in one sweep, beside the plain path in float64: values, and gradients of all that may move."""

from dataclasses import dataclass, fields

import pytest
import torch
from torch.nn.functional import normalize

from graycard.methods.gsid._visibility import vector_visibility
from graycard.methods.shading import (
    InTheWay,
    LampLight,
    Lamps,
    Material,
    arriving,
    light_of_lamps,
    lit_by_lamps,
)

SOFTEN = 0.05


@dataclass(frozen=True)
class Place:
    """Surfaces under lamps."""

    normal: torch.Tensor
    base_color: torch.Tensor
    roughness: torch.Tensor
    metallic: torch.Tensor
    vector: torch.Tensor
    positions: torch.Tensor
    axes: torch.Tensor
    sharpness: torch.Tensor
    amplitudes: torch.Tensor
    eye: torch.Tensor
    points: torch.Tensor
    shares: torch.Tensor


MOVING = tuple(field.name for field in fields(Place))[:9]


def place(shape: tuple[int, ...], lamps: int, lobes: int, seed: int = 0) -> Place:
    """Surfaces on a floor, some of which face away from the eye or from lamps; a sharp one and a mirror."""
    draws = torch.Generator().manual_seed(seed)

    def random(*size: int) -> torch.Tensor:
        return torch.rand(*size, generator=draws, dtype=torch.float64)

    def about(*size: int) -> torch.Tensor:
        return torch.randn(*size, generator=draws, dtype=torch.float64)

    up = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    flat = torch.cat([2 * random(*shape, 2) - 1, torch.zeros(*shape, 1, dtype=torch.float64)], dim=-1)
    roughness = random(*shape)
    roughness.view(-1)[:2] = torch.tensor([0.004, 1.0])  # alpha below its least, and the roughest
    return Place(
        normalize(up + 0.7 * about(*shape, 3), dim=-1),
        random(*shape, 3),
        roughness,
        random(*shape),
        about(*shape, 3),
        torch.cat([2 * random(lamps, 2) - 1, 0.4 + random(lamps, 1)], dim=-1),
        about(lamps, lobes, 3),
        4 * random(lamps, lobes),
        random(lamps, lobes, 3),
        normalize(up + 0.7 * about(*shape, 3), dim=-1),
        flat,
        random(*shape, lamps),
    )


def in_float32(given: Place) -> Place:
    return Place(*(getattr(given, field.name).float() for field in fields(Place)))


def with_leaves(given: Place) -> Place:
    return Place(*(getattr(given, f.name).clone().requires_grad_(f.name in MOVING) for f in fields(Place)))


def lamps_in(given: Place) -> Lamps:
    return Lamps(given.positions, given.axes, given.sharpness, given.amplitudes)


def material_in(given: Place) -> Material:
    return Material(given.base_color, given.roughness, given.metallic)


def plainly(given: Place, way: str) -> LampLight:
    """By tensors a lamp and surface."""
    arrival = arriving(lamps_in(given), given.points, SOFTEN)
    if "vector" in way:
        told = vector_visibility("vector", given.vector, arrival.toward)
        told = torch.where(known_of(given), told, 1.0) if "known" in way else told
        arrival = arrival._replace(facing=arrival.facing * told[..., None])
    if "shares" in way:
        arrival = arrival._replace(facing=arrival.facing * given.shares[..., None])
    returned = lit_by_lamps(material_in(given), given.normal, given.eye, arrival).whole.sum(dim=-2)
    return LampLight(returned, arrival.facing.flatten(0, -3).mean(dim=(0, 2)))


def swept(given: Place, way: str) -> LampLight:
    in_the_way = InTheWay(
        given.vector if "vector" in way else None,
        known_of(given) if "known" in way else None,
        given.shares if "shares" in way else None,
    )
    surfaces = material_in(given), given.normal, given.eye, given.points
    return light_of_lamps(*surfaces, lamps_in(given), soften=SOFTEN, in_the_way=in_the_way)


def known_of(given: Place) -> torch.Tensor:
    return torch.arange(len(given.positions)) % 2 == 0


WAYS = ("", "vector", "vector known", "vector shares", "shares")
SHAPES = [((8, 16), 3, 2), ((5, 7), 2, 1), ((3,), 4, 3)]
"""Numbers of surfaces, lamps and lobes: whole vectors, a vector and a part, and less than one."""


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("shape", "lamps", "lobes"), SHAPES)
def test_light_is_that_of_the_plain_path(shape: tuple[int, ...], lamps: int, lobes: int, way: str):
    given = place(shape, lamps, lobes)
    expected, found = plainly(given, way), swept(in_float32(given), way)
    assert float(expected.returned.max()) > 0.01
    torch.testing.assert_close(found.returned.double(), expected.returned, atol=2e-5, rtol=2e-4)
    torch.testing.assert_close(found.given.double(), expected.given, atol=1e-6, rtol=1e-5)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("shape", "lamps", "lobes"), SHAPES)
def test_gradients_are_those_of_the_plain_path(shape: tuple[int, ...], lamps: int, lobes: int, way: str):
    """Gradients are of a weighted sum of both outputs, by everything that may move."""
    given = place(shape, lamps, lobes, seed=1)
    weight = torch.rand(*shape, 3, generator=torch.Generator().manual_seed(2), dtype=torch.float64)

    def gradients(of: Place, light: LampLight) -> list[torch.Tensor]:
        dtype = of.normal.dtype
        of_lamps = torch.linspace(1, 2, lamps, dtype=dtype)
        loss = (light.returned * weight.to(dtype)).sum() + (light.given * of_lamps).sum()
        moving = [getattr(of, name) for name in MOVING if name != "vector" or "vector" in way]
        return list(torch.autograd.grad(loss, moving))

    exact, single = with_leaves(given), with_leaves(in_float32(given))
    names = [name for name in MOVING if name != "vector" or "vector" in way]
    pairs = zip(gradients(exact, plainly(exact, way)), gradients(single, swept(single, way)), strict=True)
    for name, (expected, found) in zip(names, pairs, strict=True):
        assert expected.any(), name
        assert float((found.double() - expected).norm() / expected.norm()) < 2e-4, name


def test_surfaces_that_face_away_are_dark_and_have_no_slope():
    given = in_float32(place((4, 16), 2, 2))
    turned = with_leaves(Place(-given.eye.abs(), *(getattr(given, f.name) for f in fields(Place)[1:])))
    light = swept(turned, "vector")
    dark = (turned.normal * turned.eye).sum(dim=-1) <= 0
    assert dark.any()
    assert not light.returned[dark].any()
    found = torch.autograd.grad(light.returned.sum(), [turned.normal, turned.roughness])
    assert not any(one[dark].any() for one in found)


def test_a_lamp_in_a_surface_and_a_vector_of_no_length_leave_numbers():
    given = in_float32(place((16,), 2, 2))
    given.points[0] = given.positions[0]
    given.vector[1] = 0
    moving = with_leaves(given)
    light = swept(moving, "vector")
    found = torch.autograd.grad(
        light.returned.sum() + light.given.sum(), [getattr(moving, name) for name in MOVING]
    )
    assert all(one.isfinite().all() for one in (*light, *found))


def test_threads_do_not_change_the_bits():
    import numba

    given = in_float32(place((40, 40), 3, 2))

    def looked() -> list[torch.Tensor]:
        moving = with_leaves(given)
        light = swept(moving, "vector")
        loss = light.returned.sum() + light.given.sum()
        return [*light, *torch.autograd.grad(loss, [getattr(moving, name) for name in MOVING])]

    before = numba.get_num_threads()
    found = []
    for count in {1, before}:
        numba.set_num_threads(count)
        found.append(looked())
    numba.set_num_threads(before)
    assert all(torch.equal(a, b) for other in found for a, b in zip(found[0], other, strict=True))


def test_there_may_be_no_lamp():
    light = swept(in_float32(place((5, 5), 0, 2)), "vector")
    assert not light.returned.any()
    assert light.given.shape == (0,)


def test_other_numbers_are_refused():
    with pytest.raises(ValueError, match="float32"):
        swept(place((4,), 1, 1), "")
