# SPDX-License-Identifier: Apache-2.0
"""The scene families: generators of scenes with their knobs, and the props, textures and stock they share.

A family is a frozen dataclass of knobs that builds a scene, as plain data, from a seed; nothing here renders.
Beside it, ``graycard.synth`` has a function of this package's name: take what is inside by
``from graycard.synth.families import ...``.
"""

from graycard.synth.families._catalogue import Knob as Knob
from graycard.synth.families._catalogue import all_families as all_families
from graycard.synth.families._catalogue import default_knobs as default_knobs
from graycard.synth.families._catalogue import describe as describe
from graycard.synth.families._catalogue import family_of as family_of
from graycard.synth.families._catalogue import knobs as knobs
from graycard.synth.families._catalogue import resolved_knobs as resolved_knobs
from graycard.synth.families._catalogue import scene_name as scene_name
from graycard.synth.families._family import Family as Family
