# SPDX-License-Identifier: Apache-2.0
"""Randomness that follows from a scene's seed and from what it is for."""

import zlib

import numpy as np


def stream(seed: int, subject: str) -> np.random.Generator:
    """Randomness for one subject of a scene: a change to one subject leaves all others as they are."""
    return np.random.default_rng(np.random.SeedSequence([seed, zlib.crc32(subject.encode())]))
