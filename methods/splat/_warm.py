# SPDX-License-Identifier: Apache-2.0
"""Compile kernels before they are needed."""

from collections.abc import Sequence

from graycard import Progress
from graycard.io import silent

SURFEL_KERNELS = ("features 3", "maps 3", "photometric", "depth normal", "harmonics", "Adam")
"""Parts of the engine that a fit of surfels to photographs uses."""


def warm_kernels(parts: Sequence[str] | None = None, progress: Progress = silent) -> list[str]:
    """Compile what the cache on disk lacks, in as many processes as there are cores and jobs.

    Nothing fails for want of it. Where the cache cannot be written, kernels are compiled when first used.
    Jobs of a process that died are done in this one.

    Args:
        parts: of the engine: ``"maps 3"`` for :func:`rasterize` and ``"features 3"`` for
            :func:`rasterize_features` with three channels (also 8 and 16), ``"gaussians 3"`` for
            :func:`rasterize_gaussians`, ``"photometric"``, ``"depth normal"``, ``"harmonics"``, ``"trace"``,
            ``"Adam"``. None: all.
        progress: Called now and then.

    Returns:
        The names of the jobs that were missing and are compiled now; none if the cache had them all.

    Raises:
        UnknownNameError: There is no such part.
    """
    from graycard.methods.splat.warm._jobs import PARTS  # Numba takes long to import
    from graycard.methods.splat.warm._processes import warmed

    return warmed(list(PARTS) if parts is None else parts, progress)


def missing_kernels(parts: Sequence[str]) -> list[str]:
    """Return the names of the jobs of parts, named as in :func:`warm_kernels`, that the cache lacks.

    Raises:
        UnknownNameError: There is no such part.
    """
    from graycard.methods.splat.warm._processes import missing_jobs  # Numba takes long to import

    return missing_jobs(parts)
