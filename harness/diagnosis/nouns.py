"""Nouns for what differs, and lists and counts of them."""

from __future__ import annotations

from collections.abc import Sequence

from screwgauge.diagnosis.properties import word

#: Event -> what differs, where that is not its own name.
_NOUNS = {
    "axis": "place of the axis",
    "base": "joints of the base",
    "branch": "subtree",
    "coupling": "coupling",
    "end": "place of an end",
    "fixed": "freedom",
    "held": "freedom",
    "kind": "kind of joint",
    "link": "joint",
    "sign": "direction of the coordinate",
    "start": "start",
    "whole": "place and units of the whole",
}


def noun(what: str) -> str:
    """Name what differs."""
    return _NOUNS.get(what) or word(what)


def other(side: str) -> str:
    """Name the other side."""
    return "B" if side == "A" else "A"


def listed(nouns: Sequence[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return " and ".join(filter(None, (", ".join(nouns[:-1]), nouns[-1])))


def counted(n: int, one: str, several: str = "") -> str:
    """``1 joint``, ``2 joints``."""
    return f"{n} {one if n == 1 else several or f'{one}s'}"
