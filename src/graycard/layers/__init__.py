# SPDX-License-Identifier: Apache-2.0
"""Layers: the named images of a decomposition, and those that follow from others."""

from graycard.layers._derived import GLOSSY_ROUGHNESS as GLOSSY_ROUGHNESS
from graycard.layers._derived import glossy_mask as glossy_mask
from graycard.layers._derived import with_derived as with_derived
from graycard.layers._derived import with_geometry as with_geometry
from graycard.layers._layer import Layer as Layer
from graycard.layers._layer import all_layers as all_layers
from graycard.layers._layer import find_codes as find_codes
from graycard.layers._layer import find_fault as find_fault
from graycard.layers._layer import find_layer as find_layer
from graycard.layers._layer import not_meant as not_meant
from graycard.layers._layer import shape_of as shape_of
from graycard.layers._shares import LOBES as LOBES
from graycard.layers._shares import PARTS as PARTS
from graycard.layers._shares import lights_of as lights_of
from graycard.layers._shares import with_sums as with_sums
