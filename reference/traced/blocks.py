"""Memory of arrays whose columns lie side by side: fresh, or lent again once nothing refers to it any more."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any

import numpy as np

from screwgauge.reference.rotations import Array

#: Numbers in a line of the cache.
LINE = 8
#: Bytes that a `Pool` keeps for answers to come; larger answers get theirs from the operating system every time.
KEPT = 1 << 26


def columns(n: int, m: int) -> Array:
    """An array of shape (n, m) in which the numbers of one column lie side by side.

    Columns begin with a line of the cache, and not a whole number of pages apart: these would share the same few lines.
    """
    wide = n + LINE - n % LINE
    room = np.empty(m * wide + LINE)
    first = -(room.ctypes.data // room.itemsize) % LINE
    return room[first : first + m * wide].reshape(m, wide)[:, :n].T


class Block:
    """Memory of one answer.

    Attributes:
        array: As its owner sees it, see `columns`.
        known: What its owner keeps with it.
    """

    def __init__(self, n: int, m: int) -> None:
        self.array, self.known = columns(n, m), dict[Any, Any]()
        room = self.array.base
        assert room is not None
        self._room, self._first = room.data, (self.array.ctypes.data - room.ctypes.data) // self.array.itemsize

    def lend(self, back: Callable[[Block], None]) -> Array:
        """The same numbers for someone else. Shape (n, m).

        Args:
            back: Called when no array on them is left. All views refer to one array, on which they end as NumPy cannot
                look through the memory below it; if it could, the block would never come back.
        """
        n, m = self.array.shape
        lent, wide = np.frombuffer(self._room), self.array.strides[1] // self.array.itemsize
        view = lent[self._first : self._first + m * wide].reshape(m, wide)[:, :n].T
        if view.base is lent:
            weakref.finalize(lent, back, self).atexit = False
        return view


class Pool:
    """Blocks of one shape that come back when the last array on them is gone.

    Memory that is new to the process costs more than the numbers written to it, as the operating system has to clear
    every page. No block is lent twice at a time: arrays, and whatever they export, refer to the one that was lent, and
    the block comes back with the end of that.
    """

    def __init__(self, kept: int = KEPT) -> None:
        self.kept, self.shape, self.free = kept, (0, 0), list[Block]()

    def take(self, n: int, m: int) -> Block:
        """A block of n rows and m columns that nobody else has."""
        if (n, m) != self.shape:
            self.shape, self.free = (n, m), []
        return self.free.pop() if self.free else Block(n, m)

    def lend(self, block: Block) -> Array:
        """A block's numbers for someone else; it comes back when they are done with it. Shape (n, m)."""
        return block.lend(self._take_back)

    def _take_back(self, block: Block) -> None:
        if block.array.shape == self.shape and (len(self.free) + 1) * block.array.nbytes <= self.kept:
            self.free.append(block)
