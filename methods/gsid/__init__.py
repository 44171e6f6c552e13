# SPDX-License-Identifier: Apache-2.0
"""``gsid``: materials, local lamps and an environment, apart (Du et al., ICCV 2025)."""

from graycard.methods.gsid._method import GsidMethod as GsidMethod
from graycard.methods.gsid._method import GsirMethod as GsirMethod
from graycard.methods.gsid._scene import GsidScene as GsidScene
from graycard.methods.gsid._settings import GsidSettings as GsidSettings
from graycard.methods.gsid._settings import GsirSettings as GsirSettings
from graycard.methods.gsid._visibility import VECTOR_FORMS as VECTOR_FORMS
from graycard.methods.gsid._visibility import vector_visibility as vector_visibility
