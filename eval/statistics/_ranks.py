# SPDX-License-Identifier: Apache-2.0
"""Groups of methods that cannot be told from the best of their group."""

from collections.abc import Callable, Sequence


def rank_groups(ordered: Sequence[str], better: Callable[[str, str], bool]) -> dict[str, int]:
    """Return the group of each method, 1 for the best.

    The best method leads a group of all that it cannot be told from. They are taken away; the best of the
    rest leads the next group. "Cannot be told apart" is no equivalence: of three methods the first may be
    told from the third alone, and then the second shares the group of the first.

    Args:
        ordered: Methods, the best mean first.
        better: Whether the first is told to be better than the second.

    Examples:
        >>> rank_groups(["a", "b", "c"], lambda first, second: (first, second) == ("a", "c"))
        {'a': 1, 'b': 1, 'c': 2}
    """
    found: dict[str, int] = {}
    rest, group = list(ordered), 0
    while rest:
        group += 1
        leader = rest[0]
        found |= {method: group for method in rest if not better(leader, method)}
        rest = [method for method in rest if method not in found]
    return found
