"""A lifeline: processes that this one starts end when it ends, however it ends, even by ``kill -9``.

It is a pipe whose writing end this process alone holds; the kernel closes it with the process. Whoever holds the
reading end is killed by the kernel then, so that a loop in C that never gives Python a turn ends, too. The parent's own
death signal (``PR_SET_PDEATHSIG``) would not do: it comes when the *thread* ends that started the process.
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

_PDEATHSIG = 1  # PR_SET_PDEATHSIG of <sys/prctl.h>
_LOCK = Lock()
_ends: tuple[Connection, Connection] | None = None  # for reading and for writing


def lifeline() -> Connection:
    """The reading end, which processes started by this one have to `hold`; it pickles to a process being started."""
    global _ends
    with _LOCK:
        _ends = _ends or Pipe(duplex=False)
        return _ends[0]


def _let_go() -> None:
    """Closes the writing end in a fork, which would keep it open."""
    global _ends, _LOCK
    _LOCK = Lock()
    if _ends is not None:
        _ends[1].close()
        _ends = None


os.register_at_fork(after_in_child=_let_go)


def tied() -> Callable[[], None]:
    """A ``preexec_fn`` of `subprocess.run`: the program ends with the calling thread, which waits for it.

    On Linux; elsewhere it does nothing.
    """
    if not sys.platform.startswith("linux"):
        return lambda: None
    control, parent = ctypes.CDLL(None).prctl, os.getpid()

    def first() -> None:
        control(_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it had ended before
            os.kill(os.getpid(), signal.SIGKILL)

    return first


def hold(line: Connection) -> None:
    """Ends this process when the one that made the lifeline has ended."""
    with suppress(OSError, AttributeError):  # F_SETSIG and /proc are Linux's; elsewhere the thread has to do
        # opened anew: who is told is a property of an open file, which processes share
        reopened = os.open(f"/proc/self/fd/{line.fileno()}", os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        fcntl.fcntl(reopened, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(reopened, fcntl.F_SETSIG, signal.SIGKILL)
        fcntl.fcntl(reopened, fcntl.F_SETFL, os.O_NONBLOCK | os.O_ASYNC)
    Thread(target=_wait, args=(line,), daemon=True, name="lifeline").start()


def _wait(line: Connection) -> None:
    """Waits for the end of the pipe: nothing is ever written."""
    with suppress(OSError):
        line.poll(None)
    os.kill(os.getpid(), signal.SIGKILL)
