# SPDX-License-Identifier: Apache-2.0
"""LPIPS of aligned albedo, as five papers print it beside the PSNR."""

from dataclasses import replace

from graycard.eval.kinds._records import CHANNEL, GLOBAL
from graycard.eval.protocols._base import PublishedProtocol
from graycard.eval.protocols._perceptual import LpipsProtocol
from graycard.eval.protocols.catalogue import _albedo as albedo

ORB_ALBEDO = LpipsProtocol(
    name="orb-albedo-lpips",
    summary="LPIPS, VGG, sRGB, of albedo as orb-albedo aligns it (Stanford-ORB)",
    source="StanfordORB/Stanford-ORB, orb/utils/test.py, lpips, 1fe21c1",
    alignment=replace(albedo.ORB_ALBEDO.alignment, space="sRGB"),
    ignores=CHANNEL,
    refuses=("sign",),
)
"""sRGB, black outside the eroded mask."""

TENSOIR_THREE = LpipsProtocol(
    name="tensoir-three-lpips",
    summary="LPIPS, VGG, linear, of albedo as tensoir-three aligns it (TensoIR)",
    source="Haian-Jin/TensoIR, renderer.py, evaluation_iter_TensoIR, 0ce4aa7, and utils.py, rgb_lpips",
    alignment=replace(albedo.TENSOIR_THREE.alignment, space="linear"),
    ignores=CHANNEL,
)
"""Linear, on white. The script prints AlexNet's number, too."""

TENSOIR_SINGLE = LpipsProtocol(
    name="tensoir-single-lpips",
    summary="LPIPS, VGG, linear, of albedo as tensoir-single aligns it (TensoIR)",
    source=TENSOIR_THREE.source,
    alignment=replace(albedo.TENSOIR_SINGLE.alignment, space="linear"),
    ignores=GLOBAL,
)
"""``tensoir-three-lpips`` with one factor."""

GS_IR = LpipsProtocol(
    name="gs-ir-lpips",
    summary="LPIPS, VGG, of albedo as gs-ir aligns it (GS-IR)",
    source="lzhnb/GS-IR, render.py, eval_brdf, 0d8c1ea",
    alignment=albedo.GS_IR.alignment,
    fed="as it is",
)
"""Linear, with what the prediction holds outside the mask; [0, 1] is not stretched for the network."""

R3DG_SYN4 = LpipsProtocol(
    name="r3dg-syn4-lpips",
    summary="LPIPS, VGG, sRGB, of albedo as r3dg-syn4 aligns it (Relightable 3DGS)",
    source="NJU-3DV/Relightable3DGaussian, eval_relighting_syn4.py, 213a475, by lpipsPyTorch",
    alignment=albedo.R3DG_SYN4.alignment,
    fed="as it is",
)
"""sRGB, on white; [0, 1] is not stretched for the network."""

IRGS_SYN4 = LpipsProtocol(
    name="irgs-syn4-lpips",
    summary="LPIPS, VGG, of albedo as irgs-syn4 aligns it (IRGS)",
    source=albedo.IRGS_SYN4.source + ", by lpipsPyTorch",
    alignment=albedo.IRGS_SYN4.alignment,
    fed="as it is",
    ignores=CHANNEL,
)
"""Linear and uncut, on black; [0, 1] is not stretched for the network."""

IRGS_TENSOIR = LpipsProtocol(
    name="irgs-tensoir-lpips",
    summary="LPIPS, VGG, of albedo as irgs-tensoir aligns it (IRGS)",
    source=albedo.IRGS_TENSOIR.source + ", by lpipsPyTorch",
    alignment=albedo.IRGS_TENSOIR.alignment,
    fed="as it is",
    ignores=CHANNEL,
)
"""``irgs-syn4-lpips`` by another alignment."""

PERCEPTUAL: tuple[PublishedProtocol, ...] = (
    ORB_ALBEDO,
    TENSOIR_THREE,
    TENSOIR_SINGLE,
    GS_IR,
    R3DG_SYN4,
    IRGS_SYN4,
    IRGS_TENSOIR,
)
"""All protocols above, in the order in which they are shown."""
