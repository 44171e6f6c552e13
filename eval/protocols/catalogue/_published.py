# SPDX-License-Identifier: Apache-2.0
"""All published protocols, by what they judge, and what their former versions were."""

from collections.abc import Mapping

from graycard.eval.protocols._base import PublishedProtocol
from graycard.eval.protocols.catalogue._albedo import ALBEDO
from graycard.eval.protocols.catalogue._appearance import APPEARANCE
from graycard.eval.protocols.catalogue._perceptual import PERCEPTUAL
from graycard.eval.protocols.catalogue._pictures import RELIGHTING, VIEWS
from graycard.eval.protocols.catalogue._surfaces import GEOMETRY, MATERIALS

GROUPS_OF_PROTOCOLS: Mapping[str, tuple[PublishedProtocol, ...]] = {
    "albedo": ALBEDO,
    "appearance": APPEARANCE,
    "perceptual": PERCEPTUAL,
    "views": VIEWS,
    "relighting": RELIGHTING,
    "geometry": GEOMETRY,
    "materials": MATERIALS,
}
"""By name: errors of base colour, its SSIM, its LPIPS, held-out views, relit pictures, normals and depth,
and roughness."""
PUBLISHED: tuple[PublishedProtocol, ...] = tuple(
    protocol for group in GROUPS_OF_PROTOCOLS.values() for protocol in group
)
"""Every published protocol, in the order in which they are shown."""

FORMER: Mapping[str, str] = {
    "nerfactor-1": "rounded to 8 bits, where the original rounds down",
    "gs-ir-1": "left out what the prediction holds outside the mask",
    "r3dg-syn4-1": "compared in linear light, where the original compares sRGB",
    "nvdiffrec-1": "judged the mask alone",
    "owl-1": "applied a rule for relit pictures to albedo",
}
"""By id, versions that records may hold and that no longer score: what each did."""
