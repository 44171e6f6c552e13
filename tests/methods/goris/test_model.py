# SPDX-License-Identifier: Apache-2.0
"""Glossy surfels show what reflected rays meet: a mirrored scene, numbers by hand, finite differences."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from glossy_sheets import (
    BOARD,
    EXTENT,
    FLOOR,
    OBJECT,
    SETTINGS,
    GlossyWorld,
    glossy_world,
    seen,
    shots_of_world,
    with_settings,
)
from graycard import Camera
from graycard.methods.goris import _model
from graycard.methods.goris._filter import Reading, translation_parameters
from graycard.methods.goris._model import (
    DIFFUSE,
    FRESNEL,
    LABEL,
    LEAST_GLOSS,
    REGION,
    ROUGHNESS,
    SURROUNDINGS,
    drawn_buffers,
    effect_of,
    fresnel,
    reflected_features,
    reflected_radiance,
)
from graycard.methods.goris._objective import (
    LightObjective,
    RadianceObjective,
    label_loss,
    normal_difference,
    normal_prior_weight,
    surface_loss,
    surface_unevenness,
)
from graycard.methods.goris._settings import Filter
from graycard.methods.goris._training_views import TrainingView
from graycard.methods.shading import prefiltered_skies
from graycard.methods.splat import CENTRES, ROTATIONS, Surfels, rasterize, surfels_of
from graycard.methods.surfels import COEFFICIENTS, DETAIL, sky_basis, srgb_decode_tensor, srgb_encode_tensor

NEAR = 0.02 * EXTENT


@pytest.fixture(scope="module")
def world() -> GlossyWorld:
    return glossy_world()


@pytest.mark.parametrize(
    ("width", "detail"),
    [pytest.param(1.0, 1.0, id="overlapping"), pytest.param(0.45, 5.0, id="apart")],
)
def test_a_planar_mirror_shows_the_mirrored_scene(world: GlossyWorld, width: float, detail: float):
    """Rays traced from an exact plane, against the boards below the floor, drawn by the rasteriser.

    Where discs of one plane overlap, rays and the rasteriser mix them in orders of their own: their colours
    are then alike, and steep only where discs are apart. What gets through depends on no order.
    """
    seen_by = world.cameras[0]
    camera = Camera.from_fov(176, 144, 55, seen_by.camera_to_world)  # discs are then wider than pixels
    above = torch.from_numpy(world.part != FLOOR)
    boards = {k: v[above] for k, v in world.parameters.surfels.items()}
    boards[CENTRES] = boards[CENTRES] + torch.tensor([0.0, 0.0, 0.2])  # off the floor, as rays begin near it
    discs = surfels_of(boards)
    discs = replace(discs, scales=width * discs.scales)
    rays = camera.rays()
    distance = -camera.position[2] / np.minimum(rays[..., 2:], -1e-3)
    buffers, _ = seen(world.parameters.all, camera)
    plane = replace(
        buffers,
        glossy=torch.ones(144, 176),
        normal=torch.tensor([0.0, 0.0, 1.0]).expand(144, 176, 3),
        points=torch.from_numpy(camera.position + distance * rays).float(),
    )
    colours = 0.5 + 0.4 * torch.sin(detail * boards[CENTRES])
    found = reflected_features(discs, colours, plane, NEAR)
    drawn = rasterize(_below(discs), camera, colours)
    mirrored = drawn.alpha > 0.5
    assert mirrored.sum() > 1500
    assert _psnr(found.radiance.reshape(144, 176, 3)[mirrored], drawn.features[mirrored]) > 40
    passed = found.passed[:, 0].reshape(144, 176)
    assert _psnr(passed[drawn.alpha > 0], 1 - drawn.alpha[drawn.alpha > 0]) > 90


def _psnr(found: torch.Tensor, expected: torch.Tensor) -> float:
    return float(-10 * torch.log10((found - expected).square().mean()))


def _below(surfels: Surfels) -> Surfels:
    """Mirrored by z = 0; a disc that is as wide as high is mirrored by turning it."""
    w, x, y, z = surfels.rotations.unbind(dim=1)
    turned = torch.stack([w, -x, -y, z], dim=1)
    return replace(surfels, centres=surfels.centres * torch.tensor([1.0, 1.0, -1.0]), rotations=turned)


def test_what_a_mirrored_ray_meets_is_seen_in_its_direction(world: GlossyWorld):
    """Harmonics along rays: colours that rise along the ray's x axis."""
    coefficients = torch.zeros(len(world.part), 15, 3)
    coefficients[:, 2] = 0.2  # the harmonic of degree 1 that goes with -x
    values = world.changed(**{DETAIL: coefficients})
    buffers, _ = seen(values, world.cameras[1])
    turned = reflected_radiance(values, buffers, with_settings(traced_degree=1), EXTENT)
    plain = reflected_radiance(values, buffers, with_settings(traced_degree=0), EXTENT)
    opaque = turned.passed[:, 0] < 1e-3
    assert opaque.sum() > 20
    rises = (srgb_encode_tensor(turned.radiance) - srgb_encode_tensor(plain.radiance))[opaque, 0]
    expected = -0.4886025 * 0.2 * turned.directions[opaque, 0]
    torch.testing.assert_close(rises, expected, atol=2e-3, rtol=0.02)


def test_pixels_are_mixed_of_what_is_rough_and_what_is_glossy(world: GlossyWorld):
    """By hand: C = M rough + (1 - M) (D + G); a region of 1 is rough, one of 0 glossy."""
    camera = world.cameras[2]
    buffers, picture = seen(world.parameters.all, camera)
    share = buffers.glossy[..., None]
    by_hand = (1 - share) * srgb_decode_tensor(buffers.rough) + share * (buffers.diffuse + picture.reflected)
    torch.testing.assert_close(srgb_decode_tensor(picture.encoded), by_hand, atol=1e-5, rtol=1e-4)
    floor = share[..., 0] > 0.9
    assert 200 < floor.sum() < 36 * 44
    assert (picture.reflected[floor] > 1e-3).all()
    flat = seen(world.changed(**{REGION: torch.full_like(world.parameters.all[REGION], 9.0)}), camera)
    torch.testing.assert_close(flat[1].encoded, flat[0].rough, atol=1e-3, rtol=1e-3)
    shiny, picture = seen(
        world.changed(**{REGION: torch.full_like(world.parameters.all[REGION], -12.0)}), camera
    )
    covered = shiny.drawn.alpha > 0.99
    torch.testing.assert_close(
        srgb_decode_tensor(picture.encoded)[covered],
        (shiny.diffuse + picture.reflected)[covered],
        atol=0.02,
        rtol=0.02,
    )


def test_the_papers_composite_adds_reflections_to_a_diffuse_term(world: GlossyWorld):
    camera, settings = world.cameras[2], with_settings(composite="paper")
    buffers, picture = seen(world.parameters.all, camera, settings)
    by_hand = srgb_decode_tensor(buffers.rough) + buffers.glossy[..., None] * picture.reflected
    torch.testing.assert_close(srgb_decode_tensor(picture.encoded), by_hand, atol=1e-5, rtol=1e-4)
    floor, all_of_it = buffers.glossy > 0.98, buffers.drawn.alpha > 0.99
    torch.testing.assert_close(
        srgb_decode_tensor(buffers.rough)[floor & all_of_it],
        buffers.diffuse[floor & all_of_it],
        atol=0.02,
        rtol=0.05,
    )


def test_without_transport_everything_is_rough(world: GlossyWorld):
    buffers, picture = seen(world.parameters.all, world.cameras[0], with_settings(transport=False))
    torch.testing.assert_close(picture.encoded, buffers.rough, atol=1e-5, rtol=1e-4)
    assert not picture.reflected.any()


def test_a_mirror_to_an_even_sky_returns_its_fresnel_term(world: GlossyWorld):
    """Boards taken away, a sky of radiance 2: the glossy term is 2 F, with F by hand."""
    floor = torch.from_numpy(world.part == FLOOR)
    left = world.parameters.take(floor)
    values = {**left.all, SURROUNDINGS: torch.full((6, 4, 4, 3), np.log(2.0), dtype=torch.float32)}
    camera = world.cameras[0]
    for blur in ("none", "paper", "release"):
        settings = with_settings(filter=blur)
        if blur == "release":
            values |= translation_parameters("release", 0)
        buffers, picture = seen(values, camera, settings)
        reflection = reflected_radiance(values, buffers, settings, EXTENT)
        view = torch.from_numpy(camera.rays()).float().reshape(-1, 3)[reflection.rows]
        cosine = -(view * buffers.normal.reshape(-1, 3)[reflection.rows]).sum(dim=-1, keepdim=True)
        expected = 0.4 + 0.6 * (1 - cosine) ** 5
        torch.testing.assert_close(fresnel(buffers, reflection), expected.expand(-1, 3), atol=1e-4, rtol=1e-4)
        found = picture.reflected.reshape(-1, 3)[reflection.rows]
        lit = reflection.passed[:, 0] > 0.999
        torch.testing.assert_close(found[lit], 2 * expected.expand(-1, 3)[lit], atol=0.01, rtol=0.01)


def test_the_effect_of_the_object_is_where_its_mirror_image_is(world: GlossyWorld):
    """Pixels whose reflected ray meets the object return by way of it what they reflect; no others do."""
    values, camera = world.parameters.all, world.cameras[0]
    buffers, _ = seen(values, camera)
    effect = effect_of(values, buffers, SETTINGS, EXTENT)
    theirs = torch.from_numpy((world.part == OBJECT).astype(np.float32))[:, None]
    met = reflected_features(surfels_of(values), theirs, buffers, NEAR)
    share = torch.zeros(36 * 44).index_put((met.rows,), met.radiance[:, 0]).reshape(36, 44)
    inside = (share > 0.99) & (buffers.glossy > 0.99)
    assert inside.sum() > 10
    assert ((effect[inside] > 0.35) & (effect[inside] < 0.6)).all(), "Fresnel term of 0.4 at the front"
    assert float(effect[share < 1e-6].max()) < 0.01
    gone = effect_of(
        world.changed(**{LABEL: torch.full_like(values[LABEL], -9.0)}), buffers, SETTINGS, EXTENT
    )
    assert float(gone.max()) < 1e-3


def test_no_ray_is_traced_for_rough_pixels(world: GlossyWorld):
    values = world.changed(**{REGION: torch.full_like(world.parameters.all[REGION], 12.0)})
    buffers, picture = seen(values, world.cameras[0], with_settings(filter="paper"))
    found = reflected_radiance(values, buffers, SETTINGS, EXTENT)
    assert float(buffers.glossy.max()) < LEAST_GLOSS
    assert len(found.rows) == 0
    assert not picture.reflected.any()


@pytest.mark.parametrize("composite", ["release", "paper"])
@pytest.mark.parametrize("blur", ["none", "paper", "release"])
def test_everything_that_moves_has_the_gradient_of_finite_differences(
    world: GlossyWorld, composite: Reading, blur: Filter
):
    """Along the signs of each gradient, against central differences of a weighted mean of the picture."""
    settings = with_settings(composite=composite, filter=blur)
    base = dict(world.parameters.all)
    if blur != "none":
        base |= translation_parameters(blur, 1)
    base[REGION] = 0.5 * base[REGION].clamp(-1, 1)  # where both terms count
    camera, random = world.cameras[3], torch.Generator().manual_seed(3)
    weight = torch.rand(36, 44, 3, generator=random)

    def looked(values: dict[str, torch.Tensor]) -> torch.Tensor:
        return (seen(values, camera, settings)[1].encoded * weight).mean()

    steps = {
        COEFFICIENTS: 2e-2,
        DETAIL: 2e-2,
        DIFFUSE: 2e-2,
        FRESNEL: 2e-2,
        ROUGHNESS: 2e-2,
        REGION: 2e-2,
        SURROUNDINGS: 2e-2,
    }
    leaves = {k: v.clone().requires_grad_(k in steps) for k, v in base.items()}
    found = torch.autograd.grad(looked(leaves), [leaves[k] for k in steps], allow_unused=True)
    for (name, step), gradient in zip(steps.items(), found, strict=True):
        assert gradient is not None, name
        direction = gradient.sign()
        with torch.no_grad():
            up, down = (looked({**base, name: base[name] + s * step * direction}) for s in (1, -1))
        expected = float((gradient * direction).sum())
        assert float(up - down) / (2 * step) == pytest.approx(expected, rel=0.03), name


MOVES = {
    "board": (5.0, 0.15),  # what is mirrored goes sideways
    "floor": (20.0, 0.1),  # the mirror rises: where rays begin
    "tilt": (100.0, 0.1),  # it is turned about x: where they go
}
"""Least change, and how far gradient and finite difference may be apart."""


@pytest.mark.parametrize("what", MOVES)
@pytest.mark.parametrize("degree", [0, 1])
def test_geometry_has_a_gradient_by_way_of_mirrored_rays(world: GlossyWorld, what: str, degree: int):
    """Only pixels of the floor are looked at, and of these only what they reflect."""
    camera, settings = world.cameras[0], with_settings(traced_degree=degree)
    coefficients = torch.zeros(len(world.part), 15, 3)
    coefficients[:, 1] = 0.3  # colours that change with the direction of a ray
    base = {**world.parameters.all, DETAIL: coefficients}
    fixed = drawn_buffers(base, camera, sky_basis(camera, 0), settings)
    weight = torch.linspace(0, 1, 44)[None, :, None] * (fixed.glossy > 0.98)[..., None]
    if what != "board":
        weight[:24] = 0  # higher up the order of discs of floor and boards changes, by jumps

    def looked(shift: torch.Tensor) -> torch.Tensor:
        return (seen(moved(world, base, what, shift), camera, settings)[1].reflected * weight).sum()

    shift = torch.zeros((), requires_grad=True)
    (gradient,) = torch.autograd.grad(looked(shift), shift)
    with torch.no_grad():
        change = float(looked(torch.tensor(2e-3)) - looked(torch.tensor(-2e-3))) / 4e-3
    least, apart = MOVES[what]
    assert abs(change) > least
    assert float(gradient) == pytest.approx(change, rel=apart)


def moved(
    world: GlossyWorld, base: dict[str, torch.Tensor], what: str, shift: torch.Tensor
) -> dict[str, torch.Tensor]:
    """The world with one of its parts elsewhere."""
    part = torch.from_numpy(world.part == (BOARD if what == "board" else FLOOR))[:, None].float()
    centres, rotations = base[CENTRES], base[ROTATIONS]
    if what == "tilt":
        cos, sin, half = shift.cos(), shift.sin(), 0.5 * shift
        x, y, z = centres.unbind(dim=1)
        turned = torch.stack([x, cos * y - sin * z, sin * y + cos * z], dim=1)
        w, i, j, k = rotations.unbind(dim=1)
        c, s = half.cos(), half.sin()
        after = torch.stack([c * w - s * i, c * i + s * w, c * j - s * k, c * k + s * j], dim=1)
        return {
            **base,
            CENTRES: centres + part * (turned - centres),
            ROTATIONS: rotations + part * (after - rotations),
        }
    axis = torch.tensor([1.0, 0.0, 0.0] if what == "board" else [0.0, 0.0, 1.0])
    return {**base, CENTRES: centres + part * shift * axis}


def test_normals_are_held_to_the_prior_where_surfaces_are_glossy(world: GlossyWorld):
    """Polarity: wrong normals on the floor cost, on boards or where nothing is known they cost nothing."""
    shot = shots_of_world(world)[0]
    buffers, _ = seen(world.parameters.all, world.cameras[0])
    assert shot.normal is not None
    right = float(normal_difference(buffers.normal, shot))
    assert right < 0.02
    up, down = torch.tensor([0.0, 0.0, 1.0]), torch.tensor([0.0, 0.0, -1.0])
    glossy = shot.glossy[..., None] > 0.5
    on_floor, beside = torch.where(glossy, down, up), torch.where(glossy, up, down)
    floor = replace(shot, normal=on_floor.expand(36, 44, 3))
    boards = replace(shot, normal=beside.expand(36, 44, 3))
    assert float(normal_difference(buffers.normal, floor)) > 1.5 * float(shot.glossy.mean())
    assert float(normal_difference(buffers.normal, boards)) < 0.02
    assert float(normal_difference(buffers.normal, floor, kept=torch.zeros(36, 44))) == 0
    assert float(normal_difference(buffers.normal, replace(floor, normal=torch.zeros(36, 44, 3)))) == 0
    assert float(normal_difference(buffers.normal, replace(floor, normal=None))) == 0


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_steps_in_colours_alone_hold_normals_too(world: GlossyWorld, weight: float):
    """Without that a mirror becomes a room behind it."""
    shots = shots_of_world(world)
    settings = with_settings(normal_prior_weight=weight)
    wrong = [replace(shot, normal=-shot.normal) for shot in shots if shot.normal is not None]
    right, other = (
        float(RadianceObjective(some, settings, 0)(world.parameters.all, 0).loss.detach())
        for some in (shots, wrong)
    )
    assert (other > right + 0.1) is (weight > 0)


def test_unevenness_of_surfaces_counts_on_glossy_surfaces_but_not_at_edges_of_the_photograph(
    world: GlossyWorld,
):
    """By hand: f0 rises by 0.1 from one pixel to the next, all else is even."""
    shot, buffers = shots_of_world(world)[0], seen(world.parameters.all, world.cameras[0])[0]
    shape = 36, 44
    ramp = 0.1 * torch.arange(44).float().expand(shape)

    def of(f0: torch.Tensor, photograph: torch.Tensor, glossy: torch.Tensor) -> float:
        drawn = replace(buffers.drawn, depth=torch.ones(shape))
        even = replace(buffers, drawn=drawn, f0=f0[..., None].expand(*shape, 3), roughness=torch.zeros(shape))
        even = replace(even, normal=torch.tensor([0.0, 0.0, 1.0]).expand(*shape, 3))
        view = replace(shot.photograph, encoded=photograph[..., None].expand(*shape, 3))
        return float(surface_unevenness(even, replace(shot, photograph=view, glossy=glossy)))

    def more(photograph: torch.Tensor, glossy: torch.Tensor) -> float:
        """Beside what an even f0 costs: normals of depth end at the border."""
        return of(ramp, photograph, glossy) - of(0 * ramp, photograph, glossy)

    plain, everywhere = torch.full(shape, 0.5), torch.ones(shape)
    assert more(plain, everywhere) == pytest.approx(0.1, rel=1e-3)
    assert of(ramp, plain, 0 * everywhere) == 0
    edges = 0.25 * torch.arange(44).float().expand(shape)
    assert more(edges, everywhere) == pytest.approx(0.1 * np.exp(-2), rel=1e-3)
    half = (torch.arange(44) < 22).float().expand(shape)
    assert more(plain, half) == pytest.approx(21 / 43 * 0.1, rel=1e-3)


def test_labels_are_held_to_the_masks_of_the_object(world: GlossyWorld):
    shot, buffers = shots_of_world(world)[0], seen(world.parameters.all, world.cameras[0])[0]
    right, wrong = (
        float(label_loss(buffers, replace(shot, target=t))) for t in (shot.target, 1 - shot.target)
    )
    assert right < 0.1
    assert wrong > 3
    half = replace(buffers, label=torch.full_like(buffers.label, 0.5))
    assert float(label_loss(half, shot)) == pytest.approx(np.log(2), rel=1e-5)


def test_the_region_is_held_to_what_the_prior_calls_glossy(world: GlossyWorld):
    """Polarity: regions that are those of the prior cost nothing, the opposite all."""
    shot = shots_of_world(world)[0]
    settings = with_settings(
        cover_weight=0.0, distortion_weight=0.0, normal_prior_weight=0.0, region_weight=2.0
    )
    values = world.parameters.all
    right = surface_loss(seen(values, world.cameras[0])[0], shot, settings, 0)
    wrong = surface_loss(
        seen(world.changed(**{REGION: -values[REGION]}), world.cameras[0])[0], shot, settings, 0
    )
    covered = float((seen(values, world.cameras[0])[0].drawn.alpha > 0.5).float().mean())
    assert float(right) < 0.1
    assert float(wrong) > 1.7 * covered
    unasked = surface_loss(seen(values, world.cameras[0])[0], replace(shot, told=False), settings, 0)
    assert float(unasked) == pytest.approx(0.0, abs=1e-6)


def test_the_weight_of_the_priors_normals_decays():
    paper = with_settings(iterations=1000, decay_share=0.2, normal_prior_weight=0.5)
    assert normal_prior_weight(paper, 0) == pytest.approx(0.5)
    assert normal_prior_weight(paper, 100) == pytest.approx((0.5 * 1e-3) ** 0.5)
    assert normal_prior_weight(paper, 200) == pytest.approx(1e-3)
    assert normal_prior_weight(paper, 900) == pytest.approx(1e-3)
    linear = replace(paper, decay="linear")
    assert normal_prior_weight(linear, 100) == pytest.approx((0.5 + 1e-3) / 2)
    assert normal_prior_weight(replace(paper, normal_prior_weight=0.0), 0) == 0.0


def test_the_objective_is_low_at_the_truth_and_moves_everything(world: GlossyWorld):
    shots = shots_of_world(world)
    objective = LightObjective(shots, SETTINGS, EXTENT, 0)
    start = world.parameters.all
    at_truth = float(objective(start, 0).loss.detach())
    for name in (DIFFUSE, FRESNEL, REGION, LABEL, SURROUNDINGS):
        off = objective({**start, name: start[name] + 1.0}, 0).loss
        assert float(off.detach()) > at_truth + 1e-4, name
    names = (CENTRES, ROTATIONS, COEFFICIENTS, DIFFUSE, FRESNEL, REGION, LABEL, SURROUNDINGS)
    leaves = {k: v.clone().requires_grad_(k in names) for k, v in start.items()}
    moved = {**leaves, DIFFUSE: leaves[DIFFUSE] + 0.3}
    found = torch.autograd.grad(objective(moved, 0).loss, [leaves[k] for k in names])
    for name, gradient in zip(names, found, strict=True):
        assert gradient.isfinite().all(), name
        assert gradient.any(), name


def told_wrong_normals(world: GlossyWorld) -> list[TrainingView]:
    """Shots whose normals have their axes exchanged."""
    return [
        replace(shot, normal=None if shot.normal is None else shot.normal.flip(-1))
        for shot in shots_of_world(world)
    ]


@pytest.mark.parametrize(
    "name",
    ["normal_prior_weight", "smooth_weight", "sky_weight", "region_weight", "label_weight", "weights"],
)
def test_the_loss_is_linear_in_each_weight(world: GlossyWorld, name: str):
    """Nothing at 0, twice as much at twice the weight, of surfels that each term disapproves of."""
    draws = torch.Generator().manual_seed(0)
    wrong = {
        part: values + 0.5 * torch.randn(values.shape, generator=draws)
        for part, values in world.parameters.all.items()
        if part in (ROUGHNESS, REGION, LABEL, SURROUNDINGS)
    }
    values = world.changed(**wrong)
    shots = told_wrong_normals(world)
    found = []
    for factor in (0.0, 1.0, 2.0):
        settings = with_settings(**{name: factor})
        found.append(float(LightObjective(shots, settings, EXTENT, 0)(values, 0).loss.detach()))
    assert found[1] - found[0] > 1e-4
    assert found[2] - found[0] == pytest.approx(2 * (found[1] - found[0]), rel=1e-3)


def test_steps_in_colours_alone_have_the_factor_on_weights_too(world: GlossyWorld):
    shots = told_wrong_normals(world)
    found = [
        float(
            RadianceObjective(shots, with_settings(weights=factor), 0)(world.parameters.all, 0).loss.detach()
        )
        for factor in (0.0, 1.0, 2.0)
    ]
    assert found[1] - found[0] > 1e-3
    assert found[2] - found[0] == pytest.approx(2 * (found[1] - found[0]), rel=1e-3)


def test_glossy_surfaces_do_not_mirror_each_other_but_on_request(world: GlossyWorld):
    """A board that is glossy is not met; in the released code's reading it is."""
    region = world.parameters.all[REGION].clone()
    region[torch.from_numpy(world.part == OBJECT)] = -6.0
    values, camera = world.changed(**{REGION: region}), world.cameras[0]
    buffers, _ = seen(world.parameters.all, camera)
    rough, everything = (
        reflected_radiance(values, buffers, with_settings(traced=traced), EXTENT)
        for traced in ("rough", "all")
    )
    theirs = torch.from_numpy((world.part == OBJECT).astype(np.float32))[:, None]
    met = reflected_features(surfels_of(values), theirs, buffers, NEAR).radiance[:, 0] > 0.99
    assert met.sum() > 10
    assert float((rough.passed[met] > 0.99).float().mean()) > 0.7, "but for the board behind"
    assert float(everything.passed[met].max()) < 0.02


def test_where_everything_is_glossy_mirrors_show_the_surroundings(world: GlossyWorld):
    """No surfel is left to be met: every ray passes."""
    values = world.changed(**{REGION: torch.full_like(world.parameters.all[REGION], -6.0)})
    buffers, picture = seen(values, world.cameras[0], with_settings(filter="paper"))
    found = reflected_radiance(values, buffers, SETTINGS, EXTENT)
    assert (found.passed == 1).all()
    assert not found.radiance.any()
    assert picture.encoded.isfinite().all()
    assert float(picture.reflected.max()) > 0.1


def test_a_fine_environment_is_filtered_from_a_coarser_one(world: GlossyWorld):
    """A mirror shows it as sharp as it is, a rough surface as it is when filtered as a whole."""
    sky = torch.full((6, 64, 64, 3), 0.2)
    sky[4, 20:31, 30:47] = 5.0
    found, whole = _model._skies(sky), prefiltered_skies(sky)
    assert torch.equal(found[0], sky)
    for coarse, fine in zip(found[1:], whole[1:], strict=True):
        torch.testing.assert_close(coarse, fine, atol=0.1 * float(fine.max()), rtol=0)
