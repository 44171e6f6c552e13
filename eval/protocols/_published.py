# SPDX-License-Identifier: Apache-2.0
"""Albedo protocols as published code has them, quirks included, rewritten from their formulas.

What cannot be carried over is said at each: graycard has no validation views, so the first training view
stands for the first of them; its truth is no 8-bit file, so it is rounded where the original reads one.
"""

from graycard.eval.kinds._records import CHANNEL, GLOBAL
from graycard.eval.protocols._base import AlbedoProtocol
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
    summary="nothing fitted, as displayed (Marigold-IID, RGB↔X)",
    source="prs-eth/Marigold, script/iid/eval.py with --use_mask, b1dffaa; zheng95z/rgbx, issue 3",
    space="sRGB",
)
"""PSNR of sRGB-encoded base colour over the mask, mean over views; what is above 1 is cut off."""

GLOBAL_LSQ = PsnrProtocol(
    name="global-lsq",
    summary="one factor, on the scored views",
    source='one reading of "each RGB channel using a global scalar" (GS-ID, supplement)',
    estimator="least squares, one factor",
    fitted_on="all scored views",
    ignores=GLOBAL,
    refuses=("sign",),
)
"""One factor Σ p t / Σ p² over all channels of all scored views: the best that one factor can do."""

CHANNEL_LSQ = PsnrProtocol(
    name="channel-lsq",
    summary="one factor a channel, on the scored views",
    source='the other reading of "each RGB channel using a global scalar" (GS-ID, supplement)',
    estimator="least squares, per channel",
    fitted_on="all scored views",
    ignores=CHANNEL,
    refuses=("sign",),
)
"""A factor Σ p t / Σ p² for each channel over all scored views: the best that three factors can do."""

NERFACTOR = PsnrProtocol(
    name="nerfactor",
    summary="one factor a channel, on the first validation view, 8 bits",
    source="google/nerfactor, nerfactor/test.py, compute_rgb_scales, 3059662",
    estimator="least squares, per channel",
    fitted_on="the first training view",
    predicted_as="8 bits, gamma 2.2",
    true_as="8 bits",
    refuses=("sign",),
)
"""Factors Σ p t / Σ p² of one view that is not scored; the prediction goes through an 8-bit image of gamma
2.2, where what is above 1 is lost, the truth through a linear one. The script ends with the corrected
images; the PSNR over the mask, linear, mean over views is the plainest that can follow. Its validation
view is the first training view here."""

ORB_ALBEDO = PsnrProtocol(
    name="orb-albedo",
    summary="one factor a channel and view, whole image (Stanford-ORB)",
    source="StanfordORB/Stanford-ORB, orb/utils/metrics.py, calc_PSNR, and orb/test.py, 6595814",
    estimator="least squares, per channel, black as white",
    fitted_on="each scored view",
    pixels="whole image",
    erosion=5,
    clipped=True,
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
    estimator="median ratio, per channel",
    fitted_on="20 scored views",
    space="gamma 2.2",
    pixels="whole image",
    pooling="PSNR of the mean error",
    clipped=True,
    ignores=CHANNEL,
)
"""Median over pixels of truth / max(p, 1e-6), a channel, on 20 evenly chosen scored views (on the first
alone where there are fewer than 20); the background is white in both images and is averaged over."""

TENSOIR_SINGLE = PsnrProtocol(
    name="tensoir-single",
    summary="median ratio of red for all channels, whole image, gamma 2.2 (TensoIR)",
    source=TENSOIR_THREE.source,
    estimator="median ratio of red",
    fitted_on="20 scored views",
    space="gamma 2.2",
    pixels="whole image",
    pooling="PSNR of the mean error",
    clipped=True,
    ignores=GLOBAL,
)
"""As ``tensoir-three``, with the median ratio of the red channel for all three."""

GS_IR = PsnrProtocol(
    name="gs-ir",
    summary="median ratio a channel, whole image, 8 bits, PSNR a channel (GS-IR)",
    source="lzhnb/GS-IR, render.py, eval_brdf, and utils/image_utils.py, psnr, 0d8c1ea",
    estimator="median ratio, per channel",
    fitted_on="all scored views",
    pixels="whole image",
    channels="mean of PSNRs",
    predicted_as="8 bits",
    true_as="8 bits",
)
"""Median ratio a channel over all scored views, both images through 8 bits before it and unclipped after;
a PSNR for each channel, which their mean error would not reach (Jensen); black background in both."""

R3DG_SYN4 = PsnrProtocol(
    name="r3dg-syn4",
    summary="median ratio of the first scored view, whole image, PSNR a channel (Relightable 3DGS)",
    source="NJU-3DV/Relightable3DGaussian, eval_relighting_syn4.py, 213a475",
    estimator="median ratio, per channel, prediction cut at 1",
    fitted_on="the first scored view",
    pixels="whole image",
    channels="mean of PSNRs",
)
"""Median over the first scored view of truth / clip(p, 1e-6, 1), a channel: the script prints it, and holds
such numbers as constants for four scenes. White background in both images, averaged over."""

NVDIFFREC = PsnrProtocol(
    name="nvdiffrec",
    summary="ratio of mean intensities, as displayed (nvdiffrec, nvdiffrecmc)",
    source="NVlabs/nvdiffrecmc, issues 14, 20 and 25: one choice of three that are named there",
    estimator="ratio of means",
    fitted_on="all scored views",
    space="sRGB",
    ignores=GLOBAL,
    refuses=("sign",),
)
"""One factor, mean truth over mean prediction on the scored views, then the PSNR of sRGB over the mask.
The authors name raw, mean intensity and single channels, and call the choice unsolved; which pixels enter
is left open there."""

OWL = PsnrProtocol(
    name="owl",
    summary="exposure and colour balance of each view, as displayed (Objects With Lighting)",
    source="isl-org/objects-with-lighting, scripts/evaluate.py and utils/metrics.py, 06f6076",
    estimator="least absolute error, exposure and balance",
    fitted_on="each scored view",
    space="gamma 2.2",
    clipped=True,
    ignores=GLOBAL,
    refuses=("sign",),
)
"""Each view gets the exposure, then the balance of each channel within [0.5, 2], of least mean absolute
error at gamma 2.2, fitted where the truth is not white, scored over the whole mask. The least errors
themselves are found here, where the original's search may stop before."""

MIT_LMSE = LmseProtocol(
    name="mit-lmse",
    summary="one factor a window of 20 x 20 pixels (MIT intrinsic images)",
    source="Grosse et al. 2009, equations 7 to 9; intrinsic.py, local_error and score_image",
    ignores=GLOBAL,
)
"""The reflectance half of the score of Grosse et al. 2009; the other half is of shading, which predictions
need not hold. See :func:`graycard.eval.lmse`."""

PUBLISHED: tuple[AlbedoProtocol, ...] = tuple(
    value for value in list(globals().values()) if isinstance(value, AlbedoProtocol)
)
"""All protocols above, in the order in which they stand there and are shown."""
