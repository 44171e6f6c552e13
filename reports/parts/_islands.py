# SPDX-License-Identifier: Apache-2.0
"""HTML and pictures that lie in a page as data, until its script is asked for them."""

import base64
import hashlib
import json
import zlib
from collections.abc import Iterator
from typing import Any

from graycard.reports.pictures._pictures import PagePicture

WEBP = "webp"
"""Field of a picture in JSON; there it holds the key of its bytes."""


def pack(text: str) -> str:
    """Return a text deflated, in base64: safe inside a script element whatever it holds."""
    return base64.b64encode(zlib.compress(text.encode(), 9)).decode()


def unpack(packed: str) -> str:
    """Return the text of :func:`pack`.

    Raises:
        ValueError: It is not packed so, or damaged.
    """
    try:
        return zlib.decompress(base64.b64decode(packed, validate=True)).decode()
    except zlib.error as cause:
        raise ValueError(f"expected deflated text, got {cause}") from cause


def key_of(picture: PagePicture) -> str:
    """Return the name of a picture's bytes in its page: pictures that are equal have one."""
    return _key(picture.webp)


def without_bytes(data: Any) -> tuple[Any, dict[str, str]]:
    """Return JSON data with a key in the place of each picture's bytes, and the bytes by key."""
    found: dict[str, str] = {}

    def strip(part: Any) -> Any:
        if isinstance(part, dict):
            if isinstance(webp := part.get(WEBP), str):
                found[key := _key(webp)] = webp
                return part | {WEBP: key}
            return {name: strip(value) for name, value in part.items()}
        return [strip(value) for value in part] if isinstance(part, list | tuple) else part

    return strip(data), found


def with_bytes(data: Any, blobs: dict[str, str]) -> Any:
    """Return what :func:`without_bytes` was given.

    Raises:
        KeyError: The bytes of a picture are missing.
    """
    if isinstance(data, dict):
        own = {WEBP: blobs[data[WEBP]]} if WEBP in data else {}
        return {name: with_bytes(value, blobs) for name, value in data.items() if name != WEBP} | own
    return [with_bytes(value, blobs) for value in data] if isinstance(data, list) else data


def blob_island(blobs: dict[str, str]) -> str:
    """Return bytes by key as JSON; base64 and keys have no letter that ends a script element."""
    return json.dumps(dict(_plain(blobs)), separators=(",", ":"))


def _plain(blobs: dict[str, str]) -> Iterator[tuple[str, str]]:
    for key, blob in blobs.items():
        if "<" in key or "<" in blob:
            raise ValueError("expected base64, got another text")
        yield key, blob


def _key(webp: str) -> str:
    return hashlib.sha256(webp.encode()).hexdigest()[:12]
