# SPDX-License-Identifier: Apache-2.0
"""The material against the renderer's own, and against physics."""

from typing import Any

import numpy as np
import pytest
import torch

from graycard.methods.shading import Material, ggx_density, scattering, schlick, smith_shadowing
from graycard.synth import Glossy, LambertGGX, Matte
from surface_interaction import directions, interaction

BASE = (0.6, 0.3, 0.1)
UP = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
Quadrature = tuple[torch.Tensor, torch.Tensor]


def material(
    roughness: float,
    metallic: float,
    base: tuple[float, float, float] = BASE,
    dtype: torch.dtype = torch.float64,
) -> Material:
    return Material(
        torch.tensor(base, dtype=dtype),
        torch.tensor(roughness, dtype=dtype),
        torch.tensor(metallic, dtype=dtype),
    )


def rendered(content: dict[str, Any], wi: np.ndarray, wo: np.ndarray, lobe: str = "All") -> np.ndarray:
    """Mitsuba's value with the cosine, shape ``(N, 3)``."""
    import mitsuba as mi

    from graycard.synth.renderer._mitsuba import load

    ctx = mi.BSDFContext()
    ctx.type_mask = getattr(mi.BSDFFlags, lobe)
    value = load(content).eval(ctx, interaction(wi), mi.Vector3f(wo.astype(np.float32)))
    return np.array(value, dtype=np.float64).T


def pair(
    seed: int, dtype: torch.dtype = torch.float64
) -> tuple[np.ndarray, np.ndarray, torch.Tensor, torch.Tensor]:
    """To the eye and to the light: as the renderer wants them, and as we do."""
    wi, wo = directions(seed), directions(seed + 100)
    return wi, wo, torch.from_numpy(wi.T.copy()).to(dtype), torch.from_numpy(wo.T.copy()).to(dtype)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32], ids=["double", "single"])
@pytest.mark.parametrize(
    ("roughness", "metallic"), [(0.1, 0.0), (0.3, 0.0), (0.3, 1.0), (0.7, 0.4), (1.0, 0.0)]
)
def test_it_is_the_truths_material(llvm: str, roughness: float, metallic: float, dtype: torch.dtype) -> None:
    from graycard.synth.renderer._mitsuba import _bsdf

    wi, wo, eye, light = pair(1, dtype)
    found = scattering(material(roughness, metallic, dtype=dtype), UP.to(dtype), eye, light)
    content = _bsdf(LambertGGX(BASE, roughness, metallic))
    for lobe, ours in (
        ("All", found.whole),
        ("DiffuseReflection", found.diffuse),
        ("GlossyReflection", found.specular),
    ):
        np.testing.assert_allclose(ours, rendered(content, wi, wo, lobe), rtol=1e-3, atol=2e-6)


@pytest.mark.parametrize("alpha", [0.02, 0.09, 0.5, 1.0])
def test_its_microfacets_are_those_of_a_perfect_mirror(llvm: str, alpha: float) -> None:
    """Mitsuba's rough conductor without absorption: F = 1, so D G / (4 cos) is all there is."""
    wi, wo, eye, light = pair(2)
    content = {"type": "roughconductor", "distribution": "ggx", "alpha": alpha, "material": "none"}
    found = scattering(material(alpha**0.5, 1.0, (1.0, 1.0, 1.0)), UP, eye, light).whole
    np.testing.assert_allclose(found, rendered(content, wi, wo), rtol=1e-3, atol=2e-6)


@pytest.mark.parametrize("roughness", [0.3, 0.6, 0.9])
def test_a_principled_metal_is_of_its_class(llvm: str, roughness: float) -> None:
    from graycard.synth.renderer._mitsuba import _bsdf

    wi, wo, eye, light = pair(3)
    found = scattering(material(roughness, 1.0), UP, eye, light).whole
    expected = rendered(_bsdf(Glossy(BASE, roughness, 1.0)), wi, wo)
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-5)


def test_a_principled_dielectric_is_not(llvm: str) -> None:
    """Disney's diffuse lobe is brighter where light returns to where it came from."""
    from graycard.synth.renderer._mitsuba import _bsdf

    wi, wo, eye, light = pair(4)
    found = scattering(material(0.9, 0.0), UP, eye, light).whole.numpy()
    expected = rendered(_bsdf(Glossy(BASE, 0.9)), wi, wo)
    off = np.abs(found - expected).mean() / expected.mean()
    assert 0.02 < off < 0.3


def test_what_is_matte_in_the_truth_lacks_the_glossy_lobe(llvm: str) -> None:
    """Its diffuse lobe is ours; the f0 of 0.04 that ours adds is a few hundredths of it."""
    from graycard.synth.renderer._mitsuba import _bsdf

    wi, wo, eye, light = pair(5)
    found, expected = scattering(material(1.0, 0.0), UP, eye, light), rendered(_bsdf(Matte(BASE)), wi, wo)
    np.testing.assert_allclose(found.diffuse, expected, rtol=1e-5)
    excess = found.specular.sum() / found.diffuse.sum()
    assert 0.01 < excess < 0.1


@pytest.mark.parametrize(("roughness", "metallic"), [(0.2, 0.0), (0.5, 0.5), (0.8, 1.0)])
def test_it_is_reciprocal(roughness: float, metallic: float) -> None:
    _, _, eye, light = pair(6)
    one, other = (
        scattering(material(roughness, metallic), UP, a, b).whole / b[:, 2:]
        for a, b in ((eye, light), (light, eye))
    )
    torch.testing.assert_close(one, other, rtol=1e-11, atol=0)


@pytest.mark.parametrize("roughness", [0.3, 0.5, 0.75, 1.0])
def test_facets_cover_the_surface_once(roughness: float, hemisphere: Quadrature) -> None:
    """The projected area of the microfacets is that of the surface: ``∫ D(h) n.h dh = 1``."""
    middle, angles = hemisphere
    density = ggx_density(UP, middle, torch.tensor(roughness**2, dtype=torch.float64))
    assert float((density * middle[:, 2] * angles).sum()) == pytest.approx(1, abs=2e-4)


@pytest.mark.parametrize("cosine", [0.1, 0.5, 0.95])
@pytest.mark.parametrize("roughness", [0.4, 0.8, 1.0])
def test_facets_that_are_seen_cover_what_is_seen(
    roughness: float, cosine: float, hemisphere: Quadrature
) -> None:
    """``∫ D(h) G(v) max(0, v.h) dh = n.v``: shadowing is just right (Heitz 2014)."""
    middle, angles = hemisphere
    alpha = torch.tensor(roughness**2, dtype=torch.float64)
    eye = torch.tensor([(1 - cosine**2) ** 0.5, 0.0, cosine], dtype=torch.float64)
    seen = ggx_density(UP, middle, alpha) * (middle @ eye).relu() * smith_shadowing(eye[2], alpha)
    assert float((seen * angles).sum()) == pytest.approx(cosine, rel=2e-3)


@pytest.mark.parametrize("cosine", [0.05, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("roughness", [0.4, 0.7, 1.0])
def test_a_white_metal_returns_no_more_than_it_gets(
    roughness: float, cosine: float, hemisphere: Quadrature
) -> None:
    light, angles = hemisphere
    eye = torch.tensor([(1 - cosine**2) ** 0.5, 0.0, cosine], dtype=torch.float64)
    whole = scattering(material(roughness, 1.0, (1.0, 1.0, 1.0)), UP, eye, light).whole
    returned = (whole * angles[:, None]).sum(dim=0)
    assert (returned < 1.001).all()
    assert (returned > 0.3).all()


@pytest.mark.parametrize("base", [0.2, 0.9])
def test_a_dielectric_returns_no_more_than_it_gets_over_all_directions(
    base: float, hemisphere: Quadrature
) -> None:
    light, angles = hemisphere
    height, weight = np.polynomial.legendre.leggauss(12)
    total = 0.0
    for cosine, share in zip((height + 1) / 2, weight / 2, strict=True):
        eye = torch.tensor([(1 - cosine**2) ** 0.5, 0.0, cosine], dtype=torch.float64)
        whole = scattering(material(0.5, 0.0, (base, base, base)), UP, eye, light).whole[:, 0]
        total += 2 * cosine * share * float((whole * angles).sum())
    assert base < total <= 1.0


def test_nothing_comes_from_behind() -> None:
    up, down = torch.tensor([[0.0, 0.6, 0.8]]), torch.tensor([[0.0, 0.6, -0.8]])
    normal, what = torch.tensor([[0.0, 0.0, 1.0]]), material(0.4, 0.3, dtype=torch.float32)
    for eye, light in ((up, down), (down, up), (down, down)):
        assert not scattering(what, normal, eye, light).specular.any()
    assert not scattering(what, normal, up, down).diffuse.any()
    assert scattering(what, normal, up, up).whole.all()


def test_behind_is_no_trap_for_gradients() -> None:
    """Slopes are 0, not nan, if nothing is returned."""
    normal = torch.tensor([[0.0, 0.0, 1.0]], requires_grad=True)
    color = torch.full((1, 3), 0.5, requires_grad=True)
    surface = Material(color, torch.tensor([0.3]), torch.tensor([0.2]))
    eye = torch.tensor([[0.0, 0.6, 0.8]])
    scattering(surface, normal, eye, -eye).whole.sum().backward()
    assert normal.grad is not None
    assert color.grad is not None
    assert normal.grad.isfinite().all()
    assert not color.grad.any()


def test_gradients() -> None:
    rng = torch.Generator().manual_seed(3)

    def drawn(*shape: int) -> torch.Tensor:
        return torch.rand(*shape, generator=rng, dtype=torch.float64)

    normal = torch.nn.functional.normalize(drawn(4, 3) * 0.2 + UP, dim=-1).requires_grad_()
    eye = torch.nn.functional.normalize(drawn(4, 3) + UP, dim=-1).requires_grad_()
    light = torch.nn.functional.normalize(drawn(4, 3) - 0.5 + 1.5 * UP, dim=-1).requires_grad_()
    inputs = drawn(4, 3).requires_grad_(), (0.2 + 0.7 * drawn(4)).requires_grad_(), drawn(4).requires_grad_()

    def value(*parts: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return tuple(scattering(Material(*parts[:3]), *parts[3:]))

    assert torch.autograd.gradcheck(value, (*inputs, normal, eye, light))


def test_a_sharp_lobe_survives_single_precision() -> None:
    """Roughness 0.02: with ``(n.h)² (alpha² - 1) + 1`` its peak would be lost in float32."""
    eye = torch.tensor([0.6, 0.0, 0.8], dtype=torch.float64)
    light = torch.tensor([-0.6, 1e-4, 0.8], dtype=torch.float64)
    light = light / light.norm()
    exact = scattering(material(0.02, 1.0), UP, eye, light).specular
    single = scattering(material(0.02, 1.0, dtype=torch.float32), UP.float(), eye.float(), light.float())
    torch.testing.assert_close(single.specular.double(), exact, rtol=1e-2, atol=0)
    assert exact.max() > 100


def test_parameters_of_the_lobes() -> None:
    some = Material(torch.tensor([[0.5, 0.2, 0.1]] * 2), torch.tensor([0.5, 0.0]), torch.tensor([0.25, 1.0]))
    torch.testing.assert_close(some.diffuse, torch.tensor([[0.375, 0.15, 0.075], [0.0, 0.0, 0.0]]))
    torch.testing.assert_close(some.f0[0], 0.03 + 0.25 * torch.tensor([0.5, 0.2, 0.1]))
    torch.testing.assert_close(some.alpha, torch.tensor([0.25, 1e-4]))
    torch.testing.assert_close(some[torch.tensor([False, True])].base_color, some.base_color[1:])


def test_fresnel_is_all_at_grazing_angles() -> None:
    torch.testing.assert_close(
        schlick(torch.tensor(0.04), torch.tensor([0.0, 1.0])), torch.tensor([1.0, 0.04])
    )
