# SPDX-License-Identifier: Apache-2.0
"""SSIM of aligned albedo, as five papers print it beside the PSNR."""

from dataclasses import replace

from graycard.eval.kinds._records import CHANNEL, GLOBAL
from graycard.eval.measures._window_ssim import Window
from graycard.eval.protocols._base import PublishedProtocol
from graycard.eval.protocols._similarity import SsimProtocol
from graycard.eval.protocols.catalogue import _albedo as albedo

ZEROS = Window(11, "zeros")
"""SSIM of 3D Gaussian Splatting, utils/loss_utils.py: beyond the border both pictures are black."""
KORNIA_3 = Window(3, "mirrored")
"""SSIM of Stanford-ORB: kornia's, with a window of 3 pixels."""
WHOLE_WINDOWS = Window(11, "none")
"""SSIM of TensoIR, after mip-NeRF: windows that lie in the picture."""

ORB_ALBEDO = SsimProtocol(
    name="orb-albedo-ssim",
    summary="SSIM, windows of 3, of albedo as orb-albedo aligns it (Stanford-ORB)",
    source="StanfordORB/Stanford-ORB, orb/utils/test.py, compute_similarity_albedo, 1fe21c1",
    alignment=albedo.ORB_ALBEDO.alignment,
    window=KORNIA_3,
    ignores=CHANNEL,
    refuses=("sign",),
)
"""Linear, cut to [0, 1], black outside the eroded mask; the mean is over the whole picture."""

TENSOIR_THREE = SsimProtocol(
    name="tensoir-three-ssim",
    summary="SSIM, linear, of albedo as tensoir-three aligns it (TensoIR)",
    source="Haian-Jin/TensoIR, renderer.py, evaluation_iter_TensoIR, and utils.py, rgb_ssim, 0ce4aa7",
    alignment=replace(albedo.TENSOIR_THREE.alignment, space="linear"),
    window=WHOLE_WINDOWS,
    ignores=CHANNEL,
)
"""Linear, though the PSNR beside it is of gamma 2.2; on white."""

TENSOIR_SINGLE = SsimProtocol(
    name="tensoir-single-ssim",
    summary="SSIM, linear, of albedo as tensoir-single aligns it (TensoIR)",
    source=TENSOIR_THREE.source,
    alignment=replace(albedo.TENSOIR_SINGLE.alignment, space="linear"),
    window=WHOLE_WINDOWS,
    ignores=GLOBAL,
)
"""``tensoir-three-ssim`` with one factor."""

GS_IR = SsimProtocol(
    name="gs-ir-ssim",
    summary="SSIM of albedo as gs-ir aligns it (GS-IR)",
    source="lzhnb/GS-IR, render.py, eval_brdf, and utils/loss_utils.py, ssim, 0d8c1ea",
    alignment=albedo.GS_IR.alignment,
    window=ZEROS,
)
"""Linear, with what the prediction holds outside the mask."""

R3DG_SYN4 = SsimProtocol(
    name="r3dg-syn4-ssim",
    summary="SSIM, sRGB, of albedo as r3dg-syn4 aligns it (Relightable 3DGS)",
    source="NJU-3DV/Relightable3DGaussian, eval_relighting_syn4.py and utils/loss_utils.py, ssim, 213a475",
    alignment=albedo.R3DG_SYN4.alignment,
    window=ZEROS,
)
"""sRGB, on white."""

IRGS_SYN4 = SsimProtocol(
    name="irgs-syn4-ssim",
    summary="SSIM of albedo as irgs-syn4 aligns it (IRGS)",
    source=albedo.IRGS_SYN4.source,
    alignment=albedo.IRGS_SYN4.alignment,
    window=ZEROS,
    ignores=CHANNEL,
)
"""Linear and uncut, on black."""

IRGS_TENSOIR = SsimProtocol(
    name="irgs-tensoir-ssim",
    summary="SSIM of albedo as irgs-tensoir aligns it (IRGS)",
    source=albedo.IRGS_TENSOIR.source,
    alignment=albedo.IRGS_TENSOIR.alignment,
    window=ZEROS,
    ignores=CHANNEL,
)
"""Linear and uncut, on black."""

APPEARANCE: tuple[PublishedProtocol, ...] = (
    ORB_ALBEDO,
    TENSOIR_THREE,
    TENSOIR_SINGLE,
    GS_IR,
    R3DG_SYN4,
    IRGS_SYN4,
    IRGS_TENSOIR,
)
"""All protocols above, in the order in which they are shown."""
