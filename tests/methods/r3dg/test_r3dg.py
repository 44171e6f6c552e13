# SPDX-License-Identifier: Apache-2.0
"""``r3dg``: surfels that are shaded one by one, against closed forms and behind the contract."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from graycard import Camera, MethodError, PointLight, look_at, methods, open_capture
from graycard.io import silent
from graycard.layers import find_fault
from graycard.methods.r3dg import R3dgMethod, R3dgScene, R3dgSettings
from graycard.methods.r3dg._light import (
    BASE_COLOR,
    OWN,
    ROUGHNESS,
    SKY,
    Directions,
    directions_of,
    from_sky,
    in_view,
    own_light,
    returned,
)
from graycard.methods.r3dg._method import first_surfaces
from graycard.methods.r3dg._objective import R3dgObjective, forward_views
from graycard.methods.shading import (
    Material,
    lit_by_surroundings,
    surroundings_of,
    unevenness_but_for_edges,
)
from graycard.methods.splat import CENTRES, LOG_SCALES, Parameters
from graycard.methods.surfels import EncodedPhotograph
from lit_sheets import EXTENT, World
from sparse_points import with_points

QUICK = R3dgSettings(iterations=10, surfels=300, fill=0.0, sky_size=4)
EYE = torch.tensor([0.3, -0.6, 1.9])


@pytest.fixture(scope="module")
def lit(world: World) -> tuple[dict[str, torch.Tensor], Directions]:
    eyes = torch.stack([torch.tensor(shot.ground.camera.position).float() for shot in world.shots])
    values = dict(world.surface) | {OWN: torch.zeros(len(world.surfels), 16, 3)}
    return values, directions_of(world.surfels, eyes, EXTENT)


def open_surfels(world: World, directions: Directions) -> torch.Tensor:
    """On the board, far from everything else."""
    (rows,) = ((world.surfels.centres[:, 2] > 0.3) & (directions.through.mean(dim=1) > 0.99)).nonzero(
        as_tuple=True
    )
    assert len(rows) > 10
    return rows


def test_in_an_even_sky_it_is_the_split_sum(world: World, lit: tuple[dict[str, torch.Tensor], Directions]):
    """The sum is exact there: the mean over directions is the integral, as far as 48 of them can tell."""
    values, directions = lit
    rows = open_surfels(world, directions)
    black = torch.full_like(values[BASE_COLOR], -20.0)
    values = values | {ROUGHNESS: torch.full_like(values[ROUGHNESS], 1.0), BASE_COLOR: black}
    sky = torch.full((6, 4, 4, 3), 2.0)
    found = returned(values, directions, from_sky(sky, directions, rows), rows, EYE)
    roughness = 0.09 + 0.9 * torch.sigmoid(torch.tensor(1.0))
    material = Material(
        values[BASE_COLOR][rows].sigmoid(), roughness.expand(len(rows)), torch.zeros(len(rows))
    )
    eye = torch.nn.functional.normalize(EYE - values[CENTRES][rows], dim=-1)
    expected = lit_by_surroundings(material, directions.normals[rows], eye, surroundings_of(sky)).whole
    np.testing.assert_allclose(found, expected, rtol=0.1)
    white = values | {BASE_COLOR: -black}
    diffuse = returned(white, directions, from_sky(sky, directions, rows), rows, EYE) - found
    np.testing.assert_allclose(diffuse, 2.0, rtol=1e-3)


def test_light_of_its_own_is_never_negative(lit: tuple[dict[str, torch.Tensor], Directions]):
    values, directions = lit
    rows = torch.arange(20)
    random = torch.randn(len(values[OWN]), 16, 3, generator=torch.Generator().manual_seed(3))
    found = own_light(values | {OWN: random}, directions, rows)
    assert float(found.min()) == 0
    assert float(found.max()) > 0.5


def test_slopes_are_those_of_differences(lit: tuple[dict[str, torch.Tensor], Directions]):
    values, directions = lit
    double = {name: value.double() for name, value in values.items()}
    own = torch.rand(len(values[OWN]), 16, 3, generator=torch.Generator().manual_seed(4)).double()
    rays = Directions(*(getattr(directions, name).double() for name in Directions.__dataclass_fields__))
    rows = torch.tensor([3, 40, 200])

    def sent(base: torch.Tensor, rough: torch.Tensor, light: torch.Tensor) -> torch.Tensor:
        changed = double | {BASE_COLOR: base, ROUGHNESS: rough, OWN: light}
        return returned(changed, rays, own_light(changed, rays, rows) + 0.3, rows, EYE.double())

    inputs = [double[BASE_COLOR], double[ROUGHNESS], own]
    inputs = [value.detach()[: int(rows.max()) + 1].clone().requires_grad_() for value in inputs]
    assert torch.autograd.gradcheck(
        lambda *some: sent(*some).sum(dim=-1), tuple(inputs), atol=1e-6, fast_mode=True
    )


def test_what_is_behind_the_camera_is_not_in_view_and_what_reaches_into_it_is():
    camera = Camera.from_fov(20, 20, 50, look_at(np.array([0.0, -3, 0]), np.zeros(3)))
    places = torch.tensor([[0.0, 0, 0], [0, -6, 0], [0, 5, 0], [9, 0, 0], [9, 0, 0]])
    sizes = torch.tensor([0.1, 0.1, 0.1, 0.1, 4.0]).log()
    assert in_view({CENTRES: places, LOG_SCALES: sizes[:, None].expand(5, 2)}, camera).tolist() == [0, 2, 4]


def test_from_behind_a_surfel_looks_as_from_its_front(lit: tuple[dict[str, torch.Tensor], Directions]):
    values, directions = lit
    rows = torch.arange(30)
    incident = own_light(values | {OWN: torch.ones(len(values[OWN]), 16, 3)}, directions, rows)
    flat = values | {CENTRES: values[CENTRES] * torch.tensor([1.0, 1.0, 0.0])}
    front, back = (returned(flat, directions, incident, rows, EYE * s) for s in (1, torch.tensor([1, 1, -1])))
    assert (directions.normals[rows][:, 2] == 1).all()
    torch.testing.assert_close(front, back)


def test_edges_of_the_picture_may_be_edges_of_the_material():
    step = torch.zeros(6, 6, 1)
    step[:, 3:] = 2
    plain, edge = torch.zeros(6, 6, 3), torch.zeros(6, 6, 3)
    edge[:, 3:] = 1
    assert float(unevenness_but_for_edges(step, plain)) == pytest.approx(2 / 5)
    assert float(unevenness_but_for_edges(step, edge)) == pytest.approx(2 * np.exp(-1) / 5)
    assert float(unevenness_but_for_edges(step, plain, squared=True)) == pytest.approx(4 / 5)


@pytest.fixture(scope="module")
def scene(write_tiny: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny(tmp_path_factory.mktemp("r3dg"), track="multilight", train=4, test=1)


@pytest.fixture(scope="module")
def fitted(scene: Path) -> R3dgScene:
    return R3dgMethod().fit(with_points(scene), methods.Priors(), QUICK, 0, silent)


def cameras(scene: Path) -> list[Camera]:
    return [view.camera for view in open_capture(scene / "capture", check=False).views]


def test_it_follows_the_contract(scene: Path, fitted: R3dgScene):
    assert isinstance(R3dgMethod(), methods.Method)
    assert isinstance(fitted, methods.Decomposition)
    assert isinstance(fitted, methods.Relightable)
    assert isinstance(fitted, methods.Counting)
    for camera in cameras(scene):
        for layer, values in fitted.render(camera, sorted(fitted.provides)).items():
            assert find_fault(layer, values, camera.height, camera.width) is None, layer
            assert values.dtype == np.float32
    with pytest.raises(MethodError, match="expected layers out of"):
        fitted.render(cameras(scene)[0], ["metallic"])


def test_every_parameter_gets_a_slope_in_the_first_step(scene: Path, fitted: R3dgScene):
    values = {**fitted.parameters.all, **first_surfaces(len(fitted.parameters))}
    capture = open_capture(scene / "capture", check=False)
    views = [
        EncodedPhotograph(v.camera, torch.rand(v.camera.height, v.camera.width, 3), torch.empty(0))
        for v in capture.train
    ]
    shots = forward_views(views, values)
    free = {name: values[name].clone().requires_grad_() for name in (BASE_COLOR, ROUGHNESS, OWN, SKY)}
    look = R3dgObjective(shots, fitted.directions, QUICK, 0, 0)(values | free, 0)
    for name, slope in zip(free, torch.autograd.grad(look.loss, list(free.values())), strict=True):
        assert slope.isfinite().all(), name
        assert float(slope.abs().max()) > 0, name


def test_a_fit_comes_nearer_to_the_photographs(scene: Path):
    capture = with_points(scene)
    errors = []
    for steps in (1, 60):
        chosen = R3dgSettings(iterations=20 + steps, geometry_share=20 / (20 + steps), surfels=300, fill=0.0)
        found = R3dgMethod().fit(capture, methods.Priors(), chosen, 0, silent)
        seen = [found.render(view.camera, ["radiance"])["radiance"] for view in capture.train]
        shown = [capture.photograph(view) for view in capture.train]
        errors.append(np.mean([np.abs(a - b).mean() for a, b in zip(seen, shown, strict=True)]))
    assert errors[1] < 0.8 * errors[0]


def test_given_lamps_cast_shadows(world: World, lit: tuple[dict[str, torch.Tensor], Directions]):
    """A lamp over the board; the picture is in the lamp's unit whatever the exposure of the fit."""
    values, directions = lit
    shared = {SKY: torch.full((6, 4, 4, 3), -20.0)}
    lamp = PointLight("l", (0.1, 0.1, 1.5), (1.0, 1.0, 1.0))
    pictures = [
        R3dgScene(Parameters(values, shared), directions, QUICK, exposure, EXTENT)
        .relight((lamp,))
        ._sent(torch.arange(len(directions.normals)), EYE, world.shots[0].ground.camera)  # pyright: ignore[reportPrivateUsage]
        for exposure in (1.0, 3.0)
    ]
    torch.testing.assert_close(pictures[0], pictures[1])
    floor = values[CENTRES][:, 2] < 0.1
    under = floor & ((values[CENTRES][:, :2] - 0.1).abs().amax(dim=1) < 0.2)
    beside = floor & ((values[CENTRES][:, :2] - 0.1).norm(dim=1).sub(0.6).abs() < 0.1)
    assert float(pictures[0][under].mean()) < 0.1 * float(pictures[0][beside].mean())


def test_saved_and_loaded_it_is_the_same(scene: Path, fitted: R3dgScene, tmp_path: Path):
    lamp = PointLight("l", (0.5, 0.5, 1.5), (1.0, 2.0, 3.0))
    camera, names = cameras(scene)[-1], sorted(fitted.provides)
    for number, found in enumerate((fitted, fitted.relight((lamp, *fitted.lights())))):
        found.save(tmp_path / str(number))
        loaded = R3dgMethod().load(tmp_path / str(number))
        assert loaded.lights() == found.lights()
        for name, values in found.render(camera, names).items():
            np.testing.assert_array_equal(loaded.render(camera, names)[name], values)
    with pytest.raises(MethodError, match="got one by 'r3dg'"):
        methods.load_method("2dgs").load(tmp_path / "0")


def test_lights_that_are_given_add_up(scene: Path, fitted: R3dgScene):
    lamps = [PointLight(n, (x, 0.5, 1.5), (1.0, 2.0, 3.0)) for n, x in (("a", 0.5), ("b", -0.5))]
    camera = cameras(scene)[-1]
    one, other, both, dark = (
        fitted.relight(tuple(some)).render(camera, ["radiance"])["radiance"]
        for some in (lamps[:1], lamps[1:], lamps, [])
    )
    np.testing.assert_allclose(one + other, both, atol=1e-5 * float(both.max()))
    assert not dark.any()
    assert one.max() > 0


def test_the_same_seed_gives_the_same_bits(scene: Path, fitted: R3dgScene):
    again = R3dgMethod().fit(with_points(scene), methods.Priors(), QUICK, 0, silent)
    for name, values in fitted.parameters.all.items():
        np.testing.assert_array_equal(values, again.parameters.all[name])
