# SPDX-License-Identifier: Apache-2.0
"""``r3dg``: surfels that are shaded one by one, each with light of its own (Gao et al., ECCV 2024)."""

from graycard.methods.r3dg._method import R3dgMethod as R3dgMethod
from graycard.methods.r3dg._scene import R3dgScene as R3dgScene
from graycard.methods.r3dg._settings import R3dgSettings as R3dgSettings
