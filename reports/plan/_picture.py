# SPDX-License-Identifier: Apache-2.0
"""The plan of a scene as pixels."""

from PIL import Image, ImageDraw, ImageFont

from graycard.reports.plan._plan import LightMark, Plan

FINE = 2
"""Drawn this many times larger and then reduced: Pillow draws without smoothing."""
PAPER, INK, DOT = (250, 250, 248), (40, 40, 40), (175, 175, 170)
TRAIN, TEST = (40, 100, 200), (225, 120, 20)
LAMP, EDGE = (255, 205, 40), (215, 160, 0)


def plan_picture(plan: Plan) -> Image.Image:
    """Draw a plan: surfaces gray, cameras blue (training) and orange (held out), lights yellow with name."""
    image = Image.new("RGB", (round(plan.width) * FINE, round(plan.height) * FINE), PAPER)
    draw = ImageDraw.Draw(image)
    for x, y in plan.dots:
        _disc(draw, x, y, 1.0, DOT)
    for points in plan.outlines:
        draw.polygon(_corners(points), outline=EDGE, width=2 * FINE)
    for camera in plan.cameras:
        draw.polygon(_corners(camera.points), fill=TRAIN if camera.split == "train" else TEST, outline=INK)
    for light in plan.lights:
        _disc(draw, light.x, light.y, 5.0, LAMP)
    for light in {_name(light): light for light in plan.lights}.values():
        _label(draw, light, plan.width)
    _metre_bar(draw, plan)
    return image.resize((round(plan.width), round(plan.height)), Image.Resampling.BOX)


def _disc(draw: ImageDraw.ImageDraw, x: float, y: float, radius: float, colour: tuple[int, int, int]) -> None:
    box = [(x - radius) * FINE, (y - radius) * FINE, (x + radius) * FINE, (y + radius) * FINE]
    draw.ellipse(box, fill=colour, outline=INK if radius > 2 else None)


def _label(draw: ImageDraw.ImageDraw, light: LightMark, width: float) -> None:
    right = light.x < 0.7 * width
    place = (light.x + (8 if right else -8)) * FINE, light.y * FINE
    draw.text(
        place, _name(light), fill=INK, font=ImageFont.load_default(13 * FINE), anchor="lm" if right else "rm"
    )


def _metre_bar(draw: ImageDraw.ImageDraw, plan: Plan) -> None:
    y, left = (plan.height - 8) * FINE, 8 * FINE
    draw.line([left, y, left + plan.metre_bar * FINE, y], fill=INK, width=2 * FINE)
    font = ImageFont.load_default(12 * FINE)
    draw.text((left + (plan.metre_bar + 5) * FINE, y), plan.metre_text, fill=INK, font=font, anchor="lm")


def _name(light: LightMark) -> str:
    return light.label.partition(": ")[2]


def _corners(points: str) -> list[tuple[float, float]]:
    """Corners of an SVG polygon, in drawn pixels."""
    pairs = (pair.split(",") for pair in points.split())
    return [(float(x) * FINE, float(y) * FINE) for x, y in pairs]
