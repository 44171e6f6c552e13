# SPDX-License-Identifier: Apache-2.0
"""Words on each track: what it is about, and by which metrics it is told at the top."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from graycard.records import MetricRecord


@dataclass(frozen=True, slots=True)
class TrackWords:
    """A track in words."""

    about: str = ""
    headline: Mapping[str, str] = field(default_factory=dict)
    """Metrics that answer what this track asks, beside the headline metrics of all: id, and which part of the
    answer it is."""
    shown: tuple[str, str] = ("albedo.psnr.channel", "base_color")
    """Metric and layer of the strip of pictures at the top."""


_TRACKS = {
    "dark": TrackWords("the main light is mounted on the camera and moves with it"),
    "tabletop": TrackWords(
        "objects on a glossy surface, one of which is to be removed, with its reflection and its shadow",
        {
            "counterfactual.residual.mirror.specular": "Removal of the reflection",
            "counterfactual.residual.shadow.diffuse": "Removal of the shadow",
        },
        ("counterfactual.psnr", "counterfactual.radiance"),
    ),
    "multilight": TrackWords("several local lights and an environment"),
}


def words_of(track: str) -> TrackWords:
    """Words on a track; nothing of an unknown one."""
    return _TRACKS.get(track, TrackWords())


def headline_of(track: str, metrics: Sequence[MetricRecord]) -> list[MetricRecord]:
    """Return the metrics of a track's leaderboard: those that are headlines anywhere, and its own."""
    return [m for m in metrics if m.headline or m.id in words_of(track).headline]
