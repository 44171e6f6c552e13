# SPDX-License-Identifier: Apache-2.0
"""Change files that nobody needs to understand: bytes, and lines of words."""

from pathlib import Path
from random import Random

from fuzzer.hostile import hostile_text

_WORDS = (
    b"\0",
    b"\xff",
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\0\0\0\x80",
    b"\xff" * 8,
    b"\0" * 64,
    b"\r\n",
)


def attack_bytes(rng: Random, path: Path) -> str:
    """Change, cut, double or fill some bytes of a file."""
    data = bytearray(path.read_bytes())
    name = rng.choice(
        ("flip", "flip", "word", "insert", "delete", "cut", "double", "fill", "shuffle", "empty")
    )
    at = rng.randrange(len(data)) if data else 0
    if len(data) and rng.random() < 0.5:
        at = rng.randrange(min(len(data), 512))  # headers are where decisions are made
    length = min(rng.choice((1, 2, 4, 8, 64, 1000)), len(data) - at)
    match name:
        case "flip" if data:
            data[at] ^= 1 << rng.randrange(8)
        case "word" | "insert":
            word = rng.choice(_WORDS)
            data[at : at + (len(word) if name == "word" else 0)] = word
        case "delete":
            del data[at : at + length]
        case "cut":
            del data[at:]
        case "double":
            data[at:at] = data[at : at + length] * rng.choice((1, 2, 1000))
        case "fill":
            data[at : at + length] = bytes([rng.choice((0, 1, 127, 128, 255))]) * length
        case "shuffle":
            part = list(data[at : at + length])
            rng.shuffle(part)
            data[at : at + length] = bytes(part)
        case "empty" if rng.random() < 0.2:
            data = bytearray()
    path.write_bytes(bytes(data))
    return f"{name} bytes of {path.name} at {at}"


def attack_lines(rng: Random, path: Path) -> str:
    """Change a word, or whole lines, of a file of text, of its first lines above all."""
    lines = path.read_bytes().decode("latin-1").split("\n")
    at = rng.randrange(min(len(lines), rng.choice((8, 40, 10_000))))
    name = rng.choice(("word", "word", "word", "more", "fewer", "delete", "double", "swap", "cut", "long"))
    words = lines[at].split(" ")
    which = rng.randrange(len(words))
    text = hostile_text(rng).encode(errors="replace").decode("latin-1")
    match name:
        case "word":
            words[which] = text
        case "more":
            words.insert(which, text)
        case "fewer":
            del words[which]
        case "long":
            words[which] *= 1000
    lines[at] = " ".join(words)
    other = rng.randrange(len(lines))
    match name:
        case "delete":
            del lines[at]
        case "double":
            lines[at:at] = [lines[at]] * rng.choice((1, 2, 1000))
        case "swap":
            lines[at], lines[other] = lines[other], lines[at]
        case "cut":
            del lines[at:]
    path.write_bytes("\n".join(lines).encode("latin-1"))
    return f"{name} in line {at + 1} of {path.name}"
