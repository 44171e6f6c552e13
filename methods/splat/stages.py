# SPDX-License-Identifier: Apache-2.0
"""The stages of the CPU rasteriser one by one, and its thresholds, for those who time or count them."""

from graycard.methods.splat._maps import ALPHA_MAX as ALPHA_MAX
from graycard.methods.splat._maps import ALPHA_MIN as ALPHA_MIN
from graycard.methods.splat._maps import NEAR as NEAR
from graycard.methods.splat._maps import TRANSMITTANCE_MIN as TRANSMITTANCE_MIN
from graycard.methods.splat.raster._idle import give_back as give_back
from graycard.methods.splat.raster._stage_arrays import Scene as Scene
from graycard.methods.splat.raster._stage_arrays import working_bytes as working_bytes
from graycard.methods.splat.raster._stages import draw as draw
from graycard.methods.splat.raster._stages import draw_backward as draw_backward
from graycard.methods.splat.raster._stages import list_tiles as list_tiles
from graycard.methods.splat.raster._stages import padded_channels as padded_channels
from graycard.methods.splat.raster._stages import project as project
from graycard.methods.splat.raster._stages import project_backward as project_backward
