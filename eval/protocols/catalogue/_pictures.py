# SPDX-License-Identifier: Apache-2.0
"""Protocols for pictures: held-out views under the lights of the photographs, and under others.

A published script reads files that a method has rendered; here pictures are radiance at the exposure of the
scene, so that 1 is white.
"""

from dataclasses import replace

from graycard.eval.kinds._records import CHANNEL, GLOBAL
from graycard.eval.protocols._alignment import Alignment
from graycard.eval.protocols._base import PublishedProtocol
from graycard.eval.protocols._psnr import PsnrProtocol
from graycard.eval.protocols._similarity import SsimProtocol
from graycard.eval.protocols.catalogue._appearance import KORNIA_3, ZEROS

_ORB = "StanfordORB/Stanford-ORB, orb/utils/test.py, compute_similarity, 1fe21c1; metrics.py, 6595814"
_3DGS = "graphdeco-inria/gaussian-splatting, metrics.py, and psnr and ssim of utils/, 15d64e6"
_HDR = Alignment(erosion=5, exposure="as bright as sRGB", limit=4)
_LDR = Alignment(erosion=5, limit=1, space="sRGB")
_EIGHT_BITS = Alignment(outside="as it is", predicted_as="8 bits, sRGB", true_as="8 bits, sRGB", space="sRGB")

ORB_VIEW_HDR = PsnrProtocol(
    name="orb-view-hdr",
    subject="radiance",
    summary="linear light, cut at 4, whole image (Stanford-ORB, new views)",
    source=_ORB,
    alignment=_HDR,
    pixels="whole image",
    floor=0.5,
)
"""Both pictures are multiplied by mean(sRGB(truth)) / mean(truth), as linear ones are dark, and cut at 4.
They are black outside the mask eroded by 5 x 5, and averaged over. No factor is fitted. No view scores less
than gray 0.5 would."""

ORB_VIEW_LDR = PsnrProtocol(
    name="orb-view-ldr",
    subject="radiance",
    summary="as displayed, whole image (Stanford-ORB, new views)",
    source=_ORB,
    alignment=_LDR,
    pixels="whole image",
    floor=0.5,
)
"""``orb-view-hdr`` of sRGB cut to [0, 1]."""

ORB_VIEW_SSIM = SsimProtocol(
    name="orb-view-ssim",
    subject="radiance",
    summary="SSIM, windows of 3, as displayed (Stanford-ORB, new views)",
    source=_ORB,
    alignment=_LDR,
    window=KORNIA_3,
)
"""SSIM of the pictures of ``orb-view-ldr``."""

GAUSSIAN_SPLATTING_PSNR = PsnrProtocol(
    name="3dgs-psnr",
    subject="radiance",
    summary="as displayed, 8 bits, whole image (3D Gaussian Splatting)",
    source=_3DGS,
    alignment=_EIGHT_BITS,
    pixels="whole image",
)
"""Every pixel of 8-bit files enters, the background as well."""

GAUSSIAN_SPLATTING_SSIM = SsimProtocol(
    name="3dgs-ssim",
    subject="radiance",
    summary="SSIM, zeros beyond the border, as displayed, 8 bits, whole image (3D Gaussian Splatting)",
    source=_3DGS,
    alignment=_EIGHT_BITS,
    window=ZEROS,
)
"""Windows see zeros beyond the border, in both pictures, which makes them alike there."""

VIEWS: tuple[PublishedProtocol, ...] = (
    ORB_VIEW_HDR,
    ORB_VIEW_LDR,
    ORB_VIEW_SSIM,
    GAUSSIAN_SPLATTING_PSNR,
    GAUSSIAN_SPLATTING_SSIM,
)
"""Protocols for held-out views, in the order in which they are shown."""


def _scaled(alignment: Alignment) -> Alignment:
    """Return an alignment in which each picture has three factors of its own, as for new light."""
    estimator = "least squares, per channel, black as white"
    return replace(alignment, estimator=estimator, fitted_on="each scored view")


ORB_RELIT_HDR = PsnrProtocol(
    name="orb-relit-hdr",
    subject="relit",
    summary="one factor a channel and picture, linear light, cut at 4, whole image (Stanford-ORB, new light)",
    source=_ORB,
    alignment=_scaled(_HDR),
    pixels="whole image",
    floor=0.5,
    ignores=CHANNEL,
    refuses=("sign",),
)
"""``orb-view-hdr`` with three factors Σ p t / Σ p² for each picture, inside the eroded mask."""

ORB_RELIT_LDR = PsnrProtocol(
    name="orb-relit-ldr",
    subject="relit",
    summary="one factor a channel and picture, as displayed, whole image (Stanford-ORB, new light)",
    source=_ORB,
    alignment=_scaled(_LDR),
    pixels="whole image",
    floor=0.5,
    ignores=CHANNEL,
    refuses=("sign",),
)
"""``orb-view-ldr`` with three factors for each picture, fitted in linear light."""

ORB_RELIT_SSIM = SsimProtocol(
    name="orb-relit-ssim",
    subject="relit",
    summary="SSIM, windows of 3, one factor a channel and picture, as displayed (Stanford-ORB, new light)",
    source=_ORB,
    alignment=_scaled(_LDR),
    window=KORNIA_3,
    ignores=CHANNEL,
    refuses=("sign",),
)
"""SSIM of the pictures of ``orb-relit-ldr``."""

OWL = PsnrProtocol(
    name="owl",
    version=2,
    subject="relit",
    summary="exposure and colour balance of each picture, as displayed (Objects With Lighting)",
    source="isl-org/objects-with-lighting, scripts/evaluate.py and utils/metrics.py, 06f6076",
    alignment=Alignment(
        true_as="8 bits, gamma 2.2",
        estimator="least absolute error, exposure and balance",
        fitted_on="each scored view",
        limit=1,
        space="gamma 2.2",
    ),
    ignores=GLOBAL,
    refuses=("sign",),
)
"""Each picture gets the exposure, then the balance of each channel within [0.5, 2], of least mean absolute
error at gamma 2.2, fitted where the truth is not white, scored over the whole mask; the truth is an 8-bit
file. The least errors themselves are found here, where the original's search may stop before. Version 1
applied the rule to albedo, which its authors do not score."""

NVDIFFRECMC = PsnrProtocol(
    name="nvdiffrecmc-relit",
    subject="relit",
    summary="mean intensity of the truth, as displayed, whole image (nvdiffrecmc)",
    source="NVlabs/nvdiffrecmc, issue 25 (the factor), and issue 20 (sRGB files, the whole picture)",
    alignment=Alignment(estimator="ratio of means", fitted_on="each scored view", space="sRGB"),
    pixels="whole image",
    ignores=GLOBAL,
    refuses=("sign",),
)
"""Each picture is rescaled to the mean intensity of the true one. The authors say so in words; that the means
are linear and of the mask is a choice made here. Not held against their program."""

RELIGHTING: tuple[PublishedProtocol, ...] = (
    ORB_RELIT_HDR,
    ORB_RELIT_LDR,
    ORB_RELIT_SSIM,
    OWL,
    NVDIFFRECMC,
)
"""Protocols for pictures under other lights, in the order in which they are shown."""
