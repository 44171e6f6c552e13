# SPDX-License-Identifier: Apache-2.0
"""The verb that makes predictions of what other code wrote."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from graycard._errors import GraycardError
from graycard.cli._options import Json, optional
from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json

if TYPE_CHECKING:
    from graycard.adoption import Adopted
    from graycard.eval import Hint


@dataclass(frozen=True)
class AdoptCommand:
    """Make a predictions folder of what other code wrote: PNG, TIFF, EXR, NPY or NPZ."""

    folder: Annotated[Path | None, tyro.conf.Positional, optional("FOLDER")] = None
    """The folder that the other code wrote."""
    scene: Annotated[Path | None, tyro.conf.Positional, optional("SCENE")] = None
    """DATASET/<track>/<scene> that was predicted."""
    out: Annotated[Path | None, optional("PREDICTIONS")] = None
    """Write the predictions to this folder; predictions that it holds are replaced."""
    map: Annotated[tuple[str, ...], optional("LAYER=PATTERN:WORD ...")] = ()
    """Places and conventions of layers, as base_color=albedo/{view}.png:srgb or
    depth=depth.npz:key=depth:distance; --layouts lists the words. {index:05d} and {split} number the files,
    * stands for what is the same in all, and a name without {view} or {index} for a file of all views."""
    layout: Annotated[str | None, optional("NAME")] = None
    """The folder is that of published code."""
    layouts: bool = False
    """List the known layouts and the words of --map."""
    views: Annotated[Literal["all", "train", "test"] | None, optional("all|train|test")] = None
    """Views that were predicted; all by default, or those of the layout."""
    order: Annotated[str, tyro.conf.arg(metavar="capture|name|FILE")] = "capture"
    """Order by which {index} counts views: that of capture.json, by name, or a file with a name a line."""
    star: Annotated[str | None, optional("TEXT")] = None
    """Text that stands for * in patterns; by default the one name that fits."""
    method: Annotated[str | None, optional("NAME")] = None
    """Name of the method in scores; the name of FOLDER by default."""
    json: Json = None
    """Also write what was adopted, and the hints, to this file."""

    def run(self, terminal: Terminal, rest: list[str]) -> int:
        """Adopt, then look for conventions that were declared wrongly."""
        from graycard.adoption import adopt, find_layout, request_of
        from graycard.dataset import check_scene
        from graycard.eval import find_hints

        if self.layouts:
            return _list_layouts(terminal, self.json)
        if self.folder is None or self.scene is None or self.out is None:
            raise GraycardError("expected FOLDER, SCENE and --out PREDICTIONS, got fewer. Name all three")
        check_scene(self.scene)
        request = request_of(
            self.folder,
            self.scene,
            self.map,
            find_layout(self.layout) if self.layout else None,
            views=self.views or "",
            order=self.order,
            star=self.star or "",
            method=self.method or "",
        )
        with terminal.progress(f"adopting {self.folder}") as progress:
            made = adopt(request, self.out, progress)
        hints = _as_written(find_hints(made.predictions, self.scene), made)
        write_optional_json(self.json, {"adopted": made, "hints": hints})
        _show_adopted(terminal, made, hints, self.scene)
        return OK


def _as_written(hints: Sequence[Hint], made: Adopted) -> list[Hint]:
    """Return hints with factors as they are to be written: times those that were declared."""
    from graycard.adoption import parse_map, times_word

    declared = {layer.layer: parse_map(layer.declared) for layer in made.layers}
    return [
        replace(hint, declare=times_word(declared[hint.layer], float(hint.declare.removeprefix("times="))))
        if hint.declare.startswith("times=")
        else hint
        for hint in hints
    ]


def _show_adopted(terminal: Terminal, made: Adopted, hints: Sequence[Hint], scene: Path) -> None:
    table = new_table("layer", "files", "lowest", "highest", "declared")
    for layer in made.layers:
        cells = str(layer.files), f"{layer.lowest:.4g}", f"{layer.highest:.4g}", layer.declared
        table.add_row(layer.layer, *cells)
    terminal.out.print(table)
    for note in made.left_out:
        terminal.say(f"note: {note}")
    for number, hint in enumerate(hints, 1):
        try_ = f"try {hint.declare}" if hint.declare else "no word of --map undoes it: mend the outputs"
        terminal.say(f"hint {number}: {hint.says}", f"of {hint.layer}: {try_}")
    wrong = sum(bool(hint.declare) for hint in hints)
    told = f", {wrong} hint{'s' * (wrong != 1)} of a wrong declaration" if wrong else ""
    terminal.out.print(
        f"adopt: {made.predictions}, {len(made.layers)} layers of {made.views} views{told}; "
        f"score: graycard score {made.predictions} {scene}"
    )


def _list_layouts(terminal: Terminal, json: Path | None) -> int:
    """List the layouts of published code, and the words of --map."""
    from graycard.adoption import LAYOUTS, MEANINGS

    for layout in LAYOUTS.values():
        notes = [f"note: {layout.note}"] if layout.note else []
        views = [] if layout.views == "all" else [f"views: {layout.views}"]
        terminal.say(
            f"{layout.name}: {layout.title}; FOLDER is {layout.folder}",
            *layout.maps, *views, *notes, f"source: {layout.source}",
        )  # fmt: skip
    table = new_table("word of --map", "meaning")
    for word, meaning in MEANINGS.items():
        table.add_row(word, meaning)
    terminal.out.print(table)
    write_optional_json(json, LAYOUTS)
    terminal.out.print(f"adopt: {len(LAYOUTS)} layouts of published code")
    return OK
