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
    Reference("HDR-FLIP", "flip-evaluator on the whole picture, the greatest of both exposures", 1e-6, "1"),
    Reference("colour chart", "colour-science, patch by patch", 1e-6, "ΔE00"),
    Reference("share of normals", "cosines above that of the limit, counted", 1e-9, "%"),
    Reference("depth and materials", "scipy.spatial.distance, city block and Euclid with weights", 1e-9, "1"),
    Reference("depth within a ratio", "|log p - log t| < log 1.25, counted", 1e-9, "%"),
    Reference("overlap of glossy regions", "scipy.spatial.distance, Jaccard", 1e-9, "1"),
    Reference("sums of parts", "numpy.einsum over lights, parts and pixels", 1e-6, "W/m²/sr"),
    Reference("gauged intensity", "stops of the exposures that bring both to one level", 1e-9, "stops"),
    Reference("direction and colour of light", "scipy.spatial.distance, cosine", 1e-6, "°"),
    Reference("size of light", "areas by Heron's formula, and of the disc", 1e-9, "%"),
    Reference("mirror sphere", "scipy.interpolate, RegularGridInterpolator", 1e-9, "1"),
    Reference(
        "diffuse sphere", "spherical harmonics, Ramamoorthi and Hanrahan 2001, three digits", 2e-3, "1"
    ),
    Reference("glossy sphere", "Gauss and Legendre over facets, two digits", 5e-3, "1"),
    Reference("signed-rank test, exact", "scipy.stats.wilcoxon, exact", 1e-12, "1"),
    Reference("signed-rank test with ties", "every sign of every difference, counted", 1e-12, "1"),
    Reference("bootstrap-t interval", "its definition, resample by resample, tails by sorting", 1e-9, "1"),
    Reference("test of the mean", "Student's p, and resamples beyond the ratio, counted", 1e-12, "1"),
    Reference("LPIPS", "its equations in numpy, float64, small random weights, five digits", 1e-5, "1"),
)
"""Every entry has a test of its name in ``tests/eval/test_eval_references.py``."""
