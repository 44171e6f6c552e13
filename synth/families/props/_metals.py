# SPDX-License-Identifier: Apache-2.0
"""Metals by their measured, complex refractive indices."""

from graycard.synth._scene import Conductor

_INDICES = {
    "aluminium": ((1.65750, 0.880405, 0.521244), (9.22381, 6.26950, 4.83700)),
    "copper": ((0.201005, 0.923750, 1.10222), (3.91326, 2.45305, 2.14209)),
    "gold": ((0.143036, 0.375307, 1.44205), (3.98300, 2.38556, 1.60336)),
}
"""``eta`` and ``k`` as linear Rec.709. Source: the measured spectra "Al", "Cu" and "Au" of the luxpop.com
database that Mitsuba 3.9.1 comes with, as it turns them into colours."""

METALS = tuple(_INDICES)


def conductor(metal: str, roughness: float) -> Conductor:
    """One of the :data:`METALS`, polished or brushed.

    Args:
        metal: Its name.
        roughness: Square root of the GGX alpha.

    Raises:
        ValueError: The metal is not known.
    """
    if metal not in _INDICES:
        raise ValueError(f"expected a metal of {', '.join(METALS)}, got {metal!r}")
    return Conductor(*_INDICES[metal], roughness)
