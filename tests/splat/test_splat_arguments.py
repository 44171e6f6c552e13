# SPDX-License-Identifier: Apache-2.0
"""Functions of the engine take few arguments: arrays that go together are a named tuple."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from graycard.methods import splat

KERNEL, OTHER = 10, 8
"""Arguments at most of what Numba compiles, and of all else."""
COMPILED = ("njit", "overload", "_instruction")
"""Decorators of what Numba compiles."""
TO_DO = {
    "raster/_backward.py": [
        "visit: 19",
        "pair_gradient: 19",
        "fetch_later: 14",
        "tile_gradient: 27",
        "gradient_part: 24",
    ],
    "raster/_blocks_read.py": ["read_tile: 13"],
    "raster/_forward.py": ["weigh: 13", "sum_group: 11", "sum_batch: 14", "draw_tile: 23", "draw_part: 17"],
}
"""Kernels that still take more, none of which may take one more: Numba leaves out what is None where it is an
argument, and not where it lies in a tuple."""


def too_many(source: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            decorators = [ast.unparse(one) for one in node.decorator_list]
            compiled = any(one.startswith(COMPILED) for one in decorators)
            given = node.args
            count = len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs)
            if count > (KERNEL if compiled else OTHER):
                yield f"{node.name}: {count}"


def test_functions_take_few_arguments():
    folder = Path(splat.__file__).parent
    found = {str(one.relative_to(folder)): list(too_many(one.read_text())) for one in folder.rglob("*.py")}
    assert {name: functions for name, functions in found.items() if functions} == TO_DO


@pytest.mark.parametrize(
    ("decorator", "count", "found"),
    [("", 8, []), ("", 9, ["f: 9"]), ("@njit(**X)\n", 10, []), ("@njit(**X)\n", 11, ["f: 11"])],
)
def test_too_many_are_found(decorator: str, count: int, found: list[str]):
    names = ", ".join(f"a{n}" for n in range(count))
    assert list(too_many(f"{decorator}def f({names}): ...")) == found
