# SPDX-License-Identifier: Apache-2.0
"""Rows of a suite that vary one budget of a method at a time."""

from collections.abc import Mapping
from typing import Any

from graycard import RecordError

KEY = "sweep"


def swept(data: Mapping[str, Any], path: str) -> dict[str, Any]:
    """Return the data of a suite file with a row for each value that a method's ``sweep`` names.

    ``sweep = { iterations = [500, 1000], surfels = [2500] }`` adds the rows ``NAME-iterations-500`` and so
    on. Each changes that one setting of the method. The method's own row stays, and a value that it has
    already is passed over.

    Args:
        data: A suite as TOML has it.
        path: Of the file, for messages.

    Raises:
        RecordError: A sweep is no table of lists with numbers, or a swept setting is not among the settings.
    """
    methods = data.get("methods", [])
    if not isinstance(methods, list) or not all(isinstance(method, Mapping) for method in methods):
        return dict(data)  # refused where suites are read
    return {**data, "methods": [row for method in methods for row in _rows(method, path)]}


def _rows(method: Mapping[str, Any], path: str) -> list[dict[str, Any]]:
    own = {key: value for key, value in method.items() if key != KEY}
    sweep, settings = method.get(KEY, {}), own.get("settings", {})
    if not isinstance(sweep, Mapping) or not all(_is_list_of_numbers(values) for values in sweep.values()):
        raise RecordError(
            f"expected sweep = {{ iterations = [500, 1000] }} for {own.get('name')} in {path}, got {sweep!r}"
        )
    if missing := [name for name in sweep if name not in settings]:
        raise RecordError(
            f"expected settings of {own.get('name')} in {path} to name what its sweep varies, got none for "
            f"{', '.join(missing)}. Add the value that the other rows keep"
        )
    label = own.get("label") or own.get("name")
    varied = [(name, value) for name, values in sweep.items() for value in values if value != settings[name]]
    return [own] + [
        {**own, "label": f"{label}-{name}-{value}", "settings": {**settings, name: value}}
        for name, value in varied
    ]


def _is_list_of_numbers(values: Any) -> bool:
    return isinstance(values, list) and all(type(value) in (int, float) for value in values)
