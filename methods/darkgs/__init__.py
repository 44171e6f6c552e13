# SPDX-License-Identifier: Apache-2.0
"""``darkgs``: surfels shaded one by one under a lamp that was calibrated before (Zhang et al., IROS 2024)."""

from graycard.methods.darkgs._method import DarkGsMethod as DarkGsMethod
from graycard.methods.darkgs._scene import DarkGsScene as DarkGsScene
from graycard.methods.darkgs._settings import DarkGsSettings as DarkGsSettings
