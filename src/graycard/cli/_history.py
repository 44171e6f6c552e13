# SPDX-License-Identifier: Apache-2.0
"""The changes of verdicts that a history tells, in a terminal."""

from pathlib import Path

from graycard.cli._terminal import OK, Terminal, new_table, write_optional_json


def show_history(folder: Path | None, json: Path | None, terminal: Terminal) -> int:
    """Show what a history tells of verdicts that changed; of graycard's own where no folder is named.

    Of a published run it is that of the folder above, with its suite alone.

    Raises:
        RecordError: The folder keeps no history, or a file is damaged.
    """
    from graycard.reports import verdict_changes

    changes = verdict_changes(folder)
    table = new_table("ledger", "claim", "verdict", "because", "why")
    for change in changes:
        moved = change.before if change.before == change.after else f"{change.before} → {change.after}"
        where = f"{change.suite or 'tables'} {change.entry}"
        table.add_row(where, change.claim, moved, ", ".join(change.causes), change.why or "nobody wrote why")
    terminal.out.print(table)
    write_optional_json(json, changes)
    turned = sum(change.before != change.after for change in changes)
    unknown = sum(change.is_open for change in changes)
    terminal.out.print(f"claims: {turned} verdicts changed, {unknown} without a reason")
    return OK
