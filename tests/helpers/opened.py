# SPDX-License-Identifier: Apache-2.0
"""A page as it is once everything in it was opened."""

import re

from graycard.reports.parts._islands import unpack

PART = re.compile(r'<script type="application/octet-stream" data-part="([^"]*)">([^<]*)</script>\n?')
ISLAND = re.compile(r'<script type="application/[a-z-]*" (?:data-[a-z]+|id)="[^"]*">[^<]*</script>\n?')
CLOSED = re.compile(
    r'(<details class="part[^"]*" id="([^"]*)" data-part><summary>.*?</summary>)(</details>)', re.DOTALL
)


def parts_of(page: str) -> dict[str, str]:
    """Return the HTML of each part by its id."""
    return {found[1]: unpack(found[2]) for found in PART.finditer(page)}


def opened(page: str) -> str:
    """Return the page with each part in its place, claims one after the other, and without data."""
    parts = parts_of(page)
    shell = ISLAND.sub("", page)

    def put(html: str) -> str:
        return CLOSED.sub(lambda found: found[1] + put(parts[found[2]]) + found[3], html)

    claims = "".join(put(html) for name, html in parts.items() if name.startswith("claim-"))
    return put(shell).replace("Show all claims</a></p></div>", f"Show all claims</a></p>{claims}</div>")
