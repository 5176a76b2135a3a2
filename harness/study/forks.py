"""Processes forked from one server that has already imported the common modules.

The server starts with the first process, imports only `NEEDED`, and ends with the last process. The server of
`multiprocessing.get_context` is not used, because it has imported the main script of its first caller. The processes do
not import the main script of their caller either.
"""

from __future__ import annotations

import io
import os
from multiprocessing import popen_forkserver, reduction
from multiprocessing.context import ForkServerContext, ForkServerProcess, set_spawning_popen
from multiprocessing.forkserver import ForkServer, read_signed
from multiprocessing.process import BaseProcess
from multiprocessing.spawn import get_preparation_data
from multiprocessing.util import Finalize

#: Modules that most processes import; libraries of engines are not included.
NEEDED = (
    "loky.process_executor",
    "numpy.ma",
    "screwgauge.study.isolation",
    "screwgauge.study.methods",
    "screwgauge.engines.tree.model",
    "screwgauge.models.readings.source",
)
_SERVER = ForkServer()
_SERVER.set_forkserver_preload([*NEEDED])


def _close(*files: int) -> None:
    for file in files:
        os.close(file)


class _Popen(popen_forkserver.Popen):
    """Process started as in the base class, but from `_SERVER` and without the main script."""

    _fds: list[int]

    def _launch(self, process_obj: BaseProcess) -> None:
        data = get_preparation_data(process_obj.name)
        buffer = io.BytesIO()
        set_spawning_popen(self)
        try:
            reduction.dump({key: data[key] for key in data if not key.startswith("init_main")}, buffer)
            reduction.dump(process_obj, buffer)
        finally:
            set_spawning_popen(None)
        self.sentinel, end = _SERVER.connect_to_new_process(self._fds)
        self.finalizer = Finalize(self, _close, (os.dup(end), self.sentinel))
        with open(end, "wb") as pipe:
            pipe.write(buffer.getbuffer())
        self.pid = read_signed(self.sentinel)


class _Process(ForkServerProcess):
    @staticmethod
    def _Popen(process_obj: BaseProcess) -> _Popen:
        return _Popen(process_obj)


class Forks(ForkServerContext):
    """Multiprocessing context whose processes are forks of the server."""

    Process = _Process
