# SPDX-License-Identifier: Apache-2.0
"""A contact sheet a scene: photographs, true layers, and the plan of cameras and lights, in one PNG."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont, ImageOps

from graycard import Capture, DatasetError, Progress, Truth, View, capture_folders, open_capture, open_truth
from graycard.dataset import SECRET_SEEDS
from graycard.exchange import write_png
from graycard.io import silent
from graycard.reports.pictures._layer_pictures import layer_picture, outline, photograph_picture
from graycard.reports.plan._picture import plan_picture
from graycard.reports.plan._plan import LightRow, lay_out, surface_points

COLUMNS = 6
CELL = 224
"""Width of a picture in pixels; a smaller one is enlarged by a whole factor."""
GAP, TEXT = 10, 14
PAPER, INK = (250, 250, 248), (30, 30, 30)
MAX_PHOTOGRAPHS = 12
MAX_VIEWS = 2
"""Views whose truth is shown, the first with all its layers."""
_GROUPS = (
    (
        "truth in brief",
        ("radiance", "counterfactual.radiance", "base_color", "normal", "depth", "object_id", "shading"),
    ),
    (
        "surfaces",
        (
            "albedo",
            "diffuse_reflectance",
            "f0",
            "roughness",
            "alpha",
            "metallic",
            "position",
            "distance",
            "pure",
        ),
    ),
    ("what the target does", ("effect.",)),
    ("light that arrives", ("visibility.", "direct.irradiance.", "irradiance.")),
    ("light that leaves, by source, bounce and lobe", ("emitted", "direct.", "indirect.")),
)
"""Layers by what they tell; a stem that ends in a dot stands for all names that hold it."""
NO_TRUTH = "There is no truth beside this capture."
LEGEND = (
    "blue: cameras of photographs; orange: held-out cameras",
    "yellow: lights; gray: surfaces that the views above see",
    "in the pictures, magenta: border of the target, or values that are not finite",
    "",
)


@dataclass(frozen=True, slots=True)
class Cell:
    """One picture with its caption."""

    pixels: np.ndarray
    """Shape ``(H, W, 3)``, uint8."""
    caption: str


def write_contact_sheets(dataset: Path, out: Path, progress: Progress = silent) -> list[Path]:
    """Write ``OUT/<track>-<scene>.png`` for each whole scene of a dataset, also for captures without truth.

    Raises:
        DatasetError: There is no whole scene, or a file of one is missing or broken.
        OutputError: The folder cannot be written to, or the disk is full.
    """
    folders = capture_folders(dataset)
    if not folders:
        raise DatasetError(
            f"expected a dataset with <track>/<scene>/capture at {dataset}, got no whole scene there. "
            "Run `graycard render` or `graycard import`"
        )
    written = []
    for number, folder in enumerate(folders):
        progress(number / len(folders), folder.name)
        written.append(Path(out) / f"{folder.parent.name}-{folder.name}.png")
        write_png(written[-1], contact_sheet(folder))
    return written


def contact_sheet(scene: Path) -> np.ndarray:
    """Return the contact sheet of one scene, ``DATASET/<track>/<scene>``, shape ``(H, W, 3)``, uint8, sRGB.

    Raises:
        DatasetError: A file is missing or broken.
    """
    capture = open_capture(scene / "capture", check=False)
    truth = open_truth(scene / "truth", check=False) if (scene / "truth").exists() else None
    parts = [_heading(_title(capture, truth), 22), _grid(_photographs(capture))]
    shown = _shown_views(truth) if truth else ()
    layers = {view.name: truth.layers(view) for view in shown} if truth else {}
    for number, view in enumerate(shown):
        for title, cells in _layer_groups(layers[view.name], capture.exposure, brief=number > 0):
            parts += [_heading(f"{view.name}: {title}", 18), _grid(cells)]
    if truth:
        parts += _changed(truth, shown, capture.exposure)
    lights = truth.lights() if truth else ()
    surfaces = [surface_points(view, layers[view.name].get("depth")) for view in shown]
    plan = lay_out(capture.views, surfaces, [("", 0, lights)])
    notes = [*LEGEND, *(_light_lines(plan.rows) if truth else [NO_TRUTH])]
    parts += [_heading("plan from above, y up", 18), _beside(plan_picture(plan), notes)]
    return np.asarray(ImageOps.expand(_stack(parts), 2 * GAP, PAPER))


def _title(capture: Capture, truth: Truth | None) -> str:
    camera = capture.views[0].camera
    ceiling = truth.noise_ceiling if truth else None
    return (
        f"{capture.track}/{capture.scene}:  {len(capture.train)} photographs, {len(capture.test)} held-out "
        f"views, {camera.width} x {camera.height} pixels, exposure {capture.exposure:.3g}"
        + ("" if ceiling is None else f", noise ceiling {ceiling:.1f} dB")
    )


def _photographs(capture: Capture) -> list[Cell]:
    """Return some photographs, evenly spread; the target is outlined where its mask is granted."""
    return [Cell(_photograph(capture, view), view.name) for view in _spread(capture.train, MAX_PHOTOGRAPHS)]


def _photograph(capture: Capture, view: View) -> np.ndarray:
    pixels = photograph_picture(capture.photograph(view), capture.exposure)
    return pixels if capture.target is None else outline(pixels, capture.target_mask(view))


def _shown_views(truth: Truth) -> list[View]:
    test = [view for view in truth.views if view.split == "test"]
    return _spread(test or truth.views, MAX_VIEWS)


def _spread(views: Sequence[View], count: int) -> list[View]:
    """Return so many views, the first and the last among them."""
    indices = np.linspace(0, len(views) - 1, min(count, len(views))).round().astype(int)
    return [views[i] for i in indices]


def _layer_groups(
    layers: Mapping[str, np.ndarray], exposure: float, brief: bool
) -> Iterator[tuple[str, list[Cell]]]:
    """Yield the layers by what they tell, each group with its title.

    Of a view in brief the first group only.
    """
    left = sorted(layers)
    groups: dict[str, list[str]] = {}
    for title, stems in _GROUPS:
        meant = (n for stem in stems for n in left if n == stem or (stem[-1] == "." and stem in n))
        groups[title] = list(dict.fromkeys(meant))
        left = [name for name in left if name not in groups[title]]
    groups["all else"] = left
    for title, names in list(groups.items())[: 1 if brief else None]:
        if names:
            yield title, [Cell(*layer_picture(name, layers[name], exposure)) for name in names]


def _changed(truth: Truth, views: Sequence[View], exposure: float) -> list[Image.Image]:
    """Return a held-out view under changed lights and with an object put in, where the truth has such
    pictures.
    """
    view = next((view for view in views if view.split == "test"), None)
    if view is None:
        return []
    pictures = {edit.name: truth.relit(edit.name, view)["radiance"] for edit in truth.edits}
    composition = truth.composition()
    if composition is not None:
        donor = composition.donor
        seed = "secret" if donor.seed in SECRET_SEEDS else f"{donor.seed:04d}"
        name = f"{donor.object} of {donor.family}-{seed}"
        pictures[name] = truth.composed(view)["radiance"]
    if not pictures:
        return []
    cells = [Cell(layer_picture("radiance", p, exposure)[0], name) for name, p in pictures.items()]
    return [_heading(f"{view.name} under other lights, and with an object put in", 18), _grid(cells)]


def _light_lines(rows: Sequence[LightRow]) -> list[str]:
    lines = [f"{row.name}: {row.kind}" for row in rows]
    facts = [f"    position {row.position} (m), intensity {row.intensity} W/sr" for row in rows]
    ends = [
        fact if row.kind != "environment" else "    all around" for fact, row in zip(facts, rows, strict=True)
    ]
    return [line for pair in zip(lines, ends, strict=True) for line in pair]


def _fit(pixels: np.ndarray) -> Image.Image:
    """Return a picture no wider than a cell: enlarged by a whole factor, or averaged down."""
    image = Image.fromarray(pixels)
    if image.width <= CELL:
        factor = CELL // image.width
        return image.resize((image.width * factor, image.height * factor), Image.Resampling.NEAREST)
    height = max(1, round(image.height * CELL / image.width))
    return image.resize((CELL, height), Image.Resampling.BOX)


def _grid(cells: Sequence[Cell]) -> Image.Image:
    rows = [cells[i : i + COLUMNS] for i in range(0, len(cells), COLUMNS)]
    return _stack([_row(row) for row in rows])


def _row(cells: Sequence[Cell]) -> Image.Image:
    pictures = [_fit(cell.pixels) for cell in cells]
    height = max(picture.height for picture in pictures) + TEXT + 8
    row = Image.new("RGB", (COLUMNS * (CELL + GAP) - GAP, height), PAPER)
    draw = ImageDraw.Draw(row)
    for column, (cell, picture) in enumerate(zip(cells, pictures, strict=True)):
        x = column * (CELL + GAP)
        draw.text((x, 2), _plain(cell.caption), fill=INK, font=_font_that_fits(draw, _plain(cell.caption)))
        row.paste(picture, (x, TEXT + 8))
    return row


def _font_that_fits(draw: ImageDraw.ImageDraw, text: str) -> "ImageFont.FreeTypeFont | ImageFont.ImageFont":
    """Return the largest font, of ordinary size at most, in which a caption is no wider than its picture."""
    width = draw.textlength(text, ImageFont.load_default(TEXT))
    return ImageFont.load_default(TEXT * min(1.0, CELL / max(width, 1)))


def _heading(text: str, size: int) -> Image.Image:
    image = Image.new("RGB", (COLUMNS * (CELL + GAP) - GAP, size + 12), PAPER)
    ImageDraw.Draw(image).text((0, 6), text, fill=INK, font=ImageFont.load_default(size))
    return image


def _beside(picture: Image.Image, lines: Sequence[str]) -> Image.Image:
    """Return a picture with lines of text to its right."""
    line = TEXT + 6
    height = max(picture.height, line * len(lines))
    image = Image.new("RGB", (COLUMNS * (CELL + GAP) - GAP, height), PAPER)
    image.paste(picture, (0, 0))
    draw = ImageDraw.Draw(image)
    for number, text in enumerate(lines):
        place = picture.width + 2 * GAP, number * line
        draw.text(place, _plain(text), fill=INK, font=ImageFont.load_default(TEXT))
    return image


def _plain(text: str) -> str:
    """Text with a minus that the font has."""
    return text.replace("−", "-")


def _stack(images: Sequence[Image.Image]) -> Image.Image:
    width = max(image.width for image in images)
    height = sum(image.height + GAP for image in images) - GAP
    page = Image.new("RGB", (width, height), PAPER)
    y = 0
    for image in images:
        page.paste(image, (0, y))
        y += image.height + GAP
    return page
