# SPDX-License-Identifier: Apache-2.0
"""Splats that other programs have trained: read them, and render them as predictions of a scene."""

from graycard.methods.trained._frame import FRAMES as FRAMES
from graycard.methods.trained._frame import SAME as SAME
from graycard.methods.trained._frame import Frame as Frame
from graycard.methods.trained._frame import FrameKind as FrameKind
from graycard.methods.trained._frame import read_frame as read_frame
from graycard.methods.trained._predict import DrawnSplat as DrawnSplat
from graycard.methods.trained._predict import Encoding as Encoding
from graycard.methods.trained._predict import Look as Look
from graycard.methods.trained._predict import write_splat_predictions as write_splat_predictions
from graycard.methods.trained._read import read_splat as read_splat
from graycard.methods.trained._render import KERNELS as KERNELS
from graycard.methods.trained._render import Picture as Picture
from graycard.methods.trained._render import render_splat as render_splat
from graycard.methods.trained._trained import Primitive as Primitive
from graycard.methods.trained._trained import TrainedSplat as TrainedSplat
from graycard.methods.trained._write import SPLAT_FORMATS as SPLAT_FORMATS
from graycard.methods.trained._write import SplatFormat as SplatFormat
from graycard.methods.trained._write import write_splat as write_splat
