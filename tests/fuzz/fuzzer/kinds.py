# SPDX-License-Identifier: Apache-2.0
"""All kinds of cases, by name."""

from fuzzer.kind import Kind
from fuzzer.kinds_of_data import DATA
from fuzzer.kinds_of_methods import METHODS
from fuzzer.kinds_of_runs import RUNS

KINDS: dict[str, Kind] = {kind.name: kind for kind in (*DATA, *METHODS, *RUNS)}
DEAR = tuple(
    name
    for name in KINDS
    if name.startswith("decomposition:") and name.split()[1] not in ("gray", "retinex", "2dgs")
)
"""Kinds whose corpus takes long to make: the tests that run everywhere leave them out."""
