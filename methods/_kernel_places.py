# SPDX-License-Identifier: Apache-2.0
"""Find the folders of compiled kernels without an import of Numba, PyTorch or graycard.

Kernels are compiled again when a file that they can reach changes: this one imports none.
"""

import os
from pathlib import Path

from platformdirs import user_cache_path

SHARED_KERNELS = "GRAYCARD_SHARED_KERNELS"
"""Environment variable: a folder of compiled kernels that a confined process reads and does not change."""
_GPU_KERNELS = "torch_extensions"
"""Folder in a cache where PyTorch keeps what it compiles, unless ``TORCH_EXTENSIONS_DIR`` names another."""


def kernel_root(chosen: str | None) -> Path:
    """Return the folder of all compiled kernels.

    Args:
        chosen: ``NUMBA_CACHE_DIR``, if it is set.
    """
    return Path(chosen) / "graycard" if chosen else user_cache_path("graycard") / "kernels"


def linked_gpu_kernels(home: Path) -> tuple[str, ...]:
    """Let a process with a cache of its own find what PyTorch has compiled for a GPU, as gsplat's kernels.

    Args:
        home: Folder of its cache: there a link is made.

    Returns:
        The folder that it has to be able to read, and need not change; none if nothing was compiled.
    """
    chosen = os.environ.get("TORCH_EXTENSIONS_DIR")
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = (Path(chosen) if chosen else cache / _GPU_KERNELS).absolute()
    if not folder.is_dir():
        return ()
    home.mkdir(parents=True, exist_ok=True)
    (home / _GPU_KERNELS).symlink_to(folder, target_is_directory=True)
    return (str(folder),)
