# SPDX-License-Identifier: Apache-2.0
"""The script of a page: small, of checked types, and without what a policy forbids."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from graycard.reports._templates import SCRIPTS, TEMPLATES, page_script

TSC = shutil.which("tsc")


def test_script_is_small_and_makes_no_code_of_text() -> None:
    script = page_script()
    assert len(script) < 60_000
    assert not re.search(r"\beval\(|new Function|document\.write|fetch\(|XMLHttpRequest|https?:", script)
    assert script.count("innerHTML") == 1, "parts of the page itself, which templates have escaped"


@pytest.mark.skipif(TSC is None, reason="no tsc on this machine: npm install -g typescript")
def test_types_of_the_script_are_right(tmp_path: Path) -> None:
    options = {
        "allowJs": True, "checkJs": True, "noEmit": True, "strict": True, "target": "ES2022",
        "lib": ["ES2022", "DOM", "DOM.Iterable"], "types": [],
    }  # fmt: skip
    files = [str(TEMPLATES / name) for name in SCRIPTS]
    (tmp_path / "tsconfig.json").write_text(json.dumps({"compilerOptions": options, "files": files}))
    assert TSC is not None
    found = subprocess.run([TSC, "-p", str(tmp_path)], capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout
