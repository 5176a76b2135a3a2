"""Work that ends its process, or never ends, and an engine that does so; imports little, as it starts often."""

import ctypes
import os
import shutil
import signal
from functools import partial
from pathlib import Path
from threading import Lock


def fine(progress) -> int:
    return os.getpid()


def segfault(progress) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def abort(progress) -> None:
    os.abort()


def leave(progress) -> None:
    os._exit(0)


def hang(progress) -> None:
    while True:
        signal.pause()


def hog(progress) -> int:
    return len(bytearray(b"x") * 800_000_000)


def odd(progress) -> object:
    return Lock()  # does not pickle


def refuse(progress) -> None:
    from screwgauge.reference.errors import UnknownNameError

    raise UnknownNameError("leg", "leg5", ["leg4"], "own.xml")


def until_seen(progress, seen: Path) -> str:
    progress(0.5)
    while not seen.exists():
        os.sched_yield()
    return "seen"


class _Model:
    def __init__(self, work) -> None:
        self.work = work

    def solve(self, problem, progress) -> None:
        self.work(progress)


def load(files, *, work) -> _Model:
    return _Model(work)


load_hang = partial(load, work=hang)


def _begun(folder: Path) -> None:
    (folder / f"{os.getpid()}.pid").touch()


def spin_in_c(progress=None) -> None:
    ctypes.PyDLL(None).pause()


def spins_in_c(progress, folder: Path) -> None:
    _begun(folder)
    spin_in_c()


def spins(progress, folder: Path) -> None:
    _begun(folder)
    while True:
        pass


def waits(progress, folder: Path) -> None:
    _begun(folder)
    hang(progress)


def timer(progress) -> float:
    return signal.getitimer(signal.ITIMER_REAL)[0]


def says_where_nothing_can_be_written(progress) -> str:
    (file,) = progress.args
    shutil.rmtree(file.parent)
    progress(0.5)
    return "done"


def where(progress) -> str:
    return os.getcwd()


def server(progress) -> int:
    return os.getppid()


def variable(progress) -> str:
    return os.environ["SCREWGAUGE_TEST"] + os.environ["MUJOCO_GL"]
