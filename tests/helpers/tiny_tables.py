# SPDX-License-Identifier: Apache-2.0
"""A glossy table and its tiny rendering, for tests that cut renderings off and damage scenes."""

import subprocess
from collections.abc import Callable
from pathlib import Path

from graycard.io import read_manifest, sha256, to_builtins
from graycard.synth import (
    RenderSettings,
    SceneSpec,
)
from graycard.synth.dataset._identity import identity
from graycard.synth.dataset._store import Place, reopen

TINY = RenderSettings(20, 16, 3, 1, 4, 3)
TABLE = SceneSpec("tabletop", "glossy-table", 0)
TABLE_RENDERINGS = 4 + 3
"""Views, and the held-out one under each change of the two lights: nothing is a sum in ``scalar_rgb``."""
KEPT = {"train_000": 0, "test_002": 2, "train_003": 3}
"""Pictures that are kept of a rendering that is killed as it begins these views."""
AMONG_RELIT = "test_002 without-room"
"""The last moment to kill at: all views are kept, and a held-out one under the first change of lights."""
HIDDEN = {"DRJIT_LIBLLVM_PATH": "/nowhere/libLLVM.so"}

RunPython = Callable[..., subprocess.CompletedProcess[str]]
"""Function that runs Python in a process of its own."""

RENDER = """
import os, signal, sys, json
import graycard.synth as synth
from graycard.io import from_builtins
spec, settings, out, threads, kill_at = json.loads(sys.argv[1])
def progress(done, doing):
    if kill_at and kill_at in doing:
        os.kill(os.getpid(), signal.SIGKILL)
spec, settings = from_builtins(synth.SceneSpec, spec), from_builtins(synth.RenderSettings, settings)
print(synth.render_scene(spec, settings, out, progress, threads))
print("mitsuba" in sys.modules, "colour" in sys.modules)
"""
"""Program that renders a scene, and kills itself where it is told to."""


def bits(folder: Path) -> dict[str, str]:
    """Hash of each file, hidden ones as well."""
    return {str(p.relative_to(folder)): sha256(p) for p in sorted(folder.rglob("*")) if p.is_file()}


def in_the_making(table: Path, forgets: str = "") -> Place:
    """Make a whole scene one in the making, without a view, and stamped by code that lacks a knob."""
    place = Place(table.parent.parent, "tabletop", table.name)
    manifest = read_manifest(table / "truth", "graycard-truth")
    stamp = to_builtins(identity(TABLE, TINY)) | {"variant": manifest.generator["variant"]}
    stamp["knobs"].pop(forgets, None)
    reopen(place, stamp, {"truth/views/test_002.exr": "gone"})
    return place
