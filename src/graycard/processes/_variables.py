# SPDX-License-Identifier: Apache-2.0
"""The environment variables that a confined process has: what libraries read, and no keys or tokens."""

import os

from graycard.io import is_text

PASSED = "GRAYCARD_PASS"
"""Environment variable that names others, separated by commas or blanks."""
_NAMES = (
    "PATH", "LANG", "LANGUAGE", "TZ", "USER", "LOGNAME", "SHELL", "TERM", "COLUMNS", "LINES", "NO_COLOR",
    "VIRTUAL_ENV", "CONDA_PREFIX", "LD_LIBRARY_PATH", "LD_PRELOAD", "DYLD_LIBRARY_PATH", "SSL_CERT_FILE",
    "SOURCE_DATE_EPOCH", "SYSTEMROOT", "WINDIR",
)  # fmt: skip
_PREFIXES = (
    "LC_", "OMP_", "GOMP_", "KMP_", "MKL_", "OPENBLAS_", "BLIS_", "VECLIB_", "NUMEXPR_", "NUMBA_", "CUDA_",
    "NVIDIA_", "HIP_", "ROCR_", "TORCH", "PYTORCH_", "PYTHON", "DRJIT_", "MI_", "XLA_", "JAX_", "TF_",
    "MALLOC_", "GRAYCARD_", "COVERAGE_",
)  # fmt: skip
"""Begins of names: languages, threads, GPUs, numerical libraries, Python, and graycard itself."""


def passed_variables() -> dict[str, str]:
    """Return the environment variables of this process that one may have which runs code of others."""
    named = os.environ.get(PASSED, "").replace(",", " ").split()
    return {
        name: value
        for name, value in os.environ.items()
        if (name in _NAMES or name.startswith(_PREFIXES) or name in named) and is_text(name + value)
    }
