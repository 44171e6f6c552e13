# SPDX-License-Identifier: Apache-2.0
"""Relative exposures of photographs from EXIF: time, f-number and ISO."""

import math
from collections.abc import Sequence

from graycard.exchange.pictures._pixels import Exposure, Note

_ALIKE = 1.02
"""Ratio up to which exposures are one: cameras round their times."""


def relative_exposures(exposures: Sequence[Exposure | None]) -> tuple[list[float] | None, Note | None]:
    """Return the exposure of each photograph, 1 in the geometric mean, and what is said of them.

    Exposure is time × ISO / f-number². Where not all photographs tell ISO or the f-number, it is left out.

    Returns:
        None where some photograph tells no time, or all are exposed alike; and a note, if EXIF told any.
    """
    told = [e for e in exposures if e is not None]
    if not told:
        return None, None
    if len(told) < len(exposures):
        missing = len(exposures) - len(told)
        said = f"EXIF tells no exposure time in {missing} of {len(exposures)}: all are taken as exposed alike"
        return None, Note("exposure", said, warns=_ratio([_value(e, _terms(told)) for e in told]) > _ALIKE)
    terms = _terms(told)
    values = [_value(e, terms) for e in told]
    if (ratio := _ratio(values)) <= _ALIKE:
        return None, Note("exposure", "EXIF tells the same exposure for all")
    centre = _mean(values)
    named = ", ".join(["time", *(_NAMES[term] for term in terms)])
    said = f"EXIF exposures ({named}) differ up to {ratio:.3g} times: light is divided by them"
    return [v / centre for v in values], Note("exposure", said)


def exposures_beside(
    exposures: Sequence[Exposure | None], others: Sequence[Exposure | None]
) -> tuple[list[float], int]:
    """Return the exposures of photographs relative to the geometric mean of others.

    Args:
        exposures: Of the photographs, which have no say in what counts.
        others: Where some of these tell no time, exposures are all 1.

    Returns:
        Exposures, 1 where one is not told or nearly 1; and the number of those that are not told.
    """
    told = [e for e in others if e is not None]
    if not told or len(told) < len(others):
        return [1.0] * len(exposures), 0
    terms = _terms(told)
    centre = _mean([_value(e, terms) for e in told])
    known = [e is not None and all(getattr(e, term) is not None for term in terms) for e in exposures]
    found = [
        _value(e, terms) / centre if e and told else 1.0 for e, told in zip(exposures, known, strict=True)
    ]
    alike = relative_exposures(others)[0] is None
    found = [1.0 if alike and 1 / _ALIKE <= f <= _ALIKE else f for f in found]
    return found, len(known) - sum(known)


_NAMES = {"iso": "ISO", "f_number": "f-number"}


def _terms(told: Sequence[Exposure]) -> list[str]:
    """Return what counts beside time: what all tell."""
    return [name for name in _NAMES if all(getattr(e, name) is not None for e in told)]


def _value(exposure: Exposure, terms: Sequence[str]) -> float:
    iso = exposure.iso if "iso" in terms else None
    aperture = exposure.f_number if "f_number" in terms else None
    return exposure.seconds * (iso or 1) / (aperture or 1) ** 2


def _mean(values: Sequence[float]) -> float:
    """Return the geometric mean."""
    return math.exp(sum(math.log(v) for v in values) / len(values))


def _ratio(values: Sequence[float]) -> float:
    return max(values) / min(values)
