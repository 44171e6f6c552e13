# SPDX-License-Identifier: Apache-2.0
"""Passes of a rendering one by one, for those who need no more. Import it only after ``use_renderer``."""

from graycard.synth.layers._separation import separated_images as separated_images
from graycard.synth.layers._views import picture_images as picture_images
from graycard.synth.layers._views import radiance_images as radiance_images
from graycard.synth.layers._views import surface_layers as surface_layers
from graycard.synth.renderer._mitsuba import load_scene as load_scene
