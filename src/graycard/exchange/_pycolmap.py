# SPDX-License-Identifier: Apache-2.0
"""The optional library pycolmap, or how to get it."""

from typing import Any

from graycard._errors import GraycardError

INSTALL = "pip install 'graycard[cameras]'"


def import_pycolmap(why: str) -> Any:
    """Return the module.

    Args:
        why: What needs it, for the message.

    Raises:
        GraycardError: It is not installed.
    """
    try:
        import pycolmap
    except ImportError as cause:
        raise GraycardError(f"expected pycolmap for {why}, got none. Run `{INSTALL}`") from cause
    return pycolmap
