# SPDX-License-Identifier: Apache-2.0
"""Numbers, texts and containers of strangers that readers do not expect."""

from random import Random

OUTSIDE = "/tmp/graycard-fuzz-outside"
"""An absolute path that no case may write to."""


class Raw(str):
    """Text that is written as it stands, in JSON and in TOML."""

    __slots__ = ()


NUMBERS: tuple[object, ...] = (
    Raw("1" + "0" * 400),
    Raw("-" + "9" * 400),
    Raw("0." + "3" * 400),
    Raw("1e999"),
    Raw("-1e999"),
    Raw("NaN"),
    Raw("Infinity"),
    Raw("-Infinity"),
    Raw("nan"),
    Raw("inf"),
    Raw("-inf"),
    Raw("-0.0"),
    Raw("0x10"),
    Raw("1_000"),
    0,
    1,
    -1,
    2,
    3,
    255,
    256,
    2**31 - 1,
    2**31,
    2**32,
    2**53 + 1,
    2**63 - 1,
    2**63,
    2**64 - 1,
    2**64,
    -(2**63),
    100_000,
    10**7,
    10**9,
    0.5,
    -0.5,
    1e-300,
    5e-324,
    1e30,
    1e200,
    1.7e308,
    -1.7e308,
    "inf",
    "-inf",
    "nan",
    "1",
    True,
    False,
)
TEXTS: tuple[str, ...] = (
    "",
    " ",
    ".",
    "..",
    "../x",
    "../../../../outside/pwn",
    OUTSIDE,
    "a/../../b",
    "a//b",
    "/",
    "./x",
    "C:\\x",
    "a\\..\\b",
    "con",
    "NUL.exr",
    "com1.x",
    "a.partial",
    "x\x1b[2J\x1b]0;owned\x07",
    "\u202egpj.exe",
    "\u2066x\u2069",
    "\u200bx",
    "a\0b",
    "a\nb",
    "a\r\nb",
    "\x7f",
    "\x9b2J",
    "x" * 300,
    "ü" * 200,
    "x" * 100_000,
    " a",
    "a ",
    "a.",
    ".a",
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "{{7*7}}",
    "[bold red]x[/]",
    "%s%n",
    "💥",
    "ſ",
    "İ",
    "-rf",
    "--help",
    "~/.bashrc",
    "$HOME",
    "module:attribute",
    "os:system",
    "gray",
    "truth",
    "radiance",
    "dark",
    "TEST_001",
    "train_000",
    "e\u0301",
    "é",
    Raw('"\\ud800"'),
    Raw('"\\udc00x"'),
    Raw('"\\u0000"'),
)
CONTAINERS: tuple[object, ...] = (
    None,
    [],
    {},
    [[]],
    [None],
    [{}],
    {"": None},
    {"a": {}},
    [0] * 3,
    ["x"] * 3,
    [[1, 0], [0, 1]],
    [[1.0] * 4] * 4,
    Raw("[" * 150 + "]" * 150),
    Raw("[" * 100_000),
    Raw("[" * 3000 + "]" * 3000),
    Raw('{"a":' * 3000 + "1" + "}" * 3000),
    Raw('{"a": 1, "a": 2}'),
    Raw("[1, 2"),
    Raw("[0," * 1000 + "0" + "]" * 1000),
    Raw("1979-05-27T07:32:00Z"),
)


def hostile_value(rng: Random) -> object:
    """Return a number, a text or a container that is seldom expected."""
    return rng.choice(rng.choice((NUMBERS, NUMBERS, TEXTS, TEXTS, CONTAINERS)))


def hostile_text(rng: Random) -> str:
    """Return a text for files of plain text: no quotes around it."""
    return str(rng.choice(rng.choice((NUMBERS, TEXTS)))).strip('"')
