"""Lists in words, and names from files as text that can be shown."""

from __future__ import annotations

from collections.abc import Iterable

#: Signs that nothing shows, though they count as letters or marks: two names that differ in them look alike.
_UNSEEN = {0x034F, 0x115F, 0x1160, 0x17B4, 0x17B5, 0x2800, 0x3164, 0xFFA0}
_UNSEEN |= {*range(0x180B, 0x1810), *range(0xFE00, 0xFE10), *range(0xE0100, 0xE01F0)}


class _Shown(dict[int, str]):
    """Code point -> what is shown of it; filled as signs are met."""

    def __missing__(self, code: int) -> str:
        sign = chr(code)
        self[code] = sign if sign.isprintable() and code not in _UNSEEN else " "
        return self[code]


_SHOWN, _SHOWN_LINES = _Shown(), _Shown({ord("\n"): "\n"})


def printable(text: str, *, lines: bool = False) -> str:
    """A text with a space for what steers a terminal or the direction of writing, is not seen, or no XML can hold.

    Args:
        lines: Whether line breaks stay.
    """
    if text.isascii() and (text.replace("\n", "") if lines else text).isprintable():
        return text
    return text.translate(_SHOWN_LINES if lines else _SHOWN)


def first_few(things: Iterable[str], most: int, between: str = ", ") -> str:
    """The first things, and how many more there are: ``a, b and 3 more``, of clauses ``a; b; and 3 more``."""
    named = list(things)
    rest = len(named) - most
    return between.join(named[:most]) + (f"{between.rstrip(', ')} and {rest} more" if rest > 0 else "")
