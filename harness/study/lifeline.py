"""A lifeline: processes started by this process end when it ends for any reason, even ``kill -9``.

The lifeline is a pipe whose writing end is open only in this process; the kernel closes it when the process ends. The
kernel then kills every process that has the reading end open, even one in a C loop that never returns to Python. A
parent-death signal (``PR_SET_PDEATHSIG``) would not do: it is sent when the *thread* that started the process ends.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe
from threading import Lock, Thread

_PDEATHSIG = 1  # PR_SET_PDEATHSIG in <sys/prctl.h>
_LOCK = Lock()
_ends: tuple[Connection, Connection] | None = None  # reading end, writing end


def lifeline() -> Connection:
    """Return the reading end, which child processes must `hold`; it can be pickled while starting a process."""
    global _ends
    with _LOCK:
        _ends = _ends or Pipe(duplex=False)
        return _ends[0]


def _close_writing_end() -> None:
    """Close the writing end in a fork, because it would keep the pipe open."""
    global _ends, _LOCK
    _LOCK = Lock()
    if _ends is not None:
        _ends[1].close()
        _ends = None


os.register_at_fork(after_in_child=_close_writing_end)


def end_with_thread() -> Callable[[], None]:
    """Return a ``preexec_fn`` for `subprocess.run`: the program is killed if the thread that waits for it ends.

    It has no effect on systems other than Linux.
    """
    if not sys.platform.startswith("linux"):
        return lambda: None
    control, parent = ctypes.CDLL(None).prctl, os.getpid()

    def first() -> None:
        control(_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # the parent has already ended
            os.kill(os.getpid(), signal.SIGKILL)

    return first


def hold(line: Connection) -> None:
    """Make this process end when the process that created the lifeline ends."""
    with suppress(OSError, AttributeError):  # F_SETSIG and /proc exist only on Linux; elsewhere the thread must suffice
        # reopen, because the signal's owner belongs to the open file description, which processes share
        reopened = os.open(f"/proc/self/fd/{line.fileno()}", os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        fcntl.fcntl(reopened, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(reopened, fcntl.F_SETSIG, signal.SIGKILL)
        fcntl.fcntl(reopened, fcntl.F_SETFL, os.O_NONBLOCK | os.O_ASYNC)
    Thread(target=_wait, args=(line,), daemon=True, name="lifeline").start()


def _wait(line: Connection) -> None:
    """Wait until the pipe is closed; nothing is ever written to it."""
    with suppress(OSError):
        line.poll(None)
    os.kill(os.getpid(), signal.SIGKILL)
