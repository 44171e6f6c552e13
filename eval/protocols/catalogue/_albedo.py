# SPDX-License-Identifier: Apache-2.0
"""Albedo protocols as published code has them, quirks included, rewritten from their formulas.

What cannot be carried over is said at each: graycard has no validation views, so the first training view
stands for the first of them; its truth is no 8-bit file, so it is rounded where the original reads one.
"""

from dataclasses import replace

from graycard.eval.kinds._records import CHANNEL, GLOBAL
from graycard.eval.protocols._alignment import Alignment
from graycard.eval.protocols._base import PublishedProtocol
from graycard.eval.protocols._lmse import LmseProtocol
from graycard.eval.protocols._psnr import PsnrProtocol

RAW_LINEAR = PsnrProtocol(
    name="raw-linear",
    summary="nothing fitted, linear",
    source="the definition of PSNR",
)
"""PSNR of base colour as it is, in linear light, over the mask, mean over views."""

RAW_SRGB = PsnrProtocol(
    name="raw-srgb",
    summary="nothing fitted, as displayed (Marigold-IID appearance, RGB↔X)",
    source="prs-eth/Marigold, script/iid/eval.py with --use_mask, b1dffaa; zheng95z/rgbx, issue 3",
    alignment=Alignment(
        space="sRGB",
    ),
)
"""PSNR of sRGB-encoded base colour over the mask, mean over views; what is above 1 is cut off. The model of
appearance predicts sRGB; of the encoding the script leaves the choice to whoever wrote the pictures."""

MARIGOLD_GAMMA = PsnrProtocol(
    name="marigold-gamma",
    summary="nothing fitted, gamma 2.2 (Marigold-IID lighting)",
    source="prs-eth/Marigold, script/iid/eval.py, linear2srgb, with --use_mask, b1dffaa",
    alignment=Alignment(space="gamma 2.2"),
)
"""``raw-srgb`` by the encoding that Marigold itself applies to what is linear, for Hypersim and its model
of lighting: x^(1/2.2), by which what is above 1 stays. It differs by up to 0.3 dB."""

GLOBAL_LSQ = PsnrProtocol(
    name="global-lsq",
    summary="one factor, on the scored views",
    source='one reading of "each RGB channel using a global scalar" (GS-ID, supplement)',
    alignment=Alignment(
        estimator="least squares, one factor",
        fitted_on="all scored views",
    ),
    ignores=GLOBAL,
    refuses=("sign",),
)
"""One factor Σ p t / Σ p² over all channels of all scored views: the best that one factor can do."""

CHANNEL_LSQ = PsnrProtocol(
    name="channel-lsq",
    summary="one factor a channel, on the scored views",
    source='the other reading of "each RGB channel using a global scalar" (GS-ID, supplement)',
    alignment=Alignment(
        estimator="least squares, per channel",
        fitted_on="all scored views",
    ),
    ignores=CHANNEL,
    refuses=("sign",),
)
"""A factor Σ p t / Σ p² for each channel over all scored views: the best that three factors can do."""

NERFACTOR = PsnrProtocol(
    name="nerfactor",
    version=2,
    summary="one factor a channel, on the first validation view, 8 bits",
    source="google/nerfactor, nerfactor/test.py, compute_rgb_scales, 3059662; xiuminglib, img.py, 1664420",
    alignment=Alignment(
        estimator="least squares, per channel",
        fitted_on="the first training view",
        predicted_as="8 bits, gamma 2.2, rounded down",
        true_as="8 bits",
    ),
    refuses=("sign",),
)
"""Factors Σ p t / Σ p² of one view that is not scored; the prediction goes through an 8-bit image of gamma
2.2, rounded down, where what is above 1 is lost, the truth through a linear one. The script ends with the
corrected images; the PSNR over the mask, linear, mean over views is the plainest that can follow. Its
validation view is the first training view here. Version 1 rounded to the nearest: up to 0.14 dB off."""

ORB_ALBEDO = PsnrProtocol(
    name="orb-albedo",
    summary="one factor a channel and view, whole image (Stanford-ORB)",
    source="StanfordORB/Stanford-ORB, orb/utils/metrics.py, calc_PSNR, 6595814, and test.py, 1fe21c1",
    alignment=Alignment(
        estimator="least squares, per channel, black as white",
        fitted_on="each scored view",
        erosion=5,
        limit=1,
    ),
    pixels="whole image",
    floor=0.5,
    ignores=CHANNEL,
    refuses=("sign",),
)
"""Each view gets its own three factors from its own truth, inside the mask eroded by 5 x 5; both images
are multiplied by that mask and averaged over the whole image; no view scores less than gray 0.5 would."""

TENSOIR_THREE = PsnrProtocol(
    name="tensoir-three",
    summary="median ratio a channel, whole image, gamma 2.2 (TensoIR)",
    source="Haian-Jin/TensoIR, renderer.py, compute_rescale_ratio and evaluation_iter_TensoIR, 0ce4aa7",
    alignment=Alignment(
        estimator="median ratio, per channel",
        fitted_on="20 scored views",
        outside="white",
        space="gamma 2.2",
        limit=1,
    ),
    pixels="whole image",
    pooling="PSNR of the mean error",
    ignores=CHANNEL,
)
"""Median over pixels of truth / max(p, 1e-6), a channel, on 20 evenly chosen scored views (on the first
alone where there are fewer than 20); the background is white in both images and is averaged over."""

TENSOIR_SINGLE = PsnrProtocol(
    name="tensoir-single",
    summary="median ratio of red for all channels, whole image, gamma 2.2 (TensoIR)",
    source=TENSOIR_THREE.source,
    alignment=Alignment(
        estimator="median ratio of red",
        fitted_on="20 scored views",
        outside="white",
        space="gamma 2.2",
        limit=1,
    ),
    pixels="whole image",
    pooling="PSNR of the mean error",
    ignores=GLOBAL,
)
"""``tensoir-three`` with the median ratio of the red channel for all three."""

GS_IR = PsnrProtocol(
    name="gs-ir",
    version=2,
    summary="median ratio a channel, whole image, 8 bits, PSNR a channel (GS-IR)",
    source="lzhnb/GS-IR, render.py, eval_brdf, and utils/image_utils.py, psnr, 0d8c1ea",
    alignment=Alignment(
        estimator="median ratio, per channel",
        fitted_on="all scored views",
        outside="prediction on black",
        predicted_as="8 bits",
        true_as="8 bits",
    ),
    pixels="whole image",
    channels="mean of PSNRs",
)
"""Median ratio a channel over all scored views, both images through 8 bits before it and unclipped after; a
PSNR for each channel, which their mean error would not reach (Jensen). The truth is black outside the mask.
The prediction is not masked: what it holds there counts as an error, without factors, and may cost 15 dB.
Version 1 left it out."""

R3DG_SYN4 = PsnrProtocol(
    name="r3dg-syn4",
    version=2,
    summary="median ratio of the first scored view in sRGB, whole image, PSNR a channel (Relightable 3DGS)",
    source="NJU-3DV/Relightable3DGaussian, eval_relighting_syn4.py and gaussian_renderer/neilf.py, 213a475",
    alignment=Alignment(
        outside="white",
        true_as="8 bits, sRGB",
        estimator="median ratio, per channel, prediction cut at 1",
        fitted_on="the first scored view",
        fitted_in="sRGB",
        space="sRGB",
    ),
    pixels="whole image",
    channels="mean of PSNRs",
)
"""The renderer multiplies base colour by constants in linear light, then encodes and cuts it; the script
compares that with sRGB files, on white. It prints the median over the first view of truth / clip(p, 1e-6, 1)
of the encoded images, and holds such numbers as constants for four scenes. This protocol takes them to be
what a first pass prints. Version 1 compared in linear light: up to 13 dB off, in another ranking."""

R3DG_SYN4_LINEAR = PsnrProtocol(
    name="r3dg-syn4-linear",
    summary="as r3dg-syn4, with the median ratio of linear images",
    source=R3DG_SYN4.source + ": the other reading of its constants",
    alignment=replace(R3DG_SYN4.alignment, fitted_in="linear"),
    pixels="whole image",
    channels="mean of PSNRs",
)
"""``r3dg-syn4`` if the constants were medians of linear base colour, where they are applied."""

IRGS_SYN4 = PsnrProtocol(
    name="irgs-syn4",
    summary="median ratio a channel of all views, whole image, PSNR a channel (IRGS)",
    source="fudan-zvg/IRGS, compute_albedo_scale_syn4.py, eval_material_syn4.py (TCZ-Tao/IRGS, b7def9a)",
    alignment=Alignment(
        true_as="8 bits, sRGB",
        estimator="median ratio, per channel",
        fitted_on="all scored views",
    ),
    pixels="whole image",
    channels="mean of PSNRs",
    ignores=CHANNEL,
)
"""Median over all scored views of truth / max(p, 1e-6), a channel. The truth is an sRGB file that is decoded;
the prediction stays linear and uncut. Black background in both, averaged over."""

IRGS_TENSOIR = PsnrProtocol(
    name="irgs-tensoir",
    summary="median ratio a channel where the truth is coloured, whole image, PSNR a channel (IRGS)",
    source="fudan-zvg/IRGS, compute_albedo_scale_tensoir.py, eval_material_tensoir.py (as irgs-syn4)",
    alignment=Alignment(
        true_as="8 bits",
        estimator="median ratio, per channel, where the truth is above 0",
        fitted_on="all scored views",
    ),
    pixels="whole image",
    channels="mean of PSNRs",
    ignores=CHANNEL,
)
"""``irgs-syn4`` for truth in linear files; only pixels that are above 0 in each channel enter the fit."""

NVDIFFREC = PsnrProtocol(
    name="nvdiffrec",
    version=2,
    summary="ratio of mean intensities, as displayed, whole image (nvdiffrec, nvdiffrecmc; read in part)",
    source="NVlabs/nvdiffrecmc, issue 20 (head of the script), and issue 14: one choice of three named there",
    alignment=Alignment(
        predicted_as="8 bits, sRGB",
        true_as="8 bits, sRGB",
        estimator="ratio of means",
        fitted_on="all scored views",
        space="sRGB",
    ),
    pixels="whole image",
    refuses=("sign",),
)
"""sRGB files, masked, and the mean square error of the whole picture: so far the script could be read. One
factor, mean truth over mean prediction on the scored views, is one of three that the authors name; they call
the choice unsolved. Not held against their program. Version 1 judged the mask alone."""

MIT_LMSE = LmseProtocol(
    name="mit-lmse",
    summary="one factor a window of 20 x 20 pixels (MIT intrinsic images)",
    source="Grosse et al. 2009, equations 7 to 9; intrinsic.py, local_error and score_image",
    ignores=GLOBAL,
)
"""The reflectance half of the score of Grosse et al. 2009; the other half is of shading, which predictions
need not hold. It is the equation; see :func:`graycard.eval.lmse`."""

MIT_LMSE_PUBLISHED = LmseProtocol(
    name="mit-lmse-published",
    summary="as mit-lmse, divided by the last window of each row (the program of 2009)",
    source="intrinsic.py, local_error, by the indentation that corrected copies name",
    total="the last window of each row",
    ignores=GLOBAL,
)
"""``mit-lmse`` by the program that the authors published: by an indentation its denominator sums the last
window of each row alone. So its numbers are greater, 6 to 10 times at 96 pixels, and grow with the
picture."""

ALBEDO: tuple[PublishedProtocol, ...] = (
    RAW_LINEAR,
    RAW_SRGB,
    MARIGOLD_GAMMA,
    GLOBAL_LSQ,
    CHANNEL_LSQ,
    NERFACTOR,
    ORB_ALBEDO,
    TENSOIR_THREE,
    TENSOIR_SINGLE,
    GS_IR,
    R3DG_SYN4,
    R3DG_SYN4_LINEAR,
    IRGS_SYN4,
    IRGS_TENSOIR,
    NVDIFFREC,
    MIT_LMSE,
    MIT_LMSE_PUBLISHED,
)
"""All protocols above, in the order in which they are shown."""
