# SPDX-License-Identifier: Apache-2.0
"""Change pictures: headers and pixels of OpenEXR, PNG and JPEG."""

import struct
import warnings
import zlib
from pathlib import Path
from random import Random

import numpy as np
import OpenEXR
from PIL import Image

from fuzzer.hostile import TEXTS
from fuzzer.plain import attack_bytes

_SIZES = (0, 1, -1, 2, 7, 27, 28, 29, 1000, 30_000, 100_000, 2**31 - 1, -(2**31), 2**30)
_FLOATS = (np.nan, np.inf, -np.inf, 0.0, -0.0, -1.0, 1e38, -1e38, 3.4e38, 1e-38, 1e-45, 65504.0)
_CHANNELS = (
    "R",
    "G",
    "B",
    "A",
    "Y",
    "radiance.R",
    "radiance.X",
    "x.R",
    ".R",
    "R.",
    "..R",
    "depth.Z",
    "normal.X",
)


def attack_exr(rng: Random, path: Path) -> str:
    """Change bytes, attributes of the header, or pixels and channels of an EXR file."""
    attack = rng.choice((attack_bytes, _header, _header, _pixels, _pixels, _channels))
    try:
        return attack(rng, path)
    except (RuntimeError, ValueError, IndexError, struct.error, TypeError):  # changed too much already
        return attack_bytes(rng, path)


def attack_pixels(rng: Random, path: Path) -> str:
    """Change pixels or channels of an EXR file, which stays one."""
    try:
        return rng.choice((_pixels, _pixels, _pixels, _channels))(rng, path)
    except (RuntimeError, ValueError, TypeError):
        return attack_bytes(rng, path)


def _attributes(data: bytes | bytearray) -> dict[str, tuple[int, int]]:
    """Return the place and the size of each attribute of the header, by name and type."""
    found, at = {}, 8
    while data[at]:
        end = data.index(b"\0", at)
        stop = data.index(b"\0", end + 1)
        (size,) = struct.unpack_from("<i", data, stop + 1)
        found[f"{data[at:end].decode('latin-1')} {data[end + 1 : stop].decode('latin-1')}"] = (stop + 5, size)
        at = stop + 5 + size
    return found


def _header(rng: Random, path: Path) -> str:
    data = bytearray(path.read_bytes())
    found = _attributes(data)
    name = rng.choice([*found, "dataWindow box2i", "compression compression", "version", "size", "offsets"])
    if name == "version":
        data[4 + rng.randrange(4)] ^= 1 << rng.randrange(8)
    elif name == "offsets":
        at = max(start + size for start, size in found.values()) + 1 + 8 * rng.randrange(3)
        data[at : at + 8] = struct.pack("<q", rng.choice((0, 1, -1, 2**62, at, len(data), len(data) - 1)))
    elif name == "size":
        start, _ = rng.choice(list(found.values()))
        struct.pack_into("<i", data, start - 4, rng.choice(_SIZES))
    else:
        start, size = found[name]
        kind = name.partition(" ")[2]
        if kind == "box2i":
            struct.pack_into("<i", data, start + 4 * rng.randrange(4), rng.choice(_SIZES))
        elif size:
            data[start + rng.randrange(size)] = rng.choice((0, 1, 2, 3, 4, 8, 9, 10, 127, 128, 255))
    path.write_bytes(bytes(data))
    return f"{name} of {path.name}"


def _read(path: Path) -> dict[str, np.ndarray]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels.copy() for name, channel in file.channels().items()}


def _write(rng: Random, path: Path, channels: dict[str, np.ndarray]) -> None:
    kinds = OpenEXR.NO_COMPRESSION, OpenEXR.ZIP_COMPRESSION, OpenEXR.PIZ_COMPRESSION, OpenEXR.RLE_COMPRESSION
    header = {"compression": rng.choice(kinds), "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name: np.ascontiguousarray(plane) for name, plane in channels.items()}).write(
        str(path)
    )


def _pixels(rng: Random, path: Path) -> str:
    channels = _read(path)
    name = rng.choice(list(channels))
    plane = channels[name]
    what = rng.choice(("one", "all", "some", "some", "noise"))
    if what == "noise":
        bits = np.frombuffer(rng.randbytes(plane.nbytes), np.uint32).reshape(plane.shape)
        channels[name] = bits.view(plane.dtype) if plane.dtype.itemsize == 4 else plane
    else:
        chosen = {"one": slice(0, 1), "all": slice(None), "some": slice(0, None, rng.randrange(2, 9))}[what]
        whole = plane.dtype.kind == "u"
        channels[name].reshape(-1)[chosen] = (
            rng.choice((0, 1, 2**31, 2**32 - 1)) if whole else rng.choice(_FLOATS)
        )
    _write(rng, path, channels)
    return f"{what} pixels of {name} of {path.name}"


def _channels(rng: Random, path: Path) -> str:
    channels = _read(path)
    what = rng.choice(("rename", "rename", "drop", "type", "size", "only", "add"))
    name = rng.choice(list(channels))
    plane = channels.pop(name)
    other = rng.choice((*_CHANNELS, name.lower(), name.rpartition(".")[0], *TEXTS[:20])).split("\0")[0] or "R"
    match what:
        case "rename":
            channels[other[:200]] = plane
        case "type":
            kind = rng.choice((np.float16, np.uint32, np.float32))
            channels[name] = np.zeros(plane.shape, kind) if plane.dtype.kind == "u" else plane.astype(kind)
        case "size":
            height, width = rng.choice(((1, 1), (1, 28), (24, 29), (48, 56), (2, 4), (400, 400)))
            channels = {key: np.resize(p, (height, width)) for key, p in {**channels, name: plane}.items()}
        case "only":
            channels = {name: plane}
        case "add":
            channels |= {name: plane, other[:200]: plane}
    _write(rng, path, channels or {"R": plane})
    return f"{what} a channel ({name}) of {path.name}"


def attack_picture(rng: Random, path: Path) -> str:
    """Change bytes, the size or the mode of a PNG or JPEG file."""
    name = rng.choice(("bytes", "bytes", "size", "size", "mode", "format", "frames", "text"))
    try:
        with warnings.catch_warnings(action="ignore"):
            if name == "size" and path.suffix == ".png":
                return _png_size(rng, path)
            if name in ("mode", "format", "frames", "text"):
                return _other_picture(rng, path, name)
    except (OSError, ValueError, KeyError, SyntaxError, struct.error, Image.DecompressionBombError):
        pass
    return attack_bytes(rng, path)


def _png_size(rng: Random, path: Path) -> str:
    """Change numbers of the header, with the right checksum."""
    data = bytearray(path.read_bytes())
    struct.pack_into(
        ">I", data, 16 + 4 * rng.randrange(2), rng.choice((0, 1, 27, 28, 1000, 60_000, 2**31 - 1, 2**32 - 1))
    )
    if rng.random() < 0.5:
        data[24 + rng.randrange(5)] = rng.choice((0, 1, 2, 3, 4, 6, 8, 16, 255))
    struct.pack_into(">I", data, 29, zlib.crc32(bytes(data[12:29])))
    path.write_bytes(bytes(data))
    return f"the header of {path.name}"


def _other_picture(rng: Random, path: Path, name: str) -> str:
    with Image.open(path) as image:
        image.load()
        mode = rng.choice(
            ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "CMYK", "I", "F", "I;16", "YCbCr", "HSV")
        )
        form = rng.choice(("PNG", "JPEG", "GIF", "TIFF", "BMP", "WEBP", "PPM", "ICO"))
        other = image.convert(mode) if name == "mode" else image.convert("RGB")
        if name == "text":
            from PIL.PngImagePlugin import PngInfo

            info = PngInfo()
            info.add_text("a", "x" * 10**7, zip=True)
            other.save(path, "PNG", pnginfo=info)
        elif name == "frames":
            other.save(path, "PNG", save_all=True, append_images=[other] * 3)
        else:
            other.save(path, form if name == "format" else None)
    return f"{name} of {path.name}"
