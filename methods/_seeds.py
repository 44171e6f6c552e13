# SPDX-License-Identifier: Apache-2.0
"""Global random sources that a method may draw from."""

import random
import sys

import numpy as np


def seed_everything(seed: int) -> None:
    """Seed every global random source that a method may use; torch only if the method has loaded it."""
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002 -- third-party methods draw from the legacy global state
    if "torch" in sys.modules:
        sys.modules["torch"].manual_seed(seed)
