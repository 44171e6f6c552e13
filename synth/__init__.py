# SPDX-License-Identifier: Apache-2.0
"""Ground truth: seeded procedural scenes, rendered by Mitsuba 3.

Importing this package does not import Mitsuba; :func:`render_scene` does when there is something to render.
"""

from graycard.synth._scene import Ball as Ball
from graycard.synth._scene import Conductor as Conductor
from graycard.synth._scene import Glossy as Glossy
from graycard.synth._scene import LambertGGX as LambertGGX
from graycard.synth._scene import Matte as Matte
from graycard.synth._scene import Quad as Quad
from graycard.synth._scene import Scene as Scene
from graycard.synth._scene import Texture as Texture
from graycard.synth._scene import Thing as Thing
from graycard.synth._spec import GENERATOR_VERSION as GENERATOR_VERSION
from graycard.synth._spec import MOST_PATHS as MOST_PATHS
from graycard.synth._spec import SUB_BUFFERS as SUB_BUFFERS
from graycard.synth._spec import CaptureSettings as CaptureSettings
from graycard.synth._spec import RenderSettings as RenderSettings
from graycard.synth._spec import SceneSpec as SceneSpec
from graycard.synth._spec import SecretSpec as SecretSpec
from graycard.synth.dataset._identity import with_defaults as with_defaults
from graycard.synth.dataset._render import begin_scene as begin_scene
from graycard.synth.dataset._render import clear_leftovers as clear_leftovers
from graycard.synth.dataset._render import find_scene as find_scene
from graycard.synth.dataset._render import render_part as render_part
from graycard.synth.dataset._render import render_scene as render_scene
from graycard.synth.edits._composition import donor_scene as donor_scene
from graycard.synth.families import Family as Family
from graycard.synth.families import Knob as Knob
from graycard.synth.families import all_families as all_families
from graycard.synth.families import describe as describe
from graycard.synth.families import family_of as family_of
from graycard.synth.families import knobs as knobs
from graycard.synth.families import resolved_knobs as resolved_knobs
from graycard.synth.families import scene_name as scene_name
from graycard.synth.renderer._variant import LLVM as LLVM
from graycard.synth.renderer._variant import Renderer as Renderer
from graycard.synth.renderer._variant import find_llvm as find_llvm
from graycard.synth.renderer._variant import use_renderer as use_renderer
