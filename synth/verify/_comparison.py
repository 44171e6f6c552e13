# SPDX-License-Identifier: Apache-2.0
"""A stored picture against an independent one: its level, its tiles, its place and its pattern."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from graycard.synth.verify._check import At, Check
from graycard.synth.verify._statistics import (
    CONTRASTS,
    bound_of,
    contrast_share,
    difference,
    gain_of,
    gain_weights,
    shift_weights,
    spread_share,
    tiles,
    variance_share,
    z_of,
    z_of_shares,
)


@dataclass(frozen=True)
class Pair:
    """Two pictures ``(H, W, C)`` that must differ by symmetric noise only."""

    at: At
    stored: np.ndarray
    again: np.ndarray
    halves: tuple[np.ndarray, ...] = ()
    """Two of the stored picture, then two of the other; empty where there are none."""
    variances: tuple[np.ndarray, ...] = ()
    """Variance of either picture; empty where halves tell more, or where it is not known."""

    @cached_property
    def apart(self) -> np.ndarray:
        """Stored minus independent."""
        return difference(self.stored, self.again)

    @cached_property
    def weights(self) -> np.ndarray:
        """Those that find a common factor."""
        return gain_weights(self.stored, self.again)


def compare(name: str, pairs: Sequence[Pair], at: At) -> Iterator[Check]:
    """Compare pictures one by one, and all of them together for what is the same in each.

    Args:
        name: What is compared.
        pairs: Of different views.
        at: The scene.
    """
    for pair in pairs:
        yield _check_tiles(name, pair, len(pairs))
        yield _check_place(name, pair, len(pairs))
        if pair.halves:
            share = contrast_share(pair.halves)
            yield _check_pattern(name, pair, share, 1 / 3, len(pairs))
        elif pair.variances:
            yield from _check_spread(name, pair, len(pairs))
    yield from _check_level(name, pairs, at)


def _check_level(name: str, pairs: Sequence[Pair], at: At) -> Iterator[Check]:
    """Check the mean of each channel, in each view and over all of them."""
    channels = range(pairs[0].stored.shape[-1])
    bound = bound_of((len(pairs) + 1) * len(channels))
    for channel in channels:
        for group, where in [([pair], pair.at) for pair in pairs] + [(list(pairs), at)]:
            w, d, a, b = (
                np.concatenate([getattr(p, kind)[..., channel].ravel() for p in group])
                for kind in ("weights", "apart", "stored", "again")
            )
            told = (
                f"the mean of channel {'RGB'[channel]} is that of an independent rendering; it is "
                f"{100 * gain_of(w, a, b):+.2f} % off"
            )
            yield where.judge(f"{name}: level", abs(z_of(w, d)), bound, "σ", told)


def _check_tiles(name: str, pair: Pair, views: int) -> Check:
    """Check the mean of each tile and channel: light that is missing, misplaced or counted twice
    somewhere.
    """
    parts = tiles(*pair.stored.shape[:2])
    channels = pair.stored.shape[-1]
    found = [
        (z_of(pair.weights[part][..., channel], pair.apart[part][..., channel]), part, channel)
        for part in parts
        for channel in range(channels)
    ]
    z, part, channel = max(found, key=lambda one: abs(one[0]))
    a, b, w = (values[part][..., channel] for values in (pair.stored, pair.again, pair.weights))
    told = (
        f"each part of the picture is that of an independent rendering; rows {part[0].start} to "
        f"{part[0].stop}, columns {part[1].start} to {part[1].stop} of channel {'RGB'[channel]} are "
        f"{100 * gain_of(w, a, b):+.2f} % off"
    )
    return pair.at.judge(f"{name}: tiles", abs(z), bound_of(views * len(parts) * channels), "σ", told)


def _check_place(name: str, pair: Pair, views: int) -> Check:
    """Check for a shift by a part of a pixel: the picture projected on its own slope."""
    found = []
    for axis in (0, 1):
        w = shift_weights(pair.stored, pair.again, axis)
        slope = np.gradient((pair.stored.astype(float) + pair.again) / 2, axis=axis)
        moved = -float((w * pair.apart).sum() / max(float((w * slope).sum()), 1e-30))
        found.append((z_of(w, pair.apart), moved))
    z = max(abs(z) for z, _ in found)
    down, right = (moved for _, moved in found)
    told = (
        f"the picture lies where an independent one does; it looks shifted by ({right:+.2f}, {down:+.2f}) px"
    )
    return pair.at.judge(f"{name}: place", z, bound_of(2 * views), "σ", told)


def _check_spread(name: str, pair: Pair, views: int) -> Iterator[Check]:
    """Check a picture without halves: its variance, and by it how far an independent picture is off."""
    means = pair.stored, pair.again
    yield _check_pattern(name, pair, spread_share(means, pair.variances), 1 / CONTRASTS, views)
    told = "the variance of the mean is that of an independent rendering; looks like that of single images"
    z = z_of_shares(variance_share(means, pair.variances), 1 / 2)
    yield pair.at.judge(f"{name}: variance", z, bound_of(views), "σ", told)


def _check_pattern(name: str, pair: Pair, share: np.ndarray, expected: float, views: int) -> Check:
    """Tile by tile, whether the pictures are farther apart than their own images are.

    ``share`` is that of their difference in the spread of all images, ``(H, W)``, and ``expected`` its mean.
    """
    parts = tiles(*share.shape)
    z, part = max(((z_of_shares(share[part], expected), part) for part in parts), key=lambda one: one[0])
    told = (
        f"the picture and an independent one are as far apart as their images; rows {part[0].start} to "
        f"{part[0].stop}, columns {part[1].start} to {part[1].stop} show something else"
    )
    return pair.at.judge(f"{name}: pattern", z, bound_of(views * len(parts)), "σ", told)


def largest_relative(off: np.ndarray, of: np.ndarray, where: np.ndarray | slice = slice(None)) -> float:
    """Return the largest difference, relative to the value there and a little of the mean.

    Args:
        off: Differences, of any sign.
        of: The values, in the shape of the differences.
        where: Which pixels count.
    """
    relative = np.abs(off) / (np.abs(of) + 1e-2 * float(np.abs(of).mean()) + 1e-30)
    return float(relative[where].max(initial=0))
