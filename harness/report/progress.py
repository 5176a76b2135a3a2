"""One line of progress on a terminal; silence in a pipe."""

from __future__ import annotations

from types import TracebackType
from typing import TextIO


class Line:
    """Rewrites one line of a terminal, and wipes it at the end."""

    def __init__(self, stream: TextIO) -> None:
        self.stream, self.shown, self.live = stream, "", stream.isatty()

    def show(self, step: str, share: float) -> None:
        """Shows the name of a step and its share done, 0 to 1."""
        text = f"{step:<16} {'#' * int(30 * share):<30} {share:4.0%}"
        if self.live and text != self.shown:
            self.stream.write(f"\r{text}")
            self.stream.flush()
            self.shown = text

    def __enter__(self) -> Line:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.shown:
            self.stream.write("\r" + " " * len(self.shown) + "\r")
            self.stream.flush()
