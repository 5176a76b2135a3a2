"""Settings of processes that run Python: BLAS with one thread, no imports from the current folder.

Anyone may have put modules into the current folder, and Python puts it first on the path of a process started with
``-c`` or ``-m``: a file ``json.py`` there would run in place of Python's own. This module imports little, because BLAS
reads its variables when numpy is first imported.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from threading import Lock

ONE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"), "1")
SAFE = {"PYTHONSAFEPATH": "1"}
MALLOC = {-3: 2**25, -1: 2**28}  # largest M_MMAP_THRESHOLD, and M_TRIM_THRESHOLD, of <malloc.h> [bytes]
_LOCK = Lock()


def fix_threads() -> bool:
    """Limit BLAS and OpenMP to one thread.

    Returns:
        True if the limit takes effect; False if numpy was already imported with different settings.
    """
    if "numpy" in sys.modules:
        return one_thread()
    os.environ.update(ONE)
    return True


def one_thread() -> bool:
    """Return True if every variable is set to one thread."""
    return ONE.items() <= os.environ.items()


def save_time() -> None:
    """Trade memory for time: collect garbage rarely and never at exit, and keep memory freed by arrays.

    Imports and traces of equations make many objects but no garbage. When memory that was returned to the system
    is requested again, the kernel clears it, which takes as long as many computations.
    """
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)
    with suppress(OSError, AttributeError):  # not the GNU C library
        mallopt = ctypes.CDLL(None).mallopt
        for parameter, size in MALLOC.items():
            mallopt(parameter, size)


def python(*arguments: str) -> list[str]:
    """Return the command that starts this Python without the current folder on its path."""
    return [sys.executable, "-P", *arguments]


def safe_path() -> list[str]:
    """Return `sys.path` as absolute paths, without the current folder if Python put it first."""
    places = sys.path
    with suppress(OSError):  # the current folder no longer exists
        if not sys.flags.safe_path and os.path.samefile(places[0], "."):
            places = places[1:]
    return [os.path.abspath(place) for place in places if place]


@contextmanager
def inherit_safely(variables: Mapping[str, str] = SAFE) -> Iterator[None]:
    """Within the context, let processes that a library starts inherit this process's environment and `sys.path`.

    Args:
        variables: Environment variables; they must include `SAFE`.
    """
    with _LOCK:
        path, before = sys.path[:], {name: os.environ.get(name) for name in variables}
        sys.path[:] = safe_path()
        os.environ.update(variables)
        try:
            yield
        finally:
            sys.path[:] = path
            for name, value in before.items():
                os.environ.pop(name) if value is None else os.environ.update({name: value})
