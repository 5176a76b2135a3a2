"""Command output to streams that may fail, progress display, and messages about stopped commands."""

from __future__ import annotations

import codecs
import errno
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from time import monotonic
from types import FrameType, TracebackType
from typing import TextIO

from screwgauge.reference.errors import OutputError, ScrewgaugeError, log_text, printable
from screwgauge.reference.files import why
from screwgauge.reference.outputs import OVERWRITING

#: Character -> substitute of equal length for streams that cannot encode it, so that columns stay aligned.
SIGNS = {"✓": "+", "✗": "x", "·": ".", "²": "2", "³": "3", "µ": "u", "†": "*", "→": ">"}
STOPS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
BROKEN = 3  # exit status after an unexpected error
_FALLBACK = "screwgauge.signs"
_stopped_by: list[int] = []


@contextmanager
def console() -> Iterator[None]:
    """Prepare the streams for output, and let SIGTERM end a command as cleanly as Ctrl-C."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:  # else the next opened file would get this number, and receive the stream's output
            os.open(os.devnull, os.O_RDWR)
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8", closefd=False)
    codecs.register_error(_FALLBACK, _fall_back)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors=_FALLBACK)
    _stopped_by.clear()
    main = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, _stop) for number in STOPS} if main else {}
    way = OVERWRITING.set("--force")
    try:
        yield
    finally:
        OVERWRITING.reset(way)
        for number, handler in before.items():
            signal.signal(number, handler)


def _fall_back(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(SIGNS.get(sign, "?") for sign in error.object[error.start : error.end]), error.end


def _stop(number: int, frame: FrameType | None) -> None:
    _stopped_by.append(number)
    raise KeyboardInterrupt


def is_stopped() -> bool:
    """Return True if a signal stopped the command, even if a library has swallowed the exception."""
    return bool(_stopped_by)


def say(text: str, end: str = "\n") -> None:
    """Print lines; escape anything in them that a CI service would read as a command.

    Raises:
        OutputError: Standard output is closed, or the disk is full.
    """
    _print(log_text(text), end)


def mark(command: str) -> None:
    """Print a line that a CI service reads as a command."""
    _print(printable(command), "\n")


def _print(text: str, end: str) -> None:
    """Print to standard output; a closed pipe does not change the exit status."""
    try:
        if sys.stdout is None:
            raise OSError(errno.EBADF, "it is closed")
        print(text, end=end, flush=True)
    except OSError as error:
        if sys.stdout is not None:  # Python tries to write the rest again at exit
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            what = f"cannot write to standard output ({why(error)})"
            raise OutputError(what, "", "redirect it to a file or to /dev/null") from None


def complain(text: str) -> None:
    """Print to standard error; ignore a failure to print."""
    with suppress(OSError):
        print(log_text(text), file=sys.stderr, flush=True)


def report_end(error: BaseException, *, debug: bool) -> int:
    """Report in one sentence why a command ended early, or show the traceback.

    Returns:
        The exit status.
    """
    if _stopped_by or isinstance(error, KeyboardInterrupt):  # a library may convert the interrupt
        number = _stopped_by[0] if _stopped_by else signal.SIGINT
        left = str(error) if isinstance(error, KeyboardInterrupt) else ""
        complain(f"screwgauge: {STOPS[signal.Signals(number)]}; {left or 'nothing was written'}.")
        return 128 + number
    known = isinstance(error, ScrewgaugeError)
    if debug:
        complain("".join(traceback.format_exception(error)))
    elif known:
        complain(f"screwgauge: {error}")
    else:
        what = f"this should not have happened ({type(error).__name__}: {error})"
        complain(
            f"screwgauge: {ScrewgaugeError(what, '', 'run the command again with --debug and report the traceback')}"
        )
    return error.exit_status if isinstance(error, ScrewgaugeError) else BROKEN


QUIET = 10.0  # seconds without output before the first line, and between lines, if the stream is not a terminal


class Progress:
    """Display of the current step, which can be erased."""

    def __init__(self, stream: TextIO, clock: Callable[[], float] = monotonic) -> None:
        self.stream, self.clock, self.terminal = stream, clock, stream.isatty()
        self.shown, self.began = "", clock()
        self.last = self.began

    def show(self, step: str, share: float) -> None:
        """Show the name of a step and its completed share, 0 to 1."""
        if self.terminal:
            text = f"{printable(step):<16} {'#' * int(30 * share):<30} {share:4.0%}"
            if text != self.shown:
                self._write(f"\r{text}")
                self.shown = text
        elif (now := self.clock()) - self.last > QUIET:
            self.last = now
            self._write(f"screwgauge: {printable(step)}, {share:.0%} done after {now - self.began:.0f} s\n")

    def _write(self, text: str) -> None:
        with suppress(OSError):  # continue if the terminal is closed
            self.stream.write(text)
            self.stream.flush()

    def __enter__(self) -> Progress:
        return self

    def wipe(self) -> None:
        """Erase the progress line before other output."""
        if self.shown:
            self._write("\r" + " " * len(self.shown) + "\r")
            self.shown = ""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.wipe()
