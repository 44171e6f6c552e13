# SPDX-License-Identifier: Apache-2.0
"""The verbs that ask how far a run can be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from graycard._screen import Json, Screen, write_optional_json


@dataclass(frozen=True)
class CheckResult:
    """Say whether a run is a valid result: 0 if so, 1 if a rule is broken, 2 if that cannot be judged."""

    run_folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """The run folder, with its scenes where run.json says."""
    rescore: bool = False
    """Also score all predictions again; takes as long as it took the bench."""
    json: Json = None
    """Also write what was found to this file."""

    def run(self, screen: Screen, rest: list[str]) -> int:
        """Look at every rule."""
        from graycard.benchmarks import RULES, check_result

        with screen.progress() as progress:
            found = check_result(self.run_folder, progress, rescore=self.rescore)
        for breach in found.breaches:
            screen.out.print(f"{'unknown' if breach.unknown else 'broken'}: {breach}")
        for rule in dict.fromkeys(breach.rule for breach in found.breaches):
            screen.err.print(f"rule {rule}: {RULES[rule]}")
        write_optional_json(self.json, {"exit_code": found.exit_code, "validity": found})
        broken = sum(not breach.unknown for breach in found.breaches)
        says = {0: "valid", 1: "invalid", 2: "cannot be judged"}
        screen.out.print(
            f"check-result: {says[found.exit_code]} ({found.results} fits by {len(found.rules)} rules, "
            f"{broken} broken, {len(found.breaches) - broken} without evidence)"
        )
        return found.exit_code
