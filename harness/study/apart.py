"""Calls of external code in a fork of this process; the fork ends with the call and returns only plain data.

Whatever the code prints, patches, changes, starts or breaks, only the fork is affected. The answer is read by an
unpickler that accepts only numbers, strings and their containers, so that no code from the answer is run. Only workers
may fork, because their other threads just wait and hold no locks. Other processes call a worker, see `isolation`.
"""

from __future__ import annotations

import faulthandler
import io
import os
import pickle
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

from screwgauge import solution
from screwgauge.reference import errors
from screwgauge.reference.errors import ScrewgaugeError
from screwgauge.study.lifeline import end_with_thread

#: Types of an answer, whose instances contain only numbers and strings.
_PLAIN = {(solution.__name__, name) for name in ("Cost", "Error", "Failure", "Solution", "Timing", "Values")}
#: Names with which numpy 1 and 2 pickle arrays of numbers.
_PLAIN |= {("numpy", "dtype"), ("numpy", "ndarray")}
_PLAIN |= {(f"numpy.{core}.multiarray", "_reconstruct") for core in ("core", "_core")}
PRINTED = 2000  # number of bytes kept from the end of the output, where a traceback ends
_ANSWER, _SAID = "answer", "printed"
_RETURNED, _MEMORY = "returned", "memory"


class CrashedError(Exception):
    """Raised if a call terminated its process or did not return plain data. Notes contain the output of the call."""


def call_in_fork(call: Callable[[], object]) -> tuple[Any, str]:
    """Call a function in a fork; return its result, which must be plain data, and the end of its output.

    Raises:
        ScrewgaugeError: The call raised this error; notes contain the traceback.
        MemoryError: The call needs more memory than is available.
        CrashedError: The call raised a different exception, crashed, or did not return plain data.
    """
    with tempfile.TemporaryDirectory(prefix="screwgauge-") as name:
        folder, first = Path(name), end_with_thread()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # warns of forks with threads, but these only wait
            child = os.fork()
        if not child:
            _run(call, folder, first)
        _, status = os.waitpid(child, os.WUNTRACED)
        for each in (os.kill, os.killpg) if os.WIFSTOPPED(status) else (os.killpg,):
            with suppress(OSError):  # the call started no process, or all have ended
                each(child, signal.SIGKILL)
        if os.WIFSTOPPED(status):
            os.waitpid(child, 0)
        try:
            return _outcome(folder, status), _read_output(folder)
        except Exception as error:
            error.add_note(_read_output(folder))
            raise


def _run(call: Callable[[], object], folder: Path, first: Callable[[], None]) -> NoReturn:
    """Run a call in the forked child: start a session, redirect output to a file, and write the answer to a file."""
    try:
        first()
        os.setsid()
        said = os.open(folder / _SAID, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        for here, there in ((os.open(os.devnull, os.O_RDONLY), 0), (said, 1), (said, 2)):
            os.dup2(here, there)
        sys.stdout = sys.stderr = io.TextIOWrapper(io.FileIO(2, "w", closefd=False), line_buffering=True)
        faulthandler.enable(2)
        answer = pickle.dumps(_call(call))
        place = folder / f"{_ANSWER}.{os.getpid()}"
        place.write_bytes(answer)
        place.rename(folder / _ANSWER)
    except BaseException:
        with suppress(BaseException):
            traceback.print_exc()
    finally:
        os._exit(0)


def _call(call: Callable[[], object]) -> tuple[str, Any]:
    """Call a function; return the kind of outcome, and either the result or the data of the error."""
    try:
        return _RETURNED, call()
    except MemoryError:
        return _MEMORY, None
    except ScrewgaugeError as error:
        kind = next(each for each in type(error).__mro__ if each.__module__ == errors.__name__)
        facts = tuple(str(getattr(error, name)) for name in ("what", "where", "remedy"))
        return kind.__name__, (*facts, "".join(traceback.format_exception(error)))


def _outcome(folder: Path, status: int) -> Any:
    """Return the result of the call, or raise its error."""
    if os.WIFSTOPPED(status) or os.WIFSIGNALED(status):
        code = os.WSTOPSIG(status) if os.WIFSTOPPED(status) else os.WTERMSIG(status)
        raise CrashedError(f"crashed: its process received {signal.Signals(code).name}")
    try:
        data = (folder / _ANSWER).read_bytes()
    except OSError:
        raise CrashedError(f"crashed: its process exited with status {os.waitstatus_to_exitcode(status)}") from None
    try:
        how, what = _Plain(io.BytesIO(data)).load()
        if how == _RETURNED:
            return what
        if how == _MEMORY:
            raise MemoryError
        *facts, text = map(str, what)
        error = _rebuild_error(str(how), *facts)
    except MemoryError:
        raise
    except Exception as wrong:  # malformed bytes may raise anything
        raise CrashedError(f"did not return plain data ({wrong})") from None
    error.add_note(text)
    raise error


def _rebuild_error(kind: str, what: str, where: str, remedy: str) -> ScrewgaugeError:
    """Recreate an error of this package without calling its constructor, whose arguments may differ."""
    form = getattr(errors, kind)
    if not issubclass(form, ScrewgaugeError):
        raise TypeError(f"{kind} is not an error")
    error: ScrewgaugeError = form.__new__(form)
    ScrewgaugeError.__init__(error, what, where, remedy)
    return error


def _read_output(folder: Path) -> str:
    with suppress(OSError), (folder / _SAID).open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - PRINTED))
        return f"It printed:\n{file.read().decode(errors='replace')}"
    return ""


class _Plain(pickle.Unpickler):
    """Unpickler for numbers, strings, arrays and answers; unpickling any other type could run code."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in _PLAIN:
            return super().find_class(module, name)
        raise TypeError(f"it contains {name:.100} of {module:.100}")
