# SPDX-License-Identifier: Apache-2.0
"""Parts of the light that follow from other parts by addition."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

PARTS = ("direct.diffuse", "direct.specular", "indirect.diffuse", "indirect.specular")
"""Parts of the light of each source; ``<part>.<light>``."""
LOBES = ("diffuse", "specular")
"""Parts of the light of a surface; each is the sum of its direct and its indirect part."""
_NO_LIGHT = frozenset({"var", "half_a", "half_b"})
"""Last parts of a name that say how well a layer is known."""


def with_sums(layers: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Layers, and those that follow from the parts of each light.

    ``direct.diffuse`` (and each other part) is the sum of ``direct.diffuse.<light>`` over the lights,
    ``radiance.<light>`` the sum of the four parts of a light, and ``diffuse`` (and ``specular``) that of
    ``direct.diffuse`` and ``indirect.diffuse``: light adds up. What is there already stays, and parts of
    unequal size are not added.

    Args:
        layers: By name, each ``(H, W)`` or ``(H, W, 3)``.

    Examples:
        >>> import numpy as np
        >>> sorted(with_sums({"direct.diffuse.a": np.ones(1), "direct.diffuse.b": np.ones(1)}))
        ['direct.diffuse', 'direct.diffuse.a', 'direct.diffuse.b']
    """
    names = {part: lights_of(part, layers) for part in PARTS}
    sums = {part: [f"{part}.{light}" for light in lights] for part, lights in names.items()}
    whole = set.intersection(*(set(lights) for lights in names.values()))
    sums |= {f"radiance.{light}": [f"{part}.{light}" for part in PARTS] for light in sorted(whole)}
    lobes = {lobe: [f"direct.{lobe}", f"indirect.{lobe}"] for lobe in LOBES}
    return _added(_added(layers, sums), lobes)


def _added(layers: Mapping[str, np.ndarray], sums: Mapping[str, Sequence[str]]) -> dict[str, np.ndarray]:
    """Layers, and the sums of those that are all there, of one size and not themselves there."""
    found = dict(layers)
    for name, shares in sums.items():
        there = [layers[share] for share in shares if share in layers]
        whole = bool(there) and len(there) == len(shares)
        if whole and name not in layers and len({values.shape for values in there}) == 1:
            found[name] = sum(there[1:], start=there[0])
    return found


def lights_of(part: str, layers: Iterable[str]) -> list[str]:
    """Names of the lights that have a layer ``<part>.<light>`` among these names.

    Examples:
        >>> lights_of("radiance", ["radiance", "radiance.var", "radiance.lamp"])
        ['lamp']
    """
    stems = (name.rpartition(".") for name in layers)
    return [light for stem, _, light in stems if stem == part and light not in _NO_LIGHT]
