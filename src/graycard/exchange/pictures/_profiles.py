# SPDX-License-Identifier: Apache-2.0
"""Meaning of stored colours, by ICC profiles, chunks of PNG, or chromaticities.

An ICC profile is told by what it does: littleCMS brings a lattice of colours through it to sRGB, and the
result is held against each encoding that is known. So names and versions of a profile play no part.
"""

from functools import cache, lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageCms

from graycard._errors import DatasetError
from graycard.colour import srgb_decode, srgb_encode
from graycard.exchange.pictures._pixels import Encoding, Note
from graycard.io import DISPLAY_P3, REC709, are_rec709, name_primaries

ENCODINGS = {"sRGB": Encoding(), "Display P3": Encoding(primaries=DISPLAY_P3)}
_STEPS = 9
_LEVELS = 2
"""Levels of 255 by which a known encoding may differ: tables of profiles are rounded."""
_CONVERT = "Convert it to sRGB in a program that knows profiles"


@lru_cache(maxsize=16)  # photographs of a folder have one profile
def find_profile(data: bytes) -> tuple[str, str]:
    """Return the name of an encoding, empty where none is met, and what an ICC profile calls itself.

    Raises:
        DatasetError: It is no profile.
    """
    try:
        profile = ImageCms.ImageCmsProfile(BytesIO(data))
        core: Any = profile.profile
        title = str(core.profile_description or "without a name").strip()
        space = core.xcolor_space.strip()
        if space not in ("RGB", "GRAY"):
            return "", title
        given, mode = _lattice(space)
        shown = ImageCms.applyTransform(Image.fromarray(given, mode), _to_srgb(profile, mode))
    except (ImageCms.PyCMSError, OSError, ValueError, TypeError, AttributeError) as cause:
        raise DatasetError(f"expected an ICC profile, got one that is damaged: {cause}") from cause
    came = np.asarray(shown).astype(int)
    for name, encoding in ENCODINGS.items():
        expected = given[..., None] if space == "GRAY" else _as_srgb(given, encoding)
        if np.abs(came - expected).max() <= _LEVELS:
            return name, title
    return "", title


def by_profile(data: bytes, path: Path) -> tuple[Encoding, Note]:
    """Return what an ICC profile says.

    Raises:
        DatasetError: The profile is damaged, or none of those that are converted.
    """
    try:
        name, title = find_profile(data)
    except DatasetError as cause:
        raise DatasetError(f"{cause}, in {path}. Save the picture with another profile") from cause
    if not name:
        raise DatasetError(
            f"expected a picture of sRGB or Display P3 at {path}, got the colour profile "
            f"{title!r}. {_CONVERT}"
        )
    return ENCODINGS[name], profile_note(ENCODINGS[name], f"ICC profile of {name}")


def by_chunks(chunks: dict[bytes, bytes], path: Path) -> tuple[Encoding, Note] | None:
    """Return what chunks of a PNG other than an ICC profile say; None where they say nothing.

    cICP goes first, then sRGB, then gAMA and cHRM (PNG, third edition, 4.3).

    Raises:
        DatasetError: cICP names an encoding that is not converted.
    """
    if len(code := chunks.get(b"cICP", b"")) >= 2:
        return _by_code_points((code[0], code[1]), path)
    if b"sRGB" in chunks:
        return ENCODINGS["sRGB"], profile_note(ENCODINGS["sRGB"], "chunk sRGB")
    gamma, primaries = _numbers(chunks.get(b"gAMA", b""), 1), _numbers(chunks.get(b"cHRM", b""), 8)
    if gamma is None and primaries is None:
        return None
    curve = None
    if gamma is not None and abs(gamma[0] - 0.45455) > 0.005:  # 1/2.2 stands for the sRGB curve
        if gamma[0] <= 0:
            raise DatasetError(f"expected a gamma above 0 in {path}, got {gamma[0]}. {_CONVERT}")
        curve = 1 / gamma[0]
    order = (2, 3, 4, 5, 6, 7, 0, 1)  # cHRM begins with white
    found = REC709 if primaries is None else tuple(primaries[i] for i in order)
    encoding = Encoding(curve, REC709 if are_rec709(found) else found)
    names = [n for n, v in (("gAMA", gamma), ("cHRM", primaries)) if v is not None]
    return encoding, profile_note(
        encoding, f"chunks {' and '.join(names)}" if len(names) > 1 else f"chunk {names[0]}"
    )


def profile_note(encoding: Encoding, source: str) -> Note:
    """Return what is said of an encoding: where it stands, and whether colours are converted."""
    curve = {None: "", 1.0: ", linear"}.get(
        encoding.curve, f", power {encoding.curve:.4g}" if encoding.curve else ""
    )
    primaries = name_primaries(encoding.primaries)
    done = "" if are_rec709(encoding.primaries) else f": {primaries} converted to linear Rec.709"
    return Note("profile", f"{source}{curve}{done}")


@lru_cache(maxsize=16)
def to_rec709(primaries: tuple[float, ...]) -> np.ndarray:
    """Return the matrix from linear colours of other primaries to linear Rec.709, shape ``(3, 3)``.

    White stays white: where the white points differ, they are adapted (Bradford).

    Raises:
        ValueError: The primaries span no colour space.
    """
    from colour import RGB_Colourspace, matrix_RGB_to_RGB

    points = np.array(primaries, dtype=np.float64)
    if points.shape != (8,) or not np.isfinite(points).all() or points[7] <= 0:
        raise ValueError(f"expected chromaticities of four colours, got {primaries}")
    try:
        given, wanted = (
            RGB_Colourspace(name, np.reshape(xy[:6], (3, 2)), np.array(xy[6:]))
            for name, xy in (("given", points), ("Rec.709", np.array(REC709)))
        )
        matrix = np.asarray(matrix_RGB_to_RGB(given, wanted, "Bradford"))
    except np.linalg.LinAlgError:
        matrix = np.full((3, 3), np.nan)
    if not np.isfinite(matrix).all() or np.abs(matrix).max() > 1e3:
        raise ValueError(f"expected chromaticities that span a colour space, got {primaries}")
    return matrix


def _by_code_points(code: tuple[int, int], path: Path) -> tuple[Encoding, Note]:
    """Return what the code points of ITU-T H.273 for primaries and transfer say."""
    primaries = {1: REC709, 12: DISPLAY_P3}.get(code[0])
    curves = {13: None, 8: 1.0}
    if primaries is None or code[1] not in curves:
        raise DatasetError(
            f"expected a picture of sRGB or Display P3 at {path}, got the cICP code points {code[0]} and "
            f"{code[1]}. {_CONVERT}"
        )
    encoding = Encoding(curves[code[1]], primaries)
    return encoding, profile_note(encoding, "chunk cICP")


def _numbers(data: bytes, count: int) -> list[float] | None:
    """Return fixed-point numbers of a chunk; None where it does not hold so many."""
    return [x / 100000 for x in np.frombuffer(data, ">u4").tolist()] if len(data) == 4 * count else None


def _lattice(space: str) -> tuple[np.ndarray, str]:
    if space == "GRAY":
        return np.arange(256, dtype=np.uint8)[None], "L"
    steps = np.rint(np.linspace(0, 255, _STEPS)).astype(np.uint8)
    greys = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    colours = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.concatenate([greys, colours])[None], "RGB"


def _to_srgb(profile: ImageCms.ImageCmsProfile, mode: str) -> ImageCms.ImageCmsTransform:
    return ImageCms.buildTransform(
        profile, _srgb(), mode, "RGB", ImageCms.Intent.RELATIVE_COLORIMETRIC, ImageCms.Flags.NOOPTIMIZE
    )


@cache
def _srgb() -> ImageCms.ImageCmsProfile:
    return ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB"))


def _as_srgb(given: np.ndarray, encoding: Encoding) -> np.ndarray:
    light = srgb_decode(given / 255) @ to_rec709(encoding.primaries).T
    return np.rint(255 * srgb_encode(light)).astype(int)
