# SPDX-License-Identifier: Apache-2.0
"""Objects that stand on tables: which ones, of what look, and where."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from graycard.synth._mesh import Mesh, blob, torus
from graycard.synth._scene import Texture
from graycard.synth._spectra import paint, scaled
from graycard.synth._stream import stream
from graycard.synth.families.props import _everyday as props
from graycard.synth.families.props import _textures as textures

_SHADES = ("moderate red", "orange", "purplish blue", "foliage", "blue sky", "yellow green", "light skin")
CREAM, NAVY = (0.6, 0.55, 0.45), (0.05, 0.07, 0.16)


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """An object that stands on z = 0 at the origin and has no place yet."""

    name: str
    shape: Mesh
    color: Texture
    glazed: bool = False
    """True if it is glazed where the family glazes anything."""

    @property
    def reach(self) -> float:
        """Largest distance from its axis, metres."""
        return float(np.linalg.norm(self.shape.vertices[:, :2], axis=1).max())


def target_of(seed: int, size: float) -> Piece:
    """Return the object that is to be removed: the tallest on the table, one of four kinds.

    Args:
        seed: Of the scene.
        size: Factor on its size.
    """
    rng = stream(seed, "target")
    piece = _TARGETS[rng.integers(len(_TARGETS))](rng)
    return replace(piece, shape=piece.shape.moved((0, 0, 0), size=size))


def others_of(seed: int, count: int) -> list[Piece]:
    """Return so many other objects, no kind twice; one more leaves those that were there as they were."""
    kinds = stream(seed, "objects").permutation(len(_OTHERS))[:count]
    return [_OTHERS[kind](stream(seed, f"object {kind}")) for kind in kinds]


def places(
    seed: int, target: float, others: Sequence[float], viewed_from: float, occlusion: float
) -> list[tuple[float, float]]:
    """Return where objects stand, so that none touches another: the target near the middle, then the others.

    A share ``occlusion`` of the others stands on the side of the cameras; each is pushed outwards from the
    target until it is clear of all before it, and the clearance shrinks as ``occlusion`` grows.

    Args:
        seed: Of the scene.
        target: How far the target reaches from its axis, metres.
        others: How far each of the others does, metres.
        viewed_from: Azimuth of the middle of the cameras' path, radians.
        occlusion: 0 to 1.

    Returns:
        ``(x, y)`` of the axes, metres; the target's first.
    """
    rng = stream(seed, "places")
    jitter = rng.uniform(-1, 1, size=(5, 3))
    middle = 0.03 * jitter[4, :2]
    found = [(middle, target)]
    clearance = 0.13 - 0.10 * occlusion
    for k, (angle, reach) in enumerate(zip(_angles(len(others), occlusion), others, strict=True)):
        azimuth = viewed_from + angle + 0.12 * jitter[k, 0]
        out = np.array([np.cos(azimuth), np.sin(azimuth)])
        distance = target + reach + clearance * (1 + 0.25 * jitter[k, 1])
        while _gap(middle + distance * out, reach, found) < 0.02:
            distance += 0.01
        found.append((middle + distance * out, reach))
    return [(float(at[0]), float(at[1])) for at, _ in found]


def _angles(count: int, occlusion: float) -> list[float]:
    """Azimuths relative to the cameras' middle: a share in front of the target, the others behind it."""
    near = round(occlusion * count)
    behind = np.pi + np.linspace(-1.35, 1.35, count - near + 2)[1:-1]
    before = np.linspace(-1.25, 1.25, near + 2)[1:-1]
    return [*before.tolist(), *behind.tolist()]


def _gap(at: np.ndarray, reach: float, found: Sequence[tuple[np.ndarray, float]]) -> float:
    return min(float(np.linalg.norm(at - there)) - reach - taken for there, taken in found)


def _vase(rng: np.random.Generator) -> Piece:
    clay = textures.bands(rng, scaled(paint("moderate red"), 0.9), [CREAM, NAVY, CREAM])
    return Piece("vase", props.vase(rng, rng.uniform(0.27, 0.32), 0.17), Texture(clay, (2, 1)), True)


def _flask(rng: np.random.Generator) -> Piece:
    ground = scaled(paint("purplish blue"), 1.2)
    glaze = textures.bands(rng, ground, [CREAM, paint("orange yellow"), CREAM, NAVY])
    return Piece("flask", props.bottle(rng.uniform(0.28, 0.32), 0.075), Texture(glaze, (2, 1)), True)


def _sculpture(rng: np.random.Generator) -> Piece:
    ochres = textures.stone(rng, [(0.10, 0.05, 0.03), (0.38, 0.20, 0.08), (0.60, 0.45, 0.25)])
    rock = blob(0.09, rng, 0.15)
    normals = rock.normals / [1, 1, 1.5]
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    tall = replace(rock, vertices=rock.vertices * [1, 1, 1.5], normals=normals)
    return Piece("sculpture", _grounded(tall), Texture(ochres, (2, 1)))


def _canister(rng: np.random.Generator) -> Piece:
    labels = textures.bands(rng, scaled(paint("foliage"), 1.3), [CREAM, paint("orange"), CREAM])
    return Piece("canister", props.jar(rng.uniform(0.2, 0.24), 0.075), Texture(labels, (2, 1)))


def _jar(rng: np.random.Generator) -> Piece:
    glaze = textures.stone(rng, [(0.04, 0.16, 0.20), (0.07, 0.27, 0.30), (0.20, 0.42, 0.40)])
    return Piece("jar", props.jar(rng.uniform(0.11, 0.14), 0.055), Texture(glaze, (2, 1)), True)


def _bowl(rng: np.random.Generator) -> Piece:
    clay = textures.plaster(rng, scaled(_shade(rng), 1.1), 0.15)
    return Piece("bowl", props.bowl(rng.uniform(0.08, 0.1)), Texture(clay, (2, 1)))


def _casket(rng: np.random.Generator) -> Piece:
    cover = textures.tiles(rng, [paint("orange yellow"), scaled(paint("purplish blue"), 1.1)], 4)
    box = props.crate(0.15, 0.115, 0.105, 0.008).moved((0, 0, 0), size=rng.uniform(0.9, 1.1))
    return Piece("casket", box, Texture(cover, (6, 6)))


def _parcel(rng: np.random.Generator) -> Piece:
    board = textures.cardboard(rng, (0.42, 0.30, 0.18))
    box = props.crate(0.12, 0.12, 0.13, 0.004).moved((0, 0, 0), size=rng.uniform(0.9, 1.1))
    return Piece("parcel", box, Texture(board, (8, 8)))


def _books(rng: np.random.Generator) -> Piece:
    cloth = textures.tiles(rng, [_shade(rng) for _ in range(4)], 4)
    return Piece("books", props.books(rng, 3, 0.17), Texture(cloth, (0.5, 12)))


def _stone(rng: np.random.Generator) -> Piece:
    grays = textures.stone(rng, [(0.16, 0.15, 0.14), (0.36, 0.34, 0.31), (0.58, 0.56, 0.52)])
    return Piece("stone", _grounded(blob(rng.uniform(0.065, 0.08), rng)), Texture(grays, (2, 1)))


def _ring(rng: np.random.Generator) -> Piece:
    rubber = textures.plaster(rng, _shade(rng), 0.18)
    return Piece("ring", torus(0.065, 0.028).moved((0, 0, 0.028)), Texture(rubber, (2, 1)))


def _tin(rng: np.random.Generator) -> Piece:
    enamel = textures.bands(rng, scaled(_shade(rng), 0.9), [CREAM, NAVY])
    return Piece("tin", props.barrel(rng.uniform(0.11, 0.15), 0.055), Texture(enamel, (2, 1)))


_TARGETS: tuple[Callable[[np.random.Generator], Piece], ...] = (_vase, _flask, _sculpture, _canister)
_OTHERS: tuple[Callable[[np.random.Generator], Piece], ...] = (
    _jar,
    _bowl,
    _casket,
    _parcel,
    _books,
    _stone,
    _ring,
    _tin,
)


def _shade(rng: np.random.Generator) -> tuple[float, float, float]:
    return paint(_SHADES[rng.integers(len(_SHADES))])


def _grounded(shape: Mesh) -> Mesh:
    """Return a shape lifted so that its lowest point lies 1 mm below z = 0: a point would not carry it."""
    return shape.moved((0, 0, -0.001 - float(shape.vertices[:, 2].min())))
