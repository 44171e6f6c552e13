# SPDX-License-Identifier: Apache-2.0
"""Predictions against truth: metrics, gauges, scores."""

from graycard import angles as angles
from graycard.eval._colour_difference import ciede2000 as ciede2000
from graycard.eval._flip import flip as flip
from graycard.eval._flip import flip_map as flip_map
from graycard.eval._gauge import Moments as Moments
from graycard.eval._gauge import apply_gauge as apply_gauge
from graycard.eval._gauge import fit_gauge as fit_gauge
from graycard.eval._gauge import moments as moments
from graycard.eval._light_errors import LightMatch as LightMatch
from graycard.eval._light_errors import intensity_error as intensity_error
from graycard.eval._light_errors import light_distances as light_distances
from graycard.eval._light_errors import match_lights as match_lights
from graycard.eval._lmse import lmse as lmse
from graycard.eval._mask import judged_mask as judged_mask
from graycard.eval._metrics import metrics as metrics
from graycard.eval._psnr import mean_square_error as mean_square_error
from graycard.eval._psnr import psnr as psnr
from graycard.eval._sheet import score_predictions as score_predictions
from graycard.eval._sheet import training_gauges as training_gauges
from graycard.eval._ssim import ssim as ssim
from graycard.eval._tolerances import REFERENCES as REFERENCES
from graycard.eval._tolerances import Reference as Reference
from graycard.eval.protocols import PROTOCOL as PROTOCOL
from graycard.eval.protocols import find_protocols as find_protocols
from graycard.eval.protocols import protocols as protocols
