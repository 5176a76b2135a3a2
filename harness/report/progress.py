"""Progress: one line that is rewritten on a terminal, a line now and then of long work elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from types import TracebackType
from typing import TextIO

from screwgauge.reference.errors import printable

QUIET = 10.0  # s without a word where the output is no terminal, and from one line to the next


class Progress:
    """Shows the step that work is at, and wipes it at the end."""

    def __init__(self, stream: TextIO, clock: Callable[[], float] = monotonic) -> None:
        self.stream, self.clock, self.terminal = stream, clock, stream.isatty()
        self.shown, self.began = "", clock()
        self.said = self.began

    def show(self, step: str, share: float) -> None:
        """Takes the name of a step and its share done, 0 to 1."""
        if self.terminal:
            text = f"{printable(step):<16} {'#' * int(30 * share):<30} {share:4.0%}"
            if text != self.shown:
                self._write(f"\r{text}")
                self.shown = text
        elif (now := self.clock()) - self.said > QUIET:
            self.said = now
            self._write(f"screwgauge: {printable(step)}, {share:.0%} done after {now - self.began:.0f} s\n")

    def _write(self, text: str) -> None:
        with suppress(OSError):  # nobody looks any more, which is no reason to stop
            self.stream.write(text)
            self.stream.flush()

    def __enter__(self) -> Progress:
        return self

    def wipe(self) -> None:
        """Makes room for what is printed."""
        if self.shown:
            self._write("\r" + " " * len(self.shown) + "\r")
            self.shown = ""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.wipe()
