# SPDX-License-Identifier: Apache-2.0
"""Pictures, which only scenes and predictions can give: all else follows from records and today's rules."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from graycard import GraycardError, RecordError
from graycard.io import from_builtins, to_builtins
from graycard.reports._scene_section import MethodFault, ScenePictures, SceneSection
from graycard.reports.parts._islands import unpack, with_bytes, without_bytes

_KEPT: Final = re.compile(r'<script type="application/octet-stream" data-kept="([^"]*)">([^<]*)</script>')
_BLOBS: Final = re.compile(r'<script type="application/json" data-blobs="([^"]*)">([^<]*)</script>')


@dataclass(frozen=True, slots=True)
class KeptScene:
    """Pictures, plan and faults of one scene."""

    track: str
    scene: str
    pictures: ScenePictures | None
    reason: str
    faults: tuple[MethodFault, ...]


Kept = Mapping[tuple[str, str], KeptScene]
"""By track and scene."""


def kept_of(track: str, section: SceneSection) -> tuple[str, dict[str, str]]:
    """Return what is kept of a scene as JSON text, and the bytes of its pictures by key."""
    kept = KeptScene(track, section.name, section.pictures, section.reason, section.faults)
    data, blobs = without_bytes(to_builtins(kept))
    return json.dumps(data, separators=(",", ":"), ensure_ascii=False), blobs


def kept_scenes(page: str) -> Kept:
    """Return what a page keeps.

    Raises:
        RecordError: The page is of an earlier graycard, or damaged.
    """
    blobs = {found[1]: found[2] for found in _BLOBS.finditer(page)}
    try:
        scenes = [_read(found[2], blobs.get(found[1], "{}")) for found in _KEPT.finditer(page)]
    except (ValueError, KeyError, GraycardError) as cause:
        raise RecordError(
            "expected a report with the pictures of its scenes, got one whose pictures cannot be read "
            f"({cause}). "
            "Publish the run anew"
        ) from cause
    return {(scene.track, scene.scene): scene for scene in scenes}


def _read(packed: str, blobs: str) -> KeptScene:
    data: Any = with_bytes(json.loads(unpack(packed)), json.loads(blobs))
    return from_builtins(KeptScene, data)
