# SPDX-License-Identifier: Apache-2.0
"""FID and KID: how far the features of one set of pictures are from those of another."""

import numpy as np

from graycard.networks import inception_features, inception_weights


def features_of(pictures: np.ndarray) -> np.ndarray:
    """Return the features of Inception v3 of pictures that are rounded to 8 bits, as files of them would be.

    Args:
        pictures: shape ``(N, H, W, 3)``, display values in [0, 1].

    Returns:
        Shape ``(N, 2048)``, float64.

    Raises:
        WeightsError: The weights were not fetched, or are damaged.
    """
    import torch

    rounded = np.rint(np.clip(pictures, 0, 1) * 255) / 255
    with torch.inference_mode():
        images = torch.from_numpy(rounded).float().permute(0, 3, 1, 2)
        return inception_features(images, inception_weights()).numpy().astype(np.float64)


def fid(first: np.ndarray, second: np.ndarray) -> float:
    """Return the Fréchet distance of normal distributions fitted to two sets of features.

    ``|m₁ - m₂|² + tr(S₁ + S₂ - 2 (S₁ S₂)^½)`` (Heusel et al. 2017). The eigenvalues of ``S₁ S₂`` are
    the squared singular values of the product of the centred features, a matrix of one row a picture. So it
    is exact, and finite, also of fewer pictures than features.

    Args:
        first: shape ``(N, D)``.
        second: shape ``(M, D)``.

    Returns:
        [0, ∞); of few pictures it is biased.

    Raises:
        ValueError: A set has fewer than two pictures.
    """
    _check(first, second)
    one, two = (
        (features - features.mean(axis=0)) / np.sqrt(len(features) - 1) for features in (first, second)
    )
    shared = np.linalg.svd(one @ two.T, compute_uv=False).sum()
    apart = np.sum((first.mean(axis=0) - second.mean(axis=0)) ** 2)
    return max(float(apart + np.sum(one**2) + np.sum(two**2) - 2 * shared), 0.0)


def kid(first: np.ndarray, second: np.ndarray) -> float:
    """Return the squared maximum mean discrepancy of two sets of features in pairs, without bias.

    The kernel is ``(x·y / D + 1)³`` (Bińkowski et al. 2018). A picture is compared neither with itself nor
    with its partner (lemma 6 of Gretton et al. 2012): views of one scene come in pairs, and an estimate that
    takes them for independent would be too low.

    Args:
        first: shape ``(N, D)``.
        second: shape ``(N, D)``; row ``i`` is the partner of row ``i`` of the other.

    Returns:
        Around 0 for sets of one distribution, where it may be negative; 0 for equal sets.

    Raises:
        ValueError: There are fewer than two pairs, or the sets differ in size.
    """
    return _mean_of_pairs(_discrepancies(first, second))


def kid_error(first: np.ndarray, second: np.ndarray) -> float:
    """Return the standard error of :func:`kid` by the jackknife over pairs; arguments and errors as there.

    Returns:
        NaN of fewer than three pairs.
    """
    found = _discrepancies(first, second)
    count = len(found)
    if count < 3:
        return float("nan")
    every = np.arange(count)
    without = [_mean_of_pairs(found[np.ix_(every != i, every != i)]) for i in range(count)]
    return float(np.sqrt((count - 1) * np.var(without)))


def _discrepancies(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return ``k(x, x') + k(y, y') - k(x, y') - k(y, x')`` of all pairs of pairs, shape ``(N, N)``."""
    _check(first, second)
    if first.shape != second.shape:
        raise ValueError(f"expected features in pairs, got {first.shape} and {second.shape}")
    across = _kernel(first, second)
    return _kernel(first, first) + _kernel(second, second) - across - across.T


def _kernel(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return (first @ second.T / first.shape[1] + 1) ** 3


def _mean_of_pairs(found: np.ndarray) -> float:
    """Return the mean of what is off the diagonal."""
    count = len(found)
    return float((found.sum() - np.trace(found)) / (count * (count - 1)))


def _check(first: np.ndarray, second: np.ndarray) -> None:
    if min(len(first), len(second)) < 2 or first.ndim != 2 or first.shape[1:] != second.shape[1:]:
        raise ValueError(
            f"expected two sets of at least 2 pictures with as many features, got {first.shape} and "
            f"{second.shape}"
        )
