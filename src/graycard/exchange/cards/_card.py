# SPDX-License-Identifier: Apache-2.0
"""A dataset as a data card: what is in it, how it was made, what it is for and what not, for people."""

from collections.abc import Iterator

from graycard.exchange.cards._croissant import describe, limits
from graycard.exchange.cards._survey import Publication, SceneFacts, Survey
from graycard.io import markdown_text

LONGEST = 200
"""Scenes that are listed one by one."""


def data_card(found: Survey, told: Publication) -> str:
    """Return the card of a dataset as Markdown.

    Args:
        found: The dataset.
        told: What only its publisher knows.
    """
    return "\n".join(_lines(found, told)) + "\n"


def _lines(found: Survey, told: Publication) -> Iterator[str]:
    yield from (f"# {markdown_text(found.name)}", "", describe(found), "")
    yield from ("| | |", "| --- | --- |")
    yield from (f"| {name} | {markdown_text(value)} |" for name, value in _facts(found, told))
    yield from ("", "## Content", "", "Each scene is a folder `<track>/<scene>/`:", "")
    yield _CONTENT
    yield from ("", "| scene | family | seed | pixels | training | held out | truth |")
    yield "| --- | --- | ---: | --- | ---: | ---: | --- |"
    yield from map(_row, found.scenes[:LONGEST])
    if len(found.scenes) > LONGEST:
        yield f"\n{len(found.scenes) - LONGEST} more are in `croissant.json`."
    yield from ("", "## Making")
    yield from ("", _MAKING) if found.imported < len(found.scenes) else ()
    yield from ("", _IMPORTED.format(found.imported)) if found.imported else ()
    yield from ("", "## Use", "", _USE, "", "## Limits", "", limits(found))


def _facts(found: Survey, told: Publication) -> Iterator[tuple[str, str]]:
    yield "version", f"graycard {found.version}"
    yield "published", told.date
    yield "place", told.url
    yield "licence", told.license
    yield "size", f"{found.size / 1e6:.0f} MB"
    yield "tracks", ", ".join(found.tracks)
    yield "families", ", ".join(found.families) or "imported photographs"


def _row(scene: SceneFacts) -> str:
    cells = (
        scene.place, scene.family or "imported", "" if scene.seed is None else str(scene.seed),
        f"{scene.width} x {scene.height}", str(scene.train_views), str(scene.test_views),
        "yes" if scene.truth else "no",
    )  # fmt: skip
    return "| " + " | ".join(map(markdown_text, cells)) + " |"


_CONTENT = """\
- `capture/`: what a method may see. Photographs in linear light (OpenEXR, Rec. 709, W/m²/sr), cameras (OpenCV
  axes, metres), sparse points, and masks where the task grants them.
- `truth/`: what it is judged by. Light, albedo, normals, depth and materials of each view, and the lights; of
  estimated layers the variance as well. Never give it to a method.
- `manifest.json` in each: the generator, seeds and settings, and the SHA-256 of each file."""
_MAKING = """\
Rendered with Mitsuba 3 by graycard from families of scenes, which are programs. A family, a seed and knobs
give the same scene to the last bit. No person and no place is shown, and nothing was annotated by hand.
`graycard verify DATASET` proves the truth again: by closed forms of the lamps, by light parts that add up, by
geometry against itself, and by a second rendering with other random numbers."""
_IMPORTED = """\
Photographs and cameras of {} scenes are of others, taken over by `graycard import`. Who or what they show is
not known to graycard: whoever publishes them answers for it."""
_USE = """\
For judging and developing methods that take photographs apart into light, shape and material:
`graycard fit METHOD SCENE --out PREDICTIONS`, then `graycard score PREDICTIONS SCENE`. Methods that are
trained on these scenes may not be compared on them."""
