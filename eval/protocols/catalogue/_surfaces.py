# SPDX-License-Identifier: Apache-2.0
"""Protocols for normals, depth and roughness as published code has them."""

from graycard.eval.kinds._records import ANY, GLOBAL
from graycard.eval.protocols._base import PublishedProtocol
from graycard.eval.protocols._geometry import AngleProtocol, CosineProtocol, DepthProtocol
from graycard.eval.protocols._materials import RoughnessProtocol

ORB_NORMAL = CosineProtocol(
    name="orb-normal",
    summary="1 - cos, mask eroded by 5 x 5 (Stanford-ORB)",
    source="StanfordORB/Stanford-ORB, orb/utils/metrics.py, calc_normal_distance, 6595814",
    ignores=GLOBAL,
)
"""Mean over the eroded mask, then over views."""

TENSOIR_NORMAL = AngleProtocol(
    name="tensoir-normal",
    summary="mean angle over the whole picture (TensoIR)",
    source="Haian-Jin/TensoIR, renderer.py, evaluation_iter_TensoIR, 0ce4aa7",
    ignores=GLOBAL,
)
"""The background is (0, 0, 1) in the truth; the prediction has there what was drawn. A small object makes the
mean small. IRGS prints the same mean, of truth in 8 bits."""

GS_IR_NORMAL = AngleProtocol(
    name="gs-ir-normal",
    summary="mean angle over the whole picture, 8 bits (GS-IR)",
    source="lzhnb/GS-IR, normal_eval.py, get_mae, 0d8c1ea",
    stored_as="8 bits",
)
"""``tensoir-normal`` of 8-bit files; the stored normal (128, 128, 255) stands for the background."""

ORB_DEPTH = DepthProtocol(
    name="orb-depth",
    summary="mean square error after one scale a scene, whole picture (Stanford-ORB)",
    source="StanfordORB/Stanford-ORB, orb/utils/metrics.py, calc_depth_distance_per_scene, 6595814",
    ignores=ANY,
)
"""Along the optical axis, in the unit of the truth squared. A view whose prediction is black gets depth 1."""

R3DG_ROUGHNESS = RoughnessProtocol(
    name="r3dg-roughness",
    summary="mean square error over the whole picture (Relightable 3DGS, IRGS)",
    source="NJU-3DV/Relightable3DGaussian, eval_relighting_syn4.py, 213a475; TCZ-Tao/IRGS, "
    "eval_material_syn4.py, b7def9a",
)
"""Both scripts put one background into both pictures, white and black: the number is the same. A surface
without a specular lobe has no roughness here, and counts as background."""

GEOMETRY: tuple[PublishedProtocol, ...] = (ORB_NORMAL, TENSOIR_NORMAL, GS_IR_NORMAL, ORB_DEPTH)
"""Protocols for normals and depth, in the order in which they are shown."""
MATERIALS: tuple[PublishedProtocol, ...] = (R3DG_ROUGHNESS,)
"""Protocols for materials other than base colour."""
