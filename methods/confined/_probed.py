# SPDX-License-Identifier: Apache-2.0
"""A method whose contract is checked, seen from the process that asks."""

from collections.abc import Iterable
from pathlib import Path

from graycard.methods._contract import Decomposition
from graycard.methods.confined._client import ConfinedMethod
from graycard.methods.confined._probe import Fact

PROBE = "graycard.methods.confined:serve_probe"
"""Function that its process runs."""


class ProbedMethod(ConfinedMethod):
    """A method that is asked as for a fit, and for facts besides."""

    def watch(self, *, stops: bool = False) -> None:
        """Forget the facts so far.

        Args:
            stops: Whether the first call of progress in the next fit is told to stop, as by Ctrl-C.
        """
        self.ask("watch", {"stops": stops, "scratch": str(self.scratch)})

    def facts(self) -> list[Fact]:
        """Return what was seen since :meth:`watch`."""
        told = self.ask("facts", {}).data
        with self.as_asked():
            return [Fact(str(kind), str(what), float(number)) for kind, what, number in told]

    def restored(self, folder: Path) -> Decomposition:
        """Load a decomposition that was saved.

        Raises:
            MethodError: The method cannot.
        """
        return self.decomposition(self.ask("restore", {"method": self.name, "folder": str(folder)}).data)


def of_kind(facts: Iterable[Fact], kind: str) -> list[Fact]:
    """Return the facts of one kind."""
    return [fact for fact in facts if fact.kind == kind]
