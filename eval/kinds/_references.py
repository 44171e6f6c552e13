# SPDX-License-Identifier: Apache-2.0
"""Independent computations that metrics are held against, and how closely."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Reference:
    """An independent computation that a metric must agree with."""

    name: str
    """The number that is computed."""
    against: str
    """The other library, or the closed form."""
    tolerance: float
    """Greatest difference, absolute, in ``unit``."""
    unit: str = "1"


PSNR = Reference("PSNR", "scikit-image, peak_signal_noise_ratio", 1e-9, "dB")
SSIM = Reference("SSIM", "equation 13 of Wang et al. 2004, filters of scipy", 1e-9)
FLIP = Reference("FLIP", "flip-evaluator, on the whole picture", 1e-6)
CIEDE2000 = (
    Reference("CIEDE2000", "colour-science, delta_E of XYZ_to_Lab", 1e-6, "ΔE00"),
    Reference("CIEDE2000, published pairs", "Sharma, Wu and Dalal 2005, table 1, four digits", 5e-5, "ΔE00"),
)
DISTANCES = Reference(
    "depth and materials", "scipy.spatial.distance, city block and Euclid with weights", 1e-9
)
RELIT = Reference("relit PSNR", "scikit-image, of pictures in the gauge of numpy.linalg.lstsq", 1e-9, "dB")
RESIDUAL = Reference("residual energy", "numpy.linalg.lstsq of what is left by the object's effect", 1e-9)
ASSIGNMENT = Reference("assignment of lights", "every permutation", 1e-9, "m")

FOUNDATIONS: tuple[Reference, ...] = (
    Reference("gauge", "numpy.linalg.lstsq", 1e-9),
    Reference("display encoding", "colour-science, sRGB", 1e-9),
    Reference("sums of parts", "numpy.einsum over lights, parts and pixels", 1e-6, "W/m²/sr"),
    Reference("signed-rank test, exact", "scipy.stats.wilcoxon, exact", 1e-12),
    Reference("signed-rank test with ties", "every sign of every difference, counted", 1e-12),
    Reference("bootstrap-t interval", "its definition, resample by resample, tails by sorting", 1e-9),
    Reference("test of the mean", "Student's p, and resamples beyond the ratio, counted", 1e-12),
)
"""References of computations that many metrics, or the comparison of methods, stand on."""
