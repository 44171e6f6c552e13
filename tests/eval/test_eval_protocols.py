# SPDX-License-Identifier: Apache-2.0
"""Each published protocol against its definition, written out on whole images in a few lines."""

import math
from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from scipy.ndimage import minimum_filter
from scipy.optimize import brute

import graycard.eval as ge
from graycard import DatasetError, PredictionError, UnknownNameError
from graycard.eval.protocols import (
    ALBEDO,
    PUBLISHED,
    Experiment,
    JudgedView,
    JudgedViews,
    PublishedProtocol,
    albedo_views,
)

VIEWS = albedo_views(Experiment(0.3, views=3, size=50, seed=1001))
MANY = albedo_views(Experiment(0.3, views=43, size=30, seed=1002))
Images = tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]


def protocol(name: str) -> PublishedProtocol:
    (found,) = ge.find_protocols(name)
    assert isinstance(found, PublishedProtocol)
    return found


def images(views: JudgedViews) -> Images:
    """Predictions, truths and masks ``(H, W, 1)``, whole images."""
    return (
        [v.predicted for v in views.test],
        [v.true for v in views.test],
        [v.mask[..., None] for v in views.test],
    )


def db(mse: float) -> float:
    return 10 * math.log10(1 / mse)


def inside(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    return image[mask[..., 0]]


def middle(values: np.ndarray) -> float:
    """The median that torch has: of two middle values the lower."""
    return sorted(values.ravel().tolist())[(values.size - 1) // 2]


def srgb(x: np.ndarray) -> np.ndarray:
    x = np.clip(x, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def linear(x: np.ndarray) -> np.ndarray:
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def png(x: np.ndarray) -> np.ndarray:
    return (np.clip(x, 0, 1) * 255 + 0.5).astype(np.uint8) / 255.0


def cut_png(x: np.ndarray) -> np.ndarray:
    """8 bits by ``astype``, which rounds down."""
    return (np.clip(x, 0, 1) * 255).astype(np.uint8) / 255.0


def raw_linear(views: JudgedViews) -> float:
    return float(
        np.mean([db(((p - g)[m[..., 0]] ** 2).mean()) for p, g, m in zip(*images(views), strict=True)])
    )


def raw_srgb(views: JudgedViews) -> float:
    triples = zip(*images(views), strict=True)
    return float(np.mean([db(((srgb(p) - srgb(g))[m[..., 0]] ** 2).mean()) for p, g, m in triples]))


def marigold_gamma(views: JudgedViews) -> float:
    triples = zip(*images(views), strict=True)
    each = [(((p ** (1 / 2.2)) - (g ** (1 / 2.2)))[m[..., 0]] ** 2).mean() for p, g, m in triples]
    return float(np.mean([db(mse) for mse in each]))


def global_lsq(views: JudgedViews) -> float:
    ps, gs, ms = images(views)
    p = np.concatenate([inside(p, m) for p, m in zip(ps, ms, strict=True)])
    g = np.concatenate([inside(g, m) for g, m in zip(gs, ms, strict=True)])
    s = np.linalg.lstsq(p.reshape(-1, 1), g.ravel())[0].item()
    return float(
        np.mean([db(((s * p - g)[m[..., 0]] ** 2).mean()) for p, g, m in zip(ps, gs, ms, strict=True)])
    )


def channel_lsq(views: JudgedViews) -> float:
    ps, gs, ms = images(views)
    p = np.concatenate([inside(p, m) for p, m in zip(ps, ms, strict=True)])
    g = np.concatenate([inside(g, m) for g, m in zip(gs, ms, strict=True)])
    s = np.array([np.linalg.lstsq(p[:, [c]], g[:, c])[0].item() for c in range(3)])
    return float(
        np.mean([db(((s * p - g)[m[..., 0]] ** 2).mean()) for p, g, m in zip(ps, gs, ms, strict=True)])
    )


def nerfactor(views: JudgedViews) -> float:
    first = views.validation
    assert first is not None
    hat, x = cut_png(first.predicted ** (1 / 2.2))[first.mask] ** 2.2, png(first.true)[first.mask]
    s = np.array([hat[:, c] @ x[:, c] / (hat[:, c] @ hat[:, c]) for c in range(3)])
    each = []
    for p, g, m in zip(*images(views), strict=True):
        corrected = s * cut_png(p ** (1 / 2.2)) ** 2.2
        each.append(db(((corrected - png(g))[m[..., 0]] ** 2).mean()))
    return float(np.mean(each))


def orb_albedo(views: JudgedViews) -> float:
    each = []
    for p, g, m in zip(*images(views), strict=True):
        eroded = minimum_filter(m[..., 0].astype(float), 5, mode="constant", cval=1)[..., None]
        p0, g0 = p * eroded, g * eroded
        s = (p0 * g0).sum((0, 1)) / (p0**2).sum((0, 1))
        mse = ((np.clip(s * p0, 0, 1) - np.clip(g0, 0, 1)) ** 2).mean()
        gray = ((0.5 * eroded - np.clip(g0, 0, 1)) ** 2).mean()
        each.append(max(db(mse), db(gray)))
    return float(np.mean(each))


def tensoir(views: JudgedViews, ratio: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> float:
    ps, gs, ms = images(views)
    interval = len(ps) // 20
    chosen = [i * interval for i in range(20)]
    p_seen = np.concatenate([inside(ps[i], ms[i]) for i in chosen])
    g_seen = np.concatenate([inside(gs[i], ms[i]) for i in chosen])
    s = ratio(g_seen, np.maximum(p_seen, 1e-6))
    shown = [np.where(m, np.clip(s * p, 0, 1), 1.0) ** (1 / 2.2) for p, m in zip(ps, ms, strict=True)]
    true = [np.where(m, g, 1.0) ** (1 / 2.2) for g, m in zip(gs, ms, strict=True)]
    return db(np.mean((np.stack(true) - np.stack(shown)) ** 2).item())


def tensoir_three(views: JudgedViews) -> float:
    return tensoir(views, lambda g, p: np.array([middle(g[:, c] / p[:, c]) for c in range(3)]))


def tensoir_single(views: JudgedViews) -> float:
    return tensoir(views, lambda g, p: np.array(middle((g / p)[:, 0])))


def graphdeco_psnr(a: np.ndarray, b: np.ndarray) -> float:
    """A PSNR for each channel, then their mean."""
    return float(np.mean([20 * math.log10(1 / math.sqrt(((a - b)[..., c] ** 2).mean())) for c in range(3)]))


def gs_ir(views: JudgedViews) -> float:
    ps, gs, ms = images(views)
    ps = [png(p) for p in ps]
    gs = [png(g) * m for g, m in zip(gs, ms, strict=True)]
    p = np.concatenate([inside(p, m) for p, m in zip(ps, ms, strict=True)])
    g = np.concatenate([inside(g, m) for g, m in zip(gs, ms, strict=True)])
    s = np.array([middle(g[:, c] / np.maximum(p[:, c], 1e-6)) for c in range(3)])
    triples = zip(ps, gs, ms, strict=True)
    return float(np.mean([graphdeco_psnr(g, np.where(m, s * p, p)) for p, g, m in triples]))


def r3dg(views: JudgedViews, encode: Callable[[np.ndarray], np.ndarray]) -> float:
    """Fit the constants in the encoding that is handed in; compare sRGB, on white."""
    ps, gs, ms = images(views)
    gs = [png(srgb(g)) for g in gs]
    p, g = np.clip(encode(inside(ps[0], ms[0])), 1e-6, 1), encode(linear(inside(gs[0], ms[0])))
    s = np.array([middle(g[:, c] / p[:, c]) for c in range(3)])
    white = [(srgb(s * p) * m + (1 - m), g * m + (1 - m)) for p, g, m in zip(ps, gs, ms, strict=True)]
    return float(np.mean([graphdeco_psnr(a, b) for a, b in white]))


def r3dg_syn4(views: JudgedViews) -> float:
    return r3dg(views, srgb)


def r3dg_syn4_linear(views: JudgedViews) -> float:
    return r3dg(views, lambda x: x)


def irgs(views: JudgedViews, stored: Callable[[np.ndarray], np.ndarray], coloured: bool) -> float:
    ps, gs, ms = images(views)
    gs = [stored(g) for g in gs]
    p = np.concatenate([inside(p, m) for p, m in zip(ps, ms, strict=True)])
    g = np.concatenate([inside(g, m) for g, m in zip(gs, ms, strict=True)])
    fair = (g > 0).all(-1) if coloured else np.ones(len(g), bool)
    s = np.array([middle((g / np.maximum(p, 1e-6))[fair, c]) for c in range(3)])
    black = [(s * p * m, g * m) for p, g, m in zip(ps, gs, ms, strict=True)]
    return float(np.mean([graphdeco_psnr(a, b) for a, b in black]))


def irgs_syn4(views: JudgedViews) -> float:
    return irgs(views, lambda g: linear(png(srgb(g))), coloured=False)


def irgs_tensoir(views: JudgedViews) -> float:
    return irgs(views, png, coloured=True)


def nvdiffrec(views: JudgedViews) -> float:
    ps, gs, ms = images(views)
    ps, gs = ([linear(png(srgb(x))) * m for x, m in zip(xs, ms, strict=True)] for xs in (ps, gs))
    s = sum(g.sum() for g in gs) / sum(p.sum() for p in ps)
    each = [((srgb(s * p) - srgb(g)) ** 2).mean() for p, g in zip(ps, gs, strict=True)]
    return float(np.mean([db(mse) for mse in each]))


def nvdiffrecmc_relit(views: JudgedViews) -> float:
    black = [(p * m, g * m) for p, g, m in zip(*images(views), strict=True)]
    each = [((srgb(g.sum() / p.sum() * p) - srgb(g)) ** 2).mean() for p, g in black]
    return float(np.mean([db(mse) for mse in each]))


def owl(views: JudgedViews) -> float:
    """The optimum on a grid that is made finer around its best point, instead of a search."""
    each = []
    for p, g, m in zip(*images(views), strict=True):
        p, g = inside(p, m), png(inside(g, m) ** (1 / 2.2)) ** 2.2
        fair = g.max(axis=-1) < 1
        lowest = p[fair].min(axis=-1)
        most = math.log2(0.95**2.2 / lowest[lowest > 0].min())

        def shown(x: np.ndarray, stops: float) -> np.ndarray:
            return np.clip((x * 2**stops) ** (1 / 2.2), 0, 1)

        def exposure_error(x, p=p[fair], g=g[fair]) -> float:
            return float(np.abs(shown(p, float(np.squeeze(x))) - g ** (1 / 2.2)).mean())

        stops = refine(exposure_error, -10, most)
        balance = np.ones(3)
        for c in range(3):

            def balance_error(x, p=p[fair][:, c], g=g[fair][:, c], stops=stops) -> float:
                return float(np.abs(shown(p * float(np.squeeze(x)), stops) - g ** (1 / 2.2)).mean())

            balance[c] = refine(balance_error, 0.5, 2)
        each.append(db(((shown(p * balance, stops) - g ** (1 / 2.2)) ** 2).mean()))
    return float(np.mean(each))


def refine(error: Callable[..., float], low: float, high: float) -> float:
    """The best point of a grid that is laid anew, 20 times finer, around its best point."""
    best = low
    for _ in range(8):
        best = float(np.squeeze(brute(error, ((low, high),), Ns=41, finish=None)))
        step = (high - low) / 40
        low, high = max(low, best - step), min(high, best + step)
    return best


def mit_lmse(views: JudgedViews, once_a_row: bool = False) -> float:
    each = []
    for p, g, m in zip(*images(views), strict=True):
        p, g, m = p.mean(-1), g.mean(-1), m[..., 0]
        error = total = 0.0
        for i in range(0, len(g) - 20 + 1, 10):
            for j in range(0, len(g[0]) - 20 + 1, 10):
                here = np.s_[i : i + 20, j : j + 20]
                pw, gw, mw = p[here], g[here], m[here]
                power = (pw**2 * mw).sum()
                alpha = (pw * gw * mw).sum() / power if power > 1e-5 else 0.0
                error += (mw * (gw - alpha * pw) ** 2).sum()
                if not once_a_row or j + 10 > len(g[0]) - 20:
                    total += (mw * gw**2).sum()
        each.append(error / total)
    return float(np.mean(each))


def mit_lmse_published(views: JudgedViews) -> float:
    return mit_lmse(views, once_a_row=True)


REFERENCES: dict[str, Callable[[JudgedViews], float]] = {
    "raw-linear": raw_linear,
    "raw-srgb": raw_srgb,
    "marigold-gamma": marigold_gamma,
    "global-lsq": global_lsq,
    "channel-lsq": channel_lsq,
    "nerfactor": nerfactor,
    "orb-albedo": orb_albedo,
    "tensoir-three": tensoir_three,
    "tensoir-single": tensoir_single,
    "gs-ir": gs_ir,
    "r3dg-syn4": r3dg_syn4,
    "r3dg-syn4-linear": r3dg_syn4_linear,
    "irgs-syn4": irgs_syn4,
    "irgs-tensoir": irgs_tensoir,
    "nvdiffrec": nvdiffrec,
    "nvdiffrecmc-relit": nvdiffrecmc_relit,
    "owl": owl,
    "mit-lmse": mit_lmse,
    "mit-lmse-published": mit_lmse_published,
}
ERRORS = [p.name for p in PUBLISHED if p.name in REFERENCES]
"""Albedo protocols that end in an error, and two for relit pictures, which are judged alike."""
STORED = ("nerfactor", "r3dg-syn4", "r3dg-syn4-linear", "irgs-syn4", "irgs-tensoir", "owl")
"""Those in which only the truth, or each picture in a way of its own, goes through 8 bits."""


@pytest.mark.parametrize("name", ERRORS)
@pytest.mark.parametrize("views", [VIEWS, MANY], ids=["3 views", "43 views"])
def test_a_protocol_is_its_definition(name: str, views: JudgedViews) -> None:
    if name == "owl" and views is MANY:
        views = replace(MANY, test=MANY.test[:4])
    tolerance = 1e-6 if name == "owl" else 1e-9  # what the finest grid of its reference resolves
    assert protocol(name).score(views).value == pytest.approx(REFERENCES[name](views), abs=tolerance)


@pytest.mark.parametrize("name", [name for name in ERRORS if name != "gs-ir"])
def test_the_background_of_a_prediction_does_not_enter(name: str) -> None:
    loud = [replace(v, predicted=np.where(v.mask[..., None], v.predicted, 7.0)) for v in VIEWS.test]
    assert protocol(name).score(replace(VIEWS, test=tuple(loud))).value == protocol(name).score(VIEWS).value


def test_gs_ir_alone_counts_what_is_predicted_outside_the_mask() -> None:
    loud = [replace(v, predicted=np.where(v.mask[..., None], v.predicted, 1.0)) for v in VIEWS.test]
    found = protocol("gs-ir").score(replace(VIEWS, test=tuple(loud))).value
    share = 1 - VIEWS.test[0].mask.mean()
    assert found == pytest.approx(-10 * math.log10(share), abs=0.1), "white on black, over the background"
    hollow = [replace(v, predicted=np.where(v.mask[..., None], v.predicted, np.nan)) for v in VIEWS.test]
    hollow_views = replace(VIEWS, test=tuple(hollow))
    assert protocol("gs-ir").score(hollow_views) == protocol("gs-ir").score(VIEWS), "a NaN there is black"


@pytest.mark.parametrize("name", ERRORS)
def test_the_truth_scores_as_well_as_its_storage_allows(name: str) -> None:
    exact = [
        replace(v, predicted=np.where(v.mask[..., None], v.true, 0.0))
        for v in (*VIEWS.test, VIEWS.validation)
        if v is not None
    ]
    found = protocol(name).score(JudgedViews(tuple(exact[:-1]), exact[-1])).value
    if name.startswith("mit-lmse"):
        assert found == pytest.approx(0, abs=1e-15)
    elif name in STORED:
        assert 48 < found < 70, "8 bits against none, or against 8 bits of another encoding"
    else:
        assert found > 200


def test_a_floor_saves_a_prediction_that_is_wrong_everywhere() -> None:
    inverted = tuple(replace(v, predicted=1 - v.true) for v in VIEWS.test)
    whole = protocol("orb-albedo")
    lowest = replace(whole, floor=None)  # pyright: ignore[reportCallIssue]
    views = JudgedViews(inverted)
    assert whole.score(views).value >= lowest.score(views).value
    gray = JudgedViews(
        tuple(replace(v, predicted=np.random.default_rng(1).random(v.true.shape)) for v in inverted)
    )
    assert whole.score(gray).value > lowest.score(gray).value + 0.1


def test_the_background_alone_is_worth_its_share() -> None:
    masked = replace(protocol("tensoir-three"), pixels="mask")  # pyright: ignore[reportCallIssue]
    gain = protocol("tensoir-three").score(VIEWS).value - masked.score(VIEWS).value
    assert gain == pytest.approx(-10 * math.log10(VIEWS.test[0].mask.mean()), abs=1e-9)


def test_a_psnr_for_each_channel_is_never_less() -> None:
    together = replace(protocol("gs-ir"), channels="together")  # pyright: ignore[reportCallIssue]
    assert protocol("gs-ir").score(VIEWS).value > together.score(VIEWS).value


def test_a_black_channel_is_met_by_a_reason_or_by_the_published_way_out() -> None:
    black = JudgedViews(tuple(replace(v, predicted=v.predicted * (1, 0, 1)) for v in VIEWS.test))
    with pytest.raises(PredictionError, match=r"expected base_color that positive factors .* Predict"):
        protocol("channel-lsq").score(black)
    assert math.isfinite(protocol("orb-albedo").score(black).value)


def test_all_black_predictions() -> None:
    black = JudgedViews(tuple(replace(v, predicted=0 * v.predicted) for v in VIEWS.test))
    for name in ("global-lsq", "channel-lsq", "nvdiffrec", "owl"):
        with pytest.raises(PredictionError, match="expected base_color that positive factors"):
            protocol(name).score(black)
    assert protocol("mit-lmse").score(black).value == 1


def test_a_negative_prediction_is_not_turned_around() -> None:
    negative = JudgedViews(tuple(replace(v, predicted=-v.predicted) for v in VIEWS.test))
    with pytest.raises(PredictionError, match="got the factors -"):
        protocol("channel-lsq").score(negative)
    assert protocol("mit-lmse").score(negative).value == 1


def test_masks_too_narrow_to_erode_and_images_too_small_for_a_window() -> None:
    thin = np.zeros((50, 50), bool)
    thin[25:28] = True
    with pytest.raises(DatasetError, match="view_001 to see something inside its mask eroded by 5 pixels"):
        protocol("orb-albedo").score(JudgedViews((replace(VIEWS.test[0], mask=thin, name="view_001"),)))
    small = JudgedView("v", np.ones((19, 30, 3)), np.ones((19, 30, 3)), np.ones((19, 30), bool))
    with pytest.raises(DatasetError, match="at least 20x20 pixels for LMSE, got 30x19. Render"):
        protocol("mit-lmse").score(JudgedViews((small,)))
    nothing = replace(
        small, true=np.zeros((30, 30, 3)), predicted=np.zeros((30, 30, 3)), mask=np.ones((30, 30), bool)
    )
    with pytest.raises(DatasetError, match="window of 20x20 pixels that sees a colour, got none"):
        protocol("mit-lmse").score(JudgedViews((nothing,)))


def test_an_edge_of_the_picture_is_not_eroded() -> None:
    filled = replace(VIEWS.test[0], mask=np.ones((50, 50), bool))
    views = JudgedViews((filled,))
    assert protocol("orb-albedo").score(views).value == pytest.approx(orb_albedo(views), abs=1e-9)


def test_a_protocol_that_needs_a_view_that_is_not_scored() -> None:
    with pytest.raises(PredictionError, match="on the first training view, where nerfactor fits its factors"):
        protocol("nerfactor").score(replace(VIEWS, validation=None))


def test_factors_are_given_where_all_views_share_them() -> None:
    assert protocol("raw-linear").score(VIEWS).gauge is None
    assert protocol("orb-albedo").score(VIEWS).gauge is None
    assert protocol("mit-lmse").score(VIEWS).gauge is None
    three, single = (
        protocol("tensoir-three").score(VIEWS).gauge,
        protocol("tensoir-single").score(VIEWS).gauge,
    )
    assert three is not None
    assert single == (three[0],) * 3
    assert three == pytest.approx((1 / 1.35, 1, 1 / 0.7), rel=0.15)


def test_protocols_are_immutable_named_and_versioned() -> None:
    names = [p.name for p in ge.all_protocols()]
    assert len(set(names)) == len(names)
    assert set(REFERENCES) <= set(names)
    assert {p.name for p in ALBEDO} <= set(REFERENCES)
    for p in ge.all_protocols():
        assert p.id == f"{p.name}-{p.version}"
        assert p.source
        assert p.summary
        assert ge.find_protocols(p.name) == ge.find_protocols(p.id) == (p,)
        with pytest.raises(FrozenInstanceError):
            p.version = 2  # pyright: ignore[reportAttributeAccessIssue]
        rules = p.rules_of("albedo.psnr.raw")
        assert all(getattr(rules, name) for name in rules.__dataclass_fields__)
    assert ge.find_protocols("all") == ge.all_protocols()
    assert ge.PROTOCOL == "graycard-1"


def test_an_unknown_name_gets_the_list() -> None:
    with pytest.raises(
        UnknownNameError, match=r"a protocol that exists, got 'tensoir3'.*did you mean.*orb-albedo"
    ):
        ge.find_protocols("tensoir3")


def test_rules_say_what_the_fields_say() -> None:
    orb = protocol("orb-albedo").rules_of("albedo.psnr")
    assert orb.pixels == "whole image, eroded 5x5"
    assert orb.pooling == "mean of PSNRs, at least that of gray 0.5"
    assert protocol("gs-ir").rules_of("albedo.psnr").space == "linear, 8 bits"
    (own,) = ge.find_protocols("graycard")
    assert own.rules_of("albedo.psnr.channel").fitted_on == "all training views"
    assert own.rules_of("novel_view.psnr").space == "sRGB"
    assert own.rules_of("normal.mean_angle").space == "world"
