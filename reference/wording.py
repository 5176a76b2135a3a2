"""Lists in words."""

from __future__ import annotations

from collections.abc import Iterable


def first_few(things: Iterable[str], most: int, between: str = ", ") -> str:
    """The first things, and how many more there are: ``a, b and 3 more``, of clauses ``a; b; and 3 more``."""
    named = list(things)
    rest = len(named) - most
    return between.join(named[:most]) + (f"{between.rstrip(', ')} and {rest} more" if rest > 0 else "")
