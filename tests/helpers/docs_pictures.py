# SPDX-License-Identifier: Apache-2.0
"""Pictures of docs/pictures: each family, each layer, and one scene of each track taken apart.

``make pictures`` runs this. It renders small scenes into runs/pictures, some five minutes of processor time,
and draws them.
"""

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from graycard import Capture, Truth, open_capture, open_truth
from graycard.layers import all_layers, with_derived
from graycard.reports.pictures._layer_pictures import layer_picture, photograph_picture
from graycard.synth import RenderSettings, SceneSpec, all_families, render_scene

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
SEED = 1000
"""Seed of the scenes, one of tuning: no suite judges by it."""
SETTINGS = RenderSettings(
    width=192, height=192, train_views=3, test_views=1, samples=144, relighting=False, composition=False
)
SIDE, TEXT, GAP = 192, 18, 6
"""Pixels of a picture, of its caption, and between pictures."""
STRIP = ("base_color", "shading", "normal", "depth")
"""Layers beside the photograph of a family."""
SHOWN = {"dark": "cluttered-lab", "tabletop": "glossy-table", "multilight": "studio"}
"""Family of each track in the picture of tracks, and the scenes that layers are taken from."""
WORDS = {
    "photograph": "photograph",
    "base_color": "albedo",
    "shading": "light",
    "normal": "normals",
    "depth": "depth",
}


class Example:
    """One rendered scene: its capture, its truth, and all layers of its held-out view."""

    def __init__(self, folder: Path) -> None:
        """Open the scene in a folder."""
        self.capture: Capture = open_capture(folder / "capture")
        self.truth: Truth = open_truth(folder / "truth")
        self.view = next(view for view in self.truth.views if view.split == "test")
        self.layers: Mapping[str, np.ndarray] = with_derived(self.truth.layers(self.view))

    def picture(self, name: str) -> np.ndarray:
        """Return the pixels of a layer; ``photograph`` is the radiance as displayed."""
        if name == "photograph":
            return photograph_picture(self.layers["radiance"], self.capture.exposure)
        return layer_picture(name, self.layers[name], self.capture.exposure)[0]


def examples(dataset: Path) -> dict[str, Example]:
    """Render a scene of each family, where it is not there yet, and open it."""
    return {
        name: Example(render_scene(SceneSpec(family.track, name, SEED), SETTINGS, dataset))
        for name, family in all_families().items()
    }


def strip(example: Example, names: tuple[str, ...]) -> Image.Image:
    """Return pictures of layers side by side, each with its name above."""
    found = [name for name in names if name == "photograph" or name in example.layers]
    sheet = Image.new("RGB", ((SIDE + GAP) * len(found) - GAP, SIDE + TEXT), "white")
    for place, name in enumerate(found):
        x = place * (SIDE + GAP)
        ImageDraw.Draw(sheet).text((x + 2, 1), WORDS.get(name, name), "black", ImageFont.load_default(13))
        sheet.paste(Image.fromarray(example.picture(name)).resize((SIDE, SIDE)), (x, TEXT))
    return sheet


def stacked(sheets: list[Image.Image]) -> Image.Image:
    """Return pictures below each other."""
    whole = Image.new("RGB", (max(s.width for s in sheets), sum(s.height + GAP for s in sheets)), "white")
    y = 0
    for sheet in sheets:
        whole.paste(sheet, (0, y))
        y += sheet.height + GAP
    return whole


def drawn(found: Mapping[str, Example]) -> Iterator[tuple[str, Image.Image]]:
    """Return all pictures of the docs, as pairs (file name, picture)."""
    for name, example in found.items():
        yield f"family-{name}.jpg", strip(example, ("photograph", *STRIP))
    yield "tracks.jpg", stacked([strip(found[name], ("photograph", *STRIP[:3])) for name in SHOWN.values()])
    for layer in all_layers():
        if (shown := _of_layer(layer.name, found)) is not None:
            yield file_of_layer(layer.name), Image.fromarray(shown).resize((SIDE // 2, SIDE // 2))


def file_of_layer(name: str) -> str:
    """Return the file of a layer's picture."""
    return f"layer-{name.replace('<light>', 'light')}.jpg"


def _of_layer(name: str, found: Mapping[str, Example]) -> np.ndarray | None:
    """Return the pixels of a layer, of the scene in which most is to be seen of it."""
    stem = name.removesuffix("<light>")
    shown = [
        (float(np.std(example.picture(own))), example.picture(own))
        for example in (found[family] for family in SHOWN.values())
        for own in example.layers
        if (own == name if stem == name else own.startswith(stem) and "." not in own[len(stem) :])
    ]
    return max(shown, key=lambda pair: pair[0])[1] if shown else None


def main() -> None:
    """Render what is missing and write all pictures."""
    PICTURES.mkdir(exist_ok=True)
    for name, picture in drawn(examples(Path(sys.argv[1]) if sys.argv[1:] else ROOT / "runs" / "pictures")):
        picture.save(PICTURES / name, quality=82, optimize=True)


if __name__ == "__main__":
    main()
