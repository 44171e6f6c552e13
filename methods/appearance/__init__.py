# SPDX-License-Identifier: Apache-2.0
"""``appearance``: ``2dgs`` whose colours each photograph may change (WildGaussians, Kulhanek et al. 2024)."""

from graycard.methods.appearance._method import AppearanceMethod as AppearanceMethod
from graycard.methods.appearance._scene import AppearanceScene as AppearanceScene
from graycard.methods.appearance._settings import AppearanceSettings as AppearanceSettings
