# SPDX-License-Identifier: Apache-2.0
"""Name and version of the rules by which score sheets are made."""

NAME, VERSION = "graycard", 1
PROTOCOL = f"{NAME}-{VERSION}"
"""Name and version in scores; a change to any of the rules is a new version."""
