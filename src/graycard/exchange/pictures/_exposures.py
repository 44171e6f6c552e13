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
        return None, Note("exposure", said, warns=_ratio(_values(told)) > _ALIKE)
    values = _values(told)
    if (ratio := _ratio(values)) <= _ALIKE:
        return None, Note("exposure", "EXIF tells the same exposure for all")
    centre = math.exp(sum(math.log(v) for v in values) / len(values))
    terms = ["time", *["ISO"] * _all_tell(told, "iso"), *["f-number"] * _all_tell(told, "f_number")]
    said = f"EXIF exposures ({', '.join(terms)}) differ up to {ratio:.3g} times: light is divided by them"
    return [v / centre for v in values], Note("exposure", said)


def _values(told: Sequence[Exposure]) -> list[float]:
    iso, aperture = _all_tell(told, "iso"), _all_tell(told, "f_number")
    return [
        e.seconds * (e.iso or 1 if iso else 1) / ((e.f_number or 1) ** 2 if aperture else 1) for e in told
    ]


def _all_tell(told: Sequence[Exposure], name: str) -> bool:
    return all(getattr(e, name) is not None for e in told)


def _ratio(values: Sequence[float]) -> float:
    return max(values) / min(values)
