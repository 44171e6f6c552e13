# SPDX-License-Identifier: Apache-2.0
"""What each metric is held against, and how closely: one table for the tests and the documentation."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Reference:
    """An independent computation that a metric must agree with."""

    name: str
    """What is computed."""
    against: str
    """The other library, or the closed form."""
    tolerance: float
    """Greatest difference, absolute, in ``unit``."""
    unit: str


REFERENCES: tuple[Reference, ...] = (
    Reference("PSNR", "scikit-image, peak_signal_noise_ratio", 1e-9, "dB"),
    Reference("SSIM", "equation 13 of Wang et al. 2004, filters of scipy", 1e-9, "1"),
    Reference("FLIP", "flip-evaluator, on the whole picture", 1e-6, "1"),
    Reference("CIEDE2000", "colour-science, delta_E of XYZ_to_Lab", 1e-6, "ΔE00"),
    Reference("CIEDE2000, published pairs", "Sharma, Wu and Dalal 2005, table 1, four digits", 5e-5, "ΔE00"),
    Reference("LMSE", "equations 7 to 9 of Grosse et al. 2009, numpy.linalg.lstsq in each window", 1e-9, "1"),
    Reference("angle between normals", "length of the chord, 2 arcsin(|p - t| / 2)", 1e-6, "°"),
    Reference("assignment of lights", "every permutation", 1e-9, "m"),
    Reference("residual energy", "numpy.linalg.lstsq of what is left by the object's effect", 1e-9, "1"),
    Reference("leakage slope", "scipy.stats.theilslopes over every pair", 1e-9, "1"),
    Reference("local variance", "sums over each window, pixel by pixel", 1e-9, "1"),
    Reference("error over noise", "the closed form of an offset of k standard deviations", 1e-9, "σ"),
    Reference("relit PSNR", "scikit-image, of pictures in the gauge of numpy.linalg.lstsq", 1e-9, "dB"),
    Reference("gauge", "numpy.linalg.lstsq", 1e-9, "1"),
    Reference("display encoding", "colour-science, sRGB", 1e-9, "1"),
)
"""Every entry has a test of its name in ``tests/eval/test_eval_references.py``."""
