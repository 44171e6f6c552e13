# SPDX-License-Identifier: Apache-2.0
"""``2dgs``: surfels whose colours change with the view, fitted to photographs and nothing else."""

from graycard.methods.surfels._checks import check_lamp_on_camera as check_lamp_on_camera
from graycard.methods.surfels._checks import check_photographs as check_photographs
from graycard.methods.surfels._checks import check_places as check_places
from graycard.methods.surfels._colour import decode as decode
from graycard.methods.surfels._colour import encode as encode
from graycard.methods.surfels._compose import composed as composed
from graycard.methods.surfels._likeness import SweptView as SweptView
from graycard.methods.surfels._method import OracleSurfelMethod as OracleSurfelMethod
from graycard.methods.surfels._method import SurfelMethod as SurfelMethod
from graycard.methods.surfels._method import check_checkpoint as check_checkpoint
from graycard.methods.surfels._method import density_rules as density_rules
from graycard.methods.surfels._method import fit_checkpoint as fit_checkpoint
from graycard.methods.surfels._method import fit_surfels as fit_surfels
from graycard.methods.surfels._method import learning_rates as learning_rates
from graycard.methods.surfels._objective import Objective as Objective
from graycard.methods.surfels._objective import Photograph as Photograph
from graycard.methods.surfels._objective import Tones as Tones
from graycard.methods.surfels._objective import colours as colours
from graycard.methods.surfels._objective import disagreement as disagreement
from graycard.methods.surfels._objective import photographs as photographs
from graycard.methods.surfels._objective import sky_basis as sky_basis
from graycard.methods.surfels._scene import LAYERS as LAYERS
from graycard.methods.surfels._scene import SurfelScene as SurfelScene
from graycard.methods.surfels._scene import all_colours as all_colours
from graycard.methods.surfels._scene import coloured_layers as coloured_layers
from graycard.methods.surfels._scene import depth_layer as depth_layer
from graycard.methods.surfels._scene import export_colours as export_colours
from graycard.methods.surfels._scene import normal_layer as normal_layer
from graycard.methods.surfels._settings import OracleSurfelSettings as OracleSurfelSettings
from graycard.methods.surfels._settings import SurfelSettings as SurfelSettings
from graycard.methods.surfels._start import sparse_discs as sparse_discs
from graycard.methods.surfels._start import sparse_start as sparse_start
from graycard.methods.surfels._start import with_colours as with_colours
from graycard.methods.surfels._sweep import sweep_depth as sweep_depth
