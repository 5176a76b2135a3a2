"""How processes run Python: BLAS with one thread, and nothing imported from the current folder.

Anybody may have put modules into that folder, and Python puts it first on the path of what it starts by ``-c`` and
``-m``: a file ``json.py`` there would run in place of Python's own. Imports little: BLAS reads its variables when numpy
is first imported.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from threading import Lock

ONE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"), "1")
SAFE = {"PYTHONSAFEPATH": "1"}
_LOCK = Lock()


def fix_threads() -> bool:
    """One thread for BLAS and OpenMP.

    Returns:
        Whether it takes effect: False if numpy is there already, with whatever it was started with.
    """
    if "numpy" in sys.modules:
        return one_thread()
    os.environ.update(ONE)
    return True


def one_thread() -> bool:
    """Whether every variable is set to one thread."""
    return ONE.items() <= os.environ.items()


def collect_rarely() -> None:
    """Look for garbage in cycles a seventieth as often, and not at the end of the process.

    Imports and traces of equations make many objects and no garbage.
    """
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)


def python(*arguments: str) -> list[str]:
    """Return the command that starts this Python without the current folder on its path."""
    return [sys.executable, "-P", *arguments]


def safe_path() -> list[str]:
    """Return `sys.path` as absolute paths, without the folder that Python put first because it is the current one."""
    places = sys.path
    with suppress(OSError):  # there is no such folder
        if not sys.flags.safe_path and os.path.samefile(places[0], "."):
            places = places[1:]
    return [os.path.abspath(place) for place in places if place]


@contextmanager
def inherit_safely(variables: Mapping[str, str] = SAFE) -> Iterator[None]:
    """Lets a library start processes, which inherit the environment and `sys.path` that this one has meanwhile.

    Args:
        variables: Of the environment; `SAFE` among them.
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
