# SPDX-License-Identifier: Apache-2.0
"""Parts that all pages share: templates that escape all that comes from a record, style, script, and the
policy.
"""

import base64
import hashlib
import json
import re
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from graycard.reports._facts import setting_text
from graycard.reports._format import format_name, format_number
from graycard.reports.parts._islands import key_of
from graycard.reports.pictures._colour_maps import COLOUR_MAPS, colour_map
from graycard.reports.pictures._pictures import gradient

TEMPLATES = Path(__file__).parent / "templates"
SCRIPTS = ("report.js", "tables.js", "errors.js", "viewer.js")
"""In the order in which a page has them."""
_TYPES = re.compile(r"[ \t]*/\*\*.*?\*/[ \t]*\n?", re.DOTALL)


def page_style() -> str:
    """Return the style of a page with pictures, the bars of colour maps among it."""
    return asset("report.css") + "".join(
        f".bar.{name} {{ background: {gradient(name)}; }}\n" for name in COLOUR_MAPS
    )


def page_script() -> str:
    """Return the script of a page with pictures, without the comments that are for its types."""
    return _TYPES.sub("", "".join(map(asset, SCRIPTS)))


def map_island() -> str:
    """Return the colours of all maps as JSON."""
    return json.dumps({name: colour_map(name).tolist() for name in COLOUR_MAPS}, separators=(",", ":"))


def content_policy(style: str, script: str) -> str:
    """Return a content security policy under which only this style, this script and data: images work.

    Whatever escaped the escaping could still not run, and no browser asks any host for anything.
    """
    return (
        f"default-src 'none'; img-src data:; style-src '{_digest(style)}'; script-src '{_digest(script)}'; "
        "base-uri 'none'; form-action 'none'"
    )


def environment() -> Environment:
    """Return what templates are rendered by: strict, and all that comes from a record is escaped."""
    found = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters["words"] = format_name
    found.filters["number"] = format_number
    found.filters["key"] = key_of
    found.filters["knob"] = setting_text
    return found


def asset(name: str) -> str:
    """Return the text of a style sheet or script that comes along."""
    return "\n" + (TEMPLATES / name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
