# SPDX-License-Identifier: Apache-2.0
"""``sunfaded``: albedo, ambient light and a lamp on the camera, apart (Chang et al., CVPR 2026)."""

from graycard.methods.sunfaded._method import SunFadedMethod as SunFadedMethod
from graycard.methods.sunfaded._oracle import OracleSunFadedMethod as OracleSunFadedMethod
from graycard.methods.sunfaded._oracle import OracleSunFadedScene as OracleSunFadedScene
from graycard.methods.sunfaded._oracle import OracleSunFadedSettings as OracleSunFadedSettings
from graycard.methods.sunfaded._scene import SunFadedScene as SunFadedScene
from graycard.methods.sunfaded._settings import SunFadedSettings as SunFadedSettings
