# SPDX-License-Identifier: Apache-2.0
"""Find the folder of compiled kernels without an import of Numba or of graycard.

Kernels are compiled again when a file that they can reach changes: this one imports none.
"""

from pathlib import Path

from platformdirs import user_cache_path

SHARED_KERNELS = "GRAYCARD_SHARED_KERNELS"
"""Environment variable: a folder of compiled kernels that a confined process reads and does not change."""


def kernel_root(chosen: str | None) -> Path:
    """Return the folder of all compiled kernels.

    Args:
        chosen: ``NUMBA_CACHE_DIR``, if it is set.
    """
    return Path(chosen) / "graycard" if chosen else user_cache_path("graycard") / "kernels"
