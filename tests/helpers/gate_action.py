# SPDX-License-Identifier: Apache-2.0
"""Run the steps of .github/actions/gate by hand, as GitHub runs them, in a clean folder.

    python tests/helpers/gate_action.py FOLDER [TRACK ...]

It makes a repository with a method of thirty lines in FOLDER, and passes three changes of it through the
action, on some tracks or all: one without a baseline, one that changes nothing, and one that makes the method
worse.
"""

import os
import re
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]
ACTION = ROOT / ".github" / "actions" / "gate"
METHOD = """
import numpy as np
from graycard.methods import NoSettings

ALBEDO = 0.3

class Fitted:
    provides = frozenset({"base_color", "radiance"})
    def __init__(self, light): self.light = light
    def render(self, camera, layers):
        shape = (camera.height, camera.width, 3)
        values = {"base_color": ALBEDO, "radiance": self.light}
        return {name: np.full(shape, values[name], np.float32) for name in layers}
    def lights(self): return None
    def save(self, folder): (folder / "light.txt").write_text(str(self.light))

class Mine:
    summary, needs, settings_type = "One albedo and one light", (), NoSettings
    def fit(self, capture, priors, settings, seed, progress):
        return Fitted(float(np.median([capture.photograph(view) for view in capture.train])))
    def load(self, folder): return Fitted(float((folder / "light.txt").read_text()))
"""
CONTEXTS = {
    "github.event.repository.default_branch": "main", "github.job": "gate", "strategy.job-index": "0",
}  # fmt: skip
_EXPRESSION = re.compile(r"\$\{\{ *([\w.-]+) *\}\}")


@dataclass
class Runner:
    """Stand in for a machine of GitHub's: a checkout, a home with what caches brought, and words of steps."""

    workspace: Path
    home: Path
    inputs: Mapping[str, str]
    python: str = sys.executable
    contexts: Mapping[str, str] = field(default_factory=lambda: dict(CONTEXTS))
    """Values that GitHub gives a job."""
    outputs: dict[str, str] = field(default_factory=dict)
    uses: list[str] = field(default_factory=list)
    """Other actions that steps use; they are not run."""
    log: str = ""
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def summary(self) -> str:
        """Return the summary that steps have written for people."""
        path = self.home / "summary.md"
        return path.read_text() if path.exists() else ""

    @property
    def artifact(self) -> str:
        """Return the name under which the run is kept."""
        (kept,) = (step for step in _action()["runs"]["steps"] if "upload-artifact" in step.get("uses", ""))
        return self._filled(kept["with"]["name"])

    def run(self) -> int:
        """Run all steps; return the exit code of the first that fails."""
        (self.home / "summary.md").unlink(missing_ok=True)
        failed = 0
        for step in _action()["runs"]["steps"]:
            if "uses" in step:
                self.uses.append(step["uses"])
            elif not failed:
                failed = self._step(step)
        return failed

    def _step(self, step: Mapping[str, Any]) -> int:
        told = self.home / "output"
        told.write_text("")
        variables = {name: self._filled(value) for name, value in step.get("env", {}).items()}
        passed = ("PATH", "LANG", "TMPDIR", "SSL_CERT_FILE")
        environment = {name: os.environ[name] for name in passed if name in os.environ}
        environment |= {
            name: value for name, value in os.environ.items() if name.startswith(("PIP_", "OPENBLAS"))
        }
        environment |= {
            "HOME": str(self.home), "PYTHON": self.python, "CI": "true", "GITHUB_ACTIONS": "true",
            "GITHUB_ACTION_PATH": str(ACTION), "GITHUB_OUTPUT": str(told), "GITHUB_REF_NAME": "main",
            "GITHUB_STEP_SUMMARY": str(self.home / "summary.md"),
        }  # fmt: skip
        clock = time.perf_counter()
        shell = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]
        done = subprocess.run(
            shell,
            cwd=self.workspace,
            env=environment | variables,
            capture_output=True,
            text=True,
            check=False,
        )
        self.seconds[step["name"]] = round(time.perf_counter() - clock, 1)
        self.log += f"== {step['name']}: {done.returncode}\n{done.stdout}{done.stderr}"
        for line in told.read_text().splitlines():
            name, _, value = line.partition("=")
            self.outputs[f"steps.{step.get('id', '')}.outputs.{name}"] = value
        return done.returncode

    def _filled(self, value: str) -> str:
        return _EXPRESSION.sub(lambda found: self._value(found[1]), value)

    def _value(self, name: str) -> str:
        if name in self.contexts:
            return self.contexts[name]
        if name.startswith("inputs."):
            default = str(_action()["inputs"][name.removeprefix("inputs.")]["default"])
            return self.inputs.get(name.removeprefix("inputs."), self._filled(default))
        return self.outputs[name]


def _action() -> Any:
    return yaml.safe_load((ACTION / "action.yml").read_text())


def make_repository(folder: Path) -> Path:
    """Make a repository with a method, and return a checkout of it."""
    origin, checkout = folder / "origin.git", folder / "checkout"
    git(folder, "init", "--quiet", "--bare", "--initial-branch", "main", str(origin))
    git(folder, "clone", "--quiet", str(origin), str(checkout))
    (checkout / "mine.py").write_text(METHOD)
    commit(checkout, "Add a method")
    return checkout


def commit(checkout: Path, words: str) -> None:
    """Commit all changes of a checkout, and push them."""
    git(checkout, "add", "--all")
    who = ("-c", "user.name=x", "-c", "user.email=x@localhost")
    git(checkout, *who, "commit", "--quiet", "-m", words)
    git(checkout, "push", "--quiet", "origin", "HEAD:main")


def git(folder: Path, *words: str) -> str:
    """Return what git prints in a folder."""
    return subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True).stdout


def main() -> int:
    """Pass three changes through the action, and say what each step took."""
    folder = Path(sys.argv[1]).absolute()
    (folder / "home").mkdir(parents=True, exist_ok=True)
    checkout = make_repository(folder)
    (checkout / ".git" / "info" / "exclude").write_text("graycard-gate\n__pycache__\n")
    inputs = {
        "method": "mine:Mine", "torch-index": "", "history-branch": "graycard-history",
        "tracks": " ".join(sys.argv[2:]),
    }  # fmt: skip

    def passed_through() -> int:
        runner = Runner(checkout, folder / "home", inputs)
        code = runner.run()
        cpu = resource.getrusage(resource.RUSAGE_CHILDREN)
        took = f"wall {runner.seconds}, CPU so far {cpu.ru_utime + cpu.ru_stime:.0f} s"
        sys.stdout.write(f"{runner.log}\n{runner.summary}\nexit {code}, {took}\n")
        return code

    first = passed_through()
    shutil.copy(checkout / "graycard-gate" / "baseline.json", checkout / "graycard-baseline.json")
    commit(checkout, "Add the baseline")
    same = passed_through()
    (checkout / "mine.py").write_text(METHOD.replace("ALBEDO = 0.3", "ALBEDO = 0.9"))
    commit(checkout, "Make it worse")
    worse = passed_through()
    heads = git(checkout, "ls-remote", "--heads", "origin")
    sys.stdout.write(f"{heads}gate_action: without a baseline {first}, unchanged {same}, worse {worse}\n")
    return 0 if (first, same, worse) == (0, 0, 1) else 1


if __name__ == "__main__":
    sys.exit(main())
