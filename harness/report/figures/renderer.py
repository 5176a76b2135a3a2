"""Drawing in a separate process, because the chart engine V8 kills its process when memory runs out."""

from __future__ import annotations

import atexit
import base64
import json
import os
import resource
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Lock, Timer
from typing import Any

from screwgauge.processes import python, safe_path
from screwgauge.reference.errors import ReportError
from screwgauge.study.lifeline import lifeline

LONGEST = 60.0  # time limit of one drawing [s]


class DrawingError(ReportError):
    """Raised if a picture could not be drawn."""


class Renderer:
    """The drawing process, started on demand, and restarted after a crash.

    Attributes:
        lost: Reasons why drawings failed.
    """

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None
        self.able = False  # True once the process has answered
        self.lost: list[str] = []
        self.lock = Lock()

    def start(self) -> None:
        """Start the process unless it is running, without waiting for it."""
        if self.process is not None and self.process.poll() is None:
            return
        self.end()
        line = lifeline().fileno()
        self.process = subprocess.Popen(
            python("-m", "screwgauge.report.figures.v8", str(line)),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            pass_fds=(line,),
            env={**os.environ, "PYTHONPATH": os.pathsep.join(safe_path())},
        )
        self.able = False

    def ask(self, call: str, *arguments: Any, **named: Any) -> Any:
        """Call a function of vl_convert; return a string, bytes, or plain data.

        Raises:
            DrawingError: The call failed; the message states the reason.
        """
        with self.lock:
            try:
                answer = self._exchange({"call": call, "arguments": arguments, "named": named})
            except BaseException as error:
                if not isinstance(error, DrawingError):
                    self.end()  # the next call would read an unread answer
                else:
                    self.lost.append(error.what)
                raise
        return base64.b64decode(answer["bytes"]) if "bytes" in answer else answer["text"]

    def _exchange(self, question: dict[str, Any]) -> dict[str, Any]:
        if self.process is None or (self.able and self.process.poll() is not None):
            self._begin()
        process = self.process
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        timer = Timer(LONGEST, process.kill)
        timer.start()
        try:
            process.stdin.write(json.dumps(question).encode() + b"\n")
            process.stdin.flush()
            line = process.stdout.readline()
        except OSError:  # the process has already ended
            line = b""
        finally:
            timer.cancel()
        if not line:
            raise _error(_describe_end(process))
        self.able = True
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise _error(answer["error"])
        return answer

    def _begin(self) -> None:
        try:
            self.start()
        except OSError as error:
            raise _error(f"the drawing process cannot be started ({error.strerror or error})") from None

    def end(self) -> None:
        """End the process."""
        process, self.process = self.process, None
        if process is not None:
            with suppress(OSError):
                process.kill()
            process.communicate()


def _error(why: str) -> DrawingError:
    return DrawingError(why, "", "draw the picture on a computer with more memory, or report this")


def _describe_end(process: subprocess.Popen[bytes]) -> str:
    """Describe how the process ended, with a possible cause."""
    status = process.wait()
    if status == -signal.SIGKILL:
        how = f"was killed: memory ran out, or it took more than {LONGEST:g} s"
    else:
        how = f"was killed by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"
    space, _ = resource.getrlimit(resource.RLIMIT_AS)
    short = space != resource.RLIM_INFINITY
    cause = f"; its address space is limited to {space / 1e9:.3g} GB (ulimit -v), and V8 reserves more" if short else ""
    return f"the drawing process {how}{cause}"


RENDERER = Renderer()
atexit.register(RENDERER.end)
os.register_at_fork(after_in_child=RENDERER.__init__)  # type: ignore[misc]  # a child has not started the process


@contextmanager
def losses() -> Iterator[list[str]]:
    """Collect the reasons why drawings failed; the list is complete at the end of the context."""
    reasons, before = list[str](), len(RENDERER.lost)
    yield reasons
    reasons += RENDERER.lost[before:]
