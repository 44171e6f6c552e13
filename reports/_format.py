# SPDX-License-Identifier: Apache-2.0
"""Numbers as a reader wants them: as many digits as the unit deserves, the same in a whole column."""

import math
from collections.abc import Iterable
from datetime import datetime

_DECIMALS = {"dB": 2, "1": 3, "°": 2, "stops": 2, "m": 3}
_DEFAULT_DECIMALS = 2


def format_value(value: float, unit: str) -> str:
    """Return a score as text, with the decimals of its unit, so that a column of one unit aligns.

    Examples:
        >>> format_value(31.456, "dB"), format_value(math.inf, "dB"), format_value(-0.5, "1")
        ('31.46', '∞', '−0.500')
    """
    if math.isnan(value):
        return "nan"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if unit == "count":
        return f"{value:.0f}" if value.is_integer() else f"{value:.1f}"
    return f"{value:.{_DECIMALS.get(unit, _DEFAULT_DECIMALS)}f}".replace("-", "−")


def format_with_unit(value: float, unit: str) -> str:
    """Return a score with its unit, which a ratio is joined to and a pure number lacks.

    Example:
        >>> format_with_unit(31.456, "dB"), format_with_unit(2.0, "×"), format_with_unit(0.5, "1")
        ('31.46 dB', '2.00×', '0.500')
    """
    text = format_value(value, unit)
    return text if unit in ("", "1") else f"{text}×" if unit == "×" else f"{text} {unit}"


def format_number(value: float) -> str:
    """Return a number of any size with three significant digits.

    Examples:
        >>> format_number(0.012345), format_number(-4.0)
        ('0.0123', '−4')
    """
    return f"{value:.3g}".replace("-", "−") if math.isfinite(value) else format_value(value, "")


def format_p(p: float) -> str:
    """Return a p value with as many digits as a reader uses.

    Examples:
        >>> format_p(0.0234), format_p(0.00012)
        ('p = 0.023', 'p < 0.001')
    """
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}" if p < 0.1 else f"p = {p:.2f}"


def format_vector(values: Iterable[float]) -> str:
    """Numbers side by side, as in ``1.2, 0.5, −3``."""
    return ", ".join(format_number(float(v)) for v in values)


def format_seconds(seconds: float) -> str:
    """Return a duration in the unit that fits.

    Examples:
        >>> format_seconds(4.2), format_seconds(75), format_seconds(3700)
        ('4.2 s', '1 min 15 s', '1 h 1 min')
    """
    if not math.isfinite(seconds):
        return f"{seconds} s"
    if seconds < 1:
        return f"{seconds:.2f} s"
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def format_date(moment: str) -> str:
    """Return an ISO 8601 time as ``21 November 2026, 09:47 UTC``; anything else as it is."""
    try:
        found = datetime.fromisoformat(moment)
    except ValueError:
        return moment
    zone = f" {found.tzname()}" if found.tzinfo else ""
    return f"{found.day} {found:%B %Y, %H:%M}{zone}"


def format_name(name: str) -> str:
    """Return an identifier as words, as in ``novel_view`` to ``Novel view``."""
    words = name.replace("_", " ").replace(".", " ")
    return words[:1].upper() + words[1:]


def count(number: int, noun: str) -> str:
    """Return a number with its noun, as in ``1 scene`` and ``2 scenes``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
