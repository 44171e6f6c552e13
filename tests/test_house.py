# SPDX-License-Identifier: Apache-2.0
"""The shape of the house: no circles, private modules stay private, small files, folders and functions."""

import ast
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path
from statistics import median, quantiles

import pytest

from graycard.records import RUN_FILE
from house import Module, door_of, functions_of, imports_of, modules

MAX_LINES = 400
MAX_MODULES = 20
MAX_PARAMETERS = 8
MAX_OF_A_KERNEL = 10
"""Numba passes arrays and tuples by position; a named tuple counts as one."""


def _is_private(name: str) -> bool:
    return any(part.startswith("_") for part in name.split("."))


def _trespasses(module: Module) -> list[str]:
    """Imports of private modules past the door of the package that speaks for them."""
    return [
        f"{module.path}:{found.line} imports {found.target} past {door}"
        for found in imports_of(module.name)
        if _is_private(found.target)
        for door in [door_of(found.target.rpartition(".")[0])]
        if module.package != door and not module.package.startswith(f"{door}.")
    ]


def test_private_modules_stay_private():
    assert not [line for module in modules().values() for line in _trespasses(module)]


def test_imports_form_no_circle():
    graph = {
        name: {found.target for found in imports_of(name) if found.target in modules()} - {name}
        for name in modules()
    }
    TopologicalSorter(graph).prepare()  # raises CycleError and names the circle


def test_no_import_takes_another_name_for_the_package():
    """One import style: ``from graycard import X``; ``gc`` is a standard module."""
    aliases = [
        f"{module.path}:{number}"
        for module in modules().values()
        for number, line in enumerate(module.path.read_text(encoding="utf-8").splitlines(), 1)
        if line.strip().startswith("import graycard as")
    ]
    assert not aliases


def test_the_record_of_a_run_is_named_once():
    """Code takes ``RUN_FILE``; sentences may name the file."""
    named = [
        str(module.path)
        for module in modules().values()
        for line in module.path.read_text(encoding="utf-8").splitlines()
        if f'"{RUN_FILE}"' in line
    ]
    assert [name.rpartition("/")[2] for name in named] == ["_run.py"]


def test_files_are_short():
    assert not {str(m.path): m.lines for m in modules().values() if m.lines > MAX_LINES}


def test_folders_hold_few_modules():
    counts = Counter(module.path.parent for module in modules().values())
    assert not {str(folder): count for folder, count in counts.items() if count > MAX_MODULES}


def _too_many(module: Module, kernel: bool, most: int) -> list[str]:
    """Functions that take more parameters than ``most``, of kernels or of all else."""
    return [
        f"{module.path}:{function.line} {function.name} takes {function.parameters}"
        for function in functions_of(module)
        if function.kernel is kernel and function.parameters > most
    ]


@pytest.mark.parametrize(("kernel", "most"), [(False, MAX_PARAMETERS), (True, MAX_OF_A_KERNEL)])
def test_functions_take_few_parameters(kernel: bool, most: int):
    assert not [line for module in modules().values() for line in _too_many(module, kernel, most)]


@pytest.mark.parametrize(
    ("decorator", "count", "found"),
    [("", 8, []), ("", 9, ["f takes 9"]), ("@njit(**X)\n", 10, []), ("@njit(**X)\n", 11, ["f takes 11"])],
)
def test_too_many_parameters_are_found(decorator: str, count: int, found: list[str]):
    names = ", ".join(f"a{n}" for n in range(count))
    source = f"{decorator}def f({names}): ..."
    module = Module("graycard.f", Path("f.py"), ast.parse(source), 1)
    limits = (False, MAX_PARAMETERS), (True, MAX_OF_A_KERNEL)
    lines = [line for kernel, most in limits for line in _too_many(module, kernel, most)]
    assert [line.partition(" ")[2] for line in lines] == found


def test_functions_are_short():
    lengths = [function.length for module in modules().values() for function in functions_of(module)]
    assert median(lengths) <= 10
    assert quantiles(lengths, n=10)[-1] <= 20
