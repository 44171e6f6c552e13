# SPDX-License-Identifier: Apache-2.0
"""Write the skeleton of a method: a package with tests, CI and a card, or one file."""

import keyword
import re
import sys
from importlib.util import find_spec
from pathlib import Path

from graycard import GraycardError, OutputError
from graycard.io import atomic_folder, check_name, inside, output_error, write_bytes
from graycard.methods import offers

_TEMPLATE = Path(__file__).parent / "template"
_FORM = re.compile(r"[a-z][a-z0-9]*([_-][a-z0-9]+)*")
_LONGEST = 40
_PACKAGE = {
    "pyproject.toml": "pyproject.toml.txt",
    "README.md": "README.md.txt",
    "suite.toml": "suite.toml.txt",
    ".gitignore": "gitignore.txt",
    ".github/workflows/ci.yml": "ci.yml.txt",
    "src/demo_method/__init__.py": "init.py.txt",
    "src/demo_method/_method.py": "method.py.txt",
    "tests/test_demo_method.py": "test.py.txt",
}
"""Files of a package by their path, with the template of each."""
_ONE_FILE = ("method.py.txt", "one_file_test.py.txt")


def new_method(name: str, folder: Path, *, one_file: bool = False) -> Path:
    """Write the skeleton of a method.

    Args:
        name: Of the method, as ``my_method``: lower-case words joined by ``_`` or ``-``.
        folder: Where to: a folder of that name, or a file, is made there.
        one_file: Whether to write one file in place of a package.

    Returns:
        What was made.

    Raises:
        GraycardError: The name is none for a method or a module, or is taken.
        OutputError: Something of this name is there, or the folder cannot be written to.
    """
    check_form(name)
    package = name.replace("-", "_")
    made = inside(folder, f"{package}.py" if one_file else name)
    if made.exists() or made.is_symlink():
        raise OutputError(f"expected {made} to be free, got something there. Choose another name or --out")
    check_free(name)
    if one_file:
        text = "".join(_filled(template, name) for template in _ONE_FILE)
        write_bytes(made, text.encode())
        return made
    with atomic_folder(made) as whole:
        for path, template in _PACKAGE.items():
            target = whole / _renamed(path, name)
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_text(_filled(template, name), encoding="utf-8")
            except OSError as cause:
                raise output_error(target, cause) from cause
    return made


def class_of(name: str) -> str:
    """Return the class of a method: ``sun-fade`` is SunFadeMethod."""
    words = re.split("[_-]", name)
    return "".join(word.capitalize() for word in words) + ("" if words[-1] == "method" else "Method")


def check_form(name: str) -> None:
    """Refuse a name that a method, its package and its class cannot have.

    Raises:
        GraycardError: It is one.
    """
    package = name.replace("-", "_")
    if not _FORM.fullmatch(name) or len(name) > _LONGEST:
        raise GraycardError(
            f"expected a name of lower-case words and digits joined by _ or -, as my_method, of {_LONGEST} "
            f"characters at most, got {name!r}. Choose another"
        )
    try:
        check_name(package)
    except ValueError as cause:
        raise GraycardError(f"{cause}. Choose another") from None
    if keyword.iskeyword(package) or keyword.issoftkeyword(package):
        raise GraycardError(f"expected a name that is no word of Python, got {name!r}. Choose another")


def check_free(name: str) -> None:
    """Refuse a name that a method or a module has.

    Raises:
        GraycardError: It is taken.
    """
    package = name.replace("-", "_")
    if {name, package} & {*offers()}:
        raise GraycardError(f"expected a name that no method has, got {name!r}. Choose another")
    if package in sys.stdlib_module_names or find_spec(package) is not None:
        raise GraycardError(
            f"expected a name that no module has, got {name!r}, which can be imported here. Choose another"
        )


def _filled(template: str, name: str) -> str:
    return _renamed((_TEMPLATE / template).read_text(encoding="utf-8"), name)


def _renamed(text: str, name: str) -> str:
    """Return a text of the template with names of the method in the place of its own."""
    words = {
        "demo_method": name.replace("-", "_"),
        "demo-method": name.replace("_", "-"),
        "DemoMethod": class_of(name),
    }
    return re.sub("|".join(words), lambda found: words[found[0]], text)
