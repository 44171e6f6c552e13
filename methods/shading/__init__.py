# SPDX-License-Identifier: Apache-2.0
"""Light on surfaces: the material of the papers under lamps and surroundings; nothing is in the way."""

from graycard.methods.shading._cubemap import from_latitudes as from_latitudes
from graycard.methods.shading._cubemap import look_up as look_up
from graycard.methods.shading._cubemap import solid_angles as solid_angles
from graycard.methods.shading._cubemap import texel_directions as texel_directions
from graycard.methods.shading._cubemap import to_latitudes as to_latitudes
from graycard.methods.shading._known import KnownLamps as KnownLamps
from graycard.methods.shading._known import known_lamps as known_lamps
from graycard.methods.shading._known import light_at as light_at
from graycard.methods.shading._lamps import Arrival as Arrival
from graycard.methods.shading._lamps import Lamps as Lamps
from graycard.methods.shading._lamps import Shining as Shining
from graycard.methods.shading._lamps import arriving as arriving
from graycard.methods.shading._lamps import lamps_of as lamps_of
from graycard.methods.shading._lamps import lights_of as lights_of
from graycard.methods.shading._lamps import lit_by_lamps as lit_by_lamps
from graycard.methods.shading._material import DIELECTRIC_F0 as DIELECTRIC_F0
from graycard.methods.shading._material import MIN_ALPHA as MIN_ALPHA
from graycard.methods.shading._material import Lobes as Lobes
from graycard.methods.shading._material import Material as Material
from graycard.methods.shading._material import ggx_density as ggx_density
from graycard.methods.shading._material import scattering as scattering
from graycard.methods.shading._material import schlick as schlick
from graycard.methods.shading._material import smith_shadowing as smith_shadowing
from graycard.methods.shading._surroundings import Surroundings as Surroundings
from graycard.methods.shading._surroundings import even_sky as even_sky
from graycard.methods.shading._surroundings import lit_by_surroundings as lit_by_surroundings
from graycard.methods.shading._surroundings import surroundings_of as surroundings_of
